"""Skew, threshold and cumulative sums between the two units, on records whose mismatches are known."""

import numpy as np
import pytest

from pipeline.rigs.rap.alarms import MismatchLimits
from pipeline.rigs.rap.alarms.cusum import cumulative, second_means, threshold_onsets
from pipeline.rigs.rap.alarms.redundancy import redundancy
from pipeline.rigs.rap.alarms.skew import skew_of
from pipeline.rigs.rap.tables import Signal

AMPLITUDE, FREQUENCY = 900.0, 2.559


def _pair(duration=600.0, skew=0.010, seed=0, change=None, rate=20.0, drift=0.0):
    """Return control and protective unit: pulsation with an overtone, shared and own noise, steps of 26 Pa."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 1.0 / rate)
    wander = np.cumsum(rng.standard_normal(t.size)) * 0.003

    def wave(time):
        phase = 2.0 * np.pi * FREQUENCY * time + np.interp(time, t, wander)
        return AMPLITUDE * np.cos(phase) + 0.2 * AMPLITUDE * np.cos(2.0 * phase + 0.4)

    shared = 20.0 * rng.standard_normal(t.size)
    control = 4000.0 + wave(t) + shared + 15.0 * rng.standard_normal(t.size)
    protective = 4000.0 + wave(t + skew + drift * t) + shared + 15.0 * rng.standard_normal(t.size)
    if change is not None:
        protective = protective + change(t)
    return [Signal(name, t, np.round(y / 26.0) * 26.0) for name, y in (("rap", control), ("prot", protective))]


def _step(size, at=300.0):
    return lambda t: size * (t >= at)


def _found(pair, **limits):
    return redundancy("run", "prefilter", *pair, MismatchLimits(**limits))


@pytest.mark.parametrize("skew", [-0.015, 0.0, 0.005, 0.010, 0.025])
def test_skew_is_found_to_a_tenth_of_a_millisecond(skew):
    control, protective = _pair(skew=skew)
    found = skew_of(control.time, control.values, protective.values)
    assert found.value == pytest.approx(skew, abs=1e-4)
    assert found.error < 1e-4


def test_skew_is_covered_by_its_error():
    z = []
    for seed in range(60):
        control, protective = _pair(300.0, seed=seed)
        found = skew_of(control.time, control.values, protective.values)
        z.append((found.value - 0.010) / found.error)
    assert np.std(z) == pytest.approx(1.0, abs=0.5)


def test_a_clock_that_runs_away_is_followed():
    control, protective = _pair(1800.0, drift=20e-6)
    found = skew_of(control.time, control.values, protective.values)
    assert found.slope == pytest.approx(20e-6, rel=0.05)
    assert redundancy("run", "prefilter", control, protective, MismatchLimits()).mismatches == ()


def test_no_pulsation_tells_no_skew():
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 300.0, 0.05)
    assert skew_of(t, 20.0 * rng.standard_normal(t.size), 20.0 * rng.standard_normal(t.size)) is None


def test_noise_without_skew_is_that_of_two_converters():
    # sqrt(2*15^2 + 2*26^2/12)
    assert _found(_pair()).noise == pytest.approx(23.7, rel=0.05)


def test_skew_alone_makes_false_onsets_which_vanish_when_it_is_removed():
    found = _found(_pair(3600.0, skew=0.025), threshold=200.0)
    assert found.false_raw.per_hour > 100.0
    assert found.false_kept.count == 0
    assert found.mismatches == ()
    assert any("25" in problem.message for problem in found.problems)


@pytest.mark.parametrize(("size", "threshold", "cusum"), [(500.0, 0.15, 1.0), (100.0, None, 2.0), (-250.0, None, 1.0)])
def test_delay_of_steps_is_that_of_the_fact_sheet(size, threshold, cusum):
    found = _found(_pair(change=_step(size, 300.02))).mismatches
    assert len(found) == 1
    assert found[0].kind == "step"
    assert found[0].size == pytest.approx(size, rel=0.05)
    assert found[0].onset == pytest.approx(300.02, abs=0.2)
    assert (found[0].by_threshold is None) == (threshold is None)
    if threshold is not None:
        assert found[0].by_threshold - 300.0 == pytest.approx(threshold, abs=0.08)
    assert found[0].by_cusum - 300.0 == pytest.approx(cusum, abs=1.05)


@pytest.mark.parametrize(("slope", "delay"), [(5.0, 10.0), (1.0, 32.0)])
def test_delay_of_drifts_is_that_of_the_fact_sheet(slope, delay):
    found = _found(_pair(change=lambda t: slope * np.maximum(t - 300.0, 0.0))).mismatches
    assert len(found) == 1
    assert found[0].kind == "drift"
    assert found[0].size == pytest.approx(slope, rel=0.1)
    assert found[0].time - 300.0 == pytest.approx(delay, rel=0.25)
    assert found[0].onset == pytest.approx(300.0, abs=3.0 if slope > 2.0 else 12.0)


def test_two_mismatches_are_two_and_have_ends():
    def both(t):
        return 400.0 * ((t >= 100.0) & (t < 140.0)) - 200.0 * ((t >= 400.0) & (t < 450.0))

    found = _found(_pair(change=both)).mismatches
    assert [m.index for m in found] == [1, 2]
    assert [np.sign(m.size) for m in found] == [1.0, -1.0]
    assert found[0].end == pytest.approx(140.0, abs=2.0)
    assert found[1].end == pytest.approx(450.0, abs=2.0)


@pytest.mark.parametrize("unit", [0, 1])
def test_a_unit_that_stands_still_is_stuck(unit):
    pair = _pair()
    values = pair[unit].values.copy()
    values[6000:9000] = values[6000]
    pair[unit] = Signal(pair[unit].name, pair[unit].time, values)
    found = _found(pair).mismatches
    assert [m.kind for m in found] == ["stuck"]
    assert found[0].onset == pytest.approx(300.0, abs=0.1)
    assert found[0].end == pytest.approx(450.0, abs=0.2)
    assert found[0].delay == pytest.approx(2.0, abs=0.1)


def test_a_logger_that_holds_both_readings_is_no_mismatch():
    pair = _pair()
    held = []
    for signal in pair:
        values = signal.values.copy()
        values[6000:6100] = values[6000]
        held.append(Signal(signal.name, signal.time, values))
    assert all(m.kind != "stuck" for m in _found(held).mismatches)


def test_mixed_units_and_a_turned_sign_are_told_and_not_compared():
    control, protective = _pair()
    for factor, word in ((1.0 / 133.322, "mmHg"), (-1.0, "sign")):
        found = _found([control, Signal("prot", protective.time, factor * protective.values)])
        assert found.mismatches == ()
        assert word in found.problems[0].message


def test_units_on_stamps_of_their_own_are_compared():
    control, protective = _pair(skew=0.0)
    other = Signal(
        "prot", protective.time[:-1] + 0.02, np.interp(protective.time[:-1] + 0.02, protective.time, protective.values)
    )
    assert _found([control, other]).mismatches == ()


def test_short_and_separate_records_are_not_compared():
    control, protective = _pair(0.5)
    assert _found([control, protective]) is None
    control, protective = _pair(60.0)
    assert _found([control, Signal("prot", protective.time + 100.0, protective.values)]) is None


def test_cumulative_sum_is_pages():
    rng = np.random.default_rng(2)
    x = 10.0 * rng.standard_normal(300)
    expected, s = [], 0.0
    for value in x:
        s = max(0.0, s + value - 3.0)
        expected.append(s)
    assert cumulative(x, 3.0) == pytest.approx(expected)


def test_threshold_needs_so_many_samples_in_a_row():
    r = np.array([0, 9, 9, 0, 9, 9, 9, 9, 0, -9, 9, -9.0])
    assert threshold_onsets(r, 5.0, 3).tolist() == [6, 11]
    assert threshold_onsets(r, 5.0, 1).tolist() == [1, 4, 9]


def test_means_of_seconds_end_where_the_second_ends():
    ends, means, size = second_means(np.arange(0.0, 3.0, 0.5), np.array([1.0, 3.0, np.nan, 5.0, 2.0, 2.0]))
    assert ends.tolist() == [1.0, 2.0, 3.0]
    assert means.tolist() == [2.0, 5.0, 2.0]
    assert size[0] == pytest.approx(np.sqrt(5.0))


def test_noisy_converters_widen_the_allowance_and_a_slow_log_is_not_compared():
    rng = np.random.default_rng(3)
    control, protective = _pair(skew=0.0)
    noisy = Signal("prot", protective.time, protective.values + 150.0 * rng.standard_normal(protective.time.size))
    found = _found([control, noisy])
    assert found.mismatches == ()
    assert any("widened" in problem.message for problem in found.problems)
    slow = [Signal(s.name, s.time[::20], s.values[::20]) for s in _pair(1800.0, skew=0.015)]
    found = _found(slow)
    assert found.mismatches == ()
    assert any("20 Hz" in problem.message for problem in found.problems)
