"""Events of a drive: all of them, their centres and kinds, and none that is not there."""

import numpy as np
import pytest
from drives_of_truth import drive

from pipeline.rigs.tire.road.events import LONGITUDINAL, VERTICAL, events

TURN = 0.143


def quiet(seed=0, n=300, load_sd=22.0, force_sd=35.0, colour=0.0):
    """Revolutions at 50 km/h without events: time, speed, load, its error, force, its error; noise may be coloured."""
    rng = np.random.default_rng(seed)

    def noise(sd):
        white = rng.standard_normal(n)
        for i in range(1, n):
            white[i] = colour * white[i - 1] + np.sqrt(1 - colour**2) * white[i]
        return sd * white

    time = TURN * np.arange(n)
    load, force = 3500.0 + noise(load_sd), noise(force_sd)
    return time, np.full(n, 2 * np.pi / TURN), load, np.full(n, load_sd), force, np.full(n, force_sd)


def pulse(time, centre, width, height):
    phase = (time - centre) / width
    return np.where(np.abs(phase) < 0.5, 0.5 * height * (1 + np.cos(2 * np.pi * phase)), 0.0)


def found_in(parts, **options):
    return events(*parts, **options)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_six_events_of_the_standard_drive_are_found_in_time(seed):
    f = drive(seed).forces
    found = events(f.time, f.speed, f.load, f.load_se, f.force, f.force_se, usable=f.fits)
    assert [event.kind for event in found] == [LONGITUDINAL, *[VERTICAL] * 4, LONGITUDINAL]
    assert [event.time for event in found] == pytest.approx([11.85, 18.0, 20.0, 23.0, 26.0, 32.1], abs=0.1)
    assert np.sign([event.change for event in found]).tolist() == [1, 1, -1, 1, 1, -1]


def test_twenty_quiet_hours_worth_of_noise_hold_no_event():
    for seed in range(20):
        assert found_in(quiet(seed, n=2000)) == []


def test_coloured_noise_holds_no_event():
    for seed in range(20):
        assert found_in(quiet(seed, n=1000, colour=0.5)) == []


def test_a_quiet_drive_of_the_synthetic_tire_holds_no_event():
    for seed in (1, 2):
        f = drive(seed, pulses=(), speeds=((0.0, 14.0), (1.0, 14.0)), duration=25.0).forces
        assert events(f.time, f.speed, f.load, f.load_se, f.force, f.force_se, usable=f.fits) == []


def test_standard_errors_of_the_centres_are_true():
    off = []
    for seed in range(60):
        time, speed, load, load_se, force, force_se = quiet(seed)
        centre = 20.0 + 0.01 * seed
        found = events(time, speed, load + pulse(time, centre, 1.2, 600.0), load_se, force, force_se)
        assert len(found) == 1
        off.append((found[0].time - centre) / found[0].time_se)
    assert 0.6 < np.std(off) < 1.2
    assert abs(np.mean(off)) < 0.5


def test_a_slow_change_of_the_load_is_no_event():
    time, speed, load, *rest = quiet(3, n=2000)
    for slow in (
        -400.0 * time / time[-1],
        300.0 * np.sin(2 * np.pi * time / 120.0),
        300.0 * np.tanh((time - 100.0) / 8.0),
    ):
        assert found_in((time, speed, load + slow, *rest)) == []


def test_a_bump_while_braking_is_told_apart_from_the_load_transfer():
    time, speed, load, load_se, force, force_se = quiet(4)
    braking = np.where((time > 15.0) & (time < 20.0), -900.0, 0.0)
    parts = (time, speed, load - 0.3 * braking + pulse(time, 17.0, 0.8, 500.0), load_se, force + braking, force_se)
    found = found_in(parts)
    assert [event.kind for event in found] == [VERTICAL, LONGITUDINAL]
    assert found[0].time == pytest.approx(17.0, abs=0.1)
    assert found[1].time == pytest.approx(17.5, abs=0.1)


def test_two_bumps_that_touch_are_two():
    time, speed, load, *rest = quiet(5)
    bumps = pulse(time, 18.0, 1.0, 500.0) + pulse(time, 19.2, 1.0, 500.0) + pulse(time, 20.2, 1.0, -500.0)
    found = found_in((time, speed, load + bumps, *rest))
    assert [round(event.time, 1) for event in found] == pytest.approx([18.0, 19.2, 20.2], abs=0.11)


def test_an_event_at_the_end_or_beside_a_gap_says_so():
    time, speed, load, load_se, force, force_se = quiet(6)
    load = load + pulse(time, time[-1], 1.2, 600.0) + pulse(time, 20.0, 1.2, 600.0)
    usable = (time < 20.1) | (time > 23.0)
    found = events(time, speed, load, load_se, force, force_se, usable=usable)
    assert [event.cut for event in found] == [True, True]
    clear = events(*quiet(6)[:2], quiet(6)[2] + pulse(time, 30.0, 1.2, 600.0), load_se, force, force_se)
    assert [event.cut for event in clear] == [False]


def test_a_single_wild_revolution_is_no_event():
    time, speed, load, *rest = quiet(7)
    load[100] += 2000.0
    assert found_in((time, speed, load, *rest)) == []


def test_events_stand_out_of_a_rough_road_by_its_own_scatter():
    time, speed, load, load_se, force, force_se = quiet(8, load_sd=66.0)
    rough = (time, speed, load, load_se / 3.0, force, force_se)
    assert found_in(rough) == []
    loud = (time, speed, load + pulse(time, 20.0, 1.2, 800.0), load_se / 3.0, force, force_se)
    assert len(found_in(loud)) == 1


def test_too_few_revolutions_hold_no_event():
    assert found_in(quiet(1, n=6)) == []
