"""The tank's filter is filterpy's, follows volume and gain, fills the blind start backwards, and is honest about its errors."""

from dataclasses import replace

import numpy as np
import pytest
from tank_runs import RATE, TANK, tank_run

from pipeline.errors import InputError
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.command import command_of
from pipeline.rigs.rap.therapy.consistency import consistency
from pipeline.rigs.rap.therapy.pump_gain import mean_gain
from pipeline.rigs.rap.therapy.tank_filter import track_volume
from pipeline.rigs.rap.therapy.tank_kalman import PATIENCE, TankFilter


def rough(n=400):
    """Steps, asked (litre), levels with a gap, wild ones, and a jump that lasts."""
    rng = np.random.default_rng(3)
    asked = np.full(n, RATE * 1e3)
    level = 0.05 + np.cumsum(0.97 * asked) * 1e-3 / TANK.area + 1e-3 * rng.standard_normal(n)
    level[40] += 0.1
    level[60:90] = np.nan
    level[200:] += 0.03
    return np.ones(n), asked, level, np.full(n, 1e-6)


def test_the_compiled_loops_are_filterpy():
    courses, smooth = [], []
    for compiled in (True, False):
        steps, asked, level, R = rough()
        one = TankFilter(0.4, 0.05, TANK.area, compiled=compiled)
        courses.append(one.advance(steps, asked, level, R))
        smooth.append(one.smoothed(steps, asked, courses[-1]))
    for name in ("states", "covariances", "innovation", "spread", "extra"):
        a, b = (getattr(c, name) for c in courses)
        assert np.allclose(a, b, rtol=1e-8, atol=1e-12, equal_nan=True), name
    assert np.array_equal(courses[0].gated, courses[1].gated)
    assert np.allclose(smooth[0][0], smooth[1][0], rtol=1e-7, atol=1e-10)
    assert np.allclose(smooth[0][1], smooth[1][1], rtol=1e-6, atol=1e-14)


def test_a_wild_echo_is_passed_over_and_sixty_in_a_row_are_followed():
    steps, asked, level, R = rough()
    made = TankFilter(0.4, 0.05, TANK.area).advance(steps, asked, level, R)
    assert made.gated[40]
    jumped = np.flatnonzero(made.extra > 0.0)
    assert jumped[0] == 200 + PATIENCE
    assert made.states[300, 0] * 1e-3 / TANK.area == pytest.approx(np.mean(level[290:310]), abs=1e-3)


def test_the_volume_is_followed_to_less_than_a_millilitre_with_and_without_the_key():
    for V0, pressed in ((0.0, [0.0]), (0.3e-3, [])):
        run = tank_run(V0=V0, minutes=90)
        found = run.course(pressed)
        later = found.time > found.first_echo + 600.0
        error = (found.volume - run.V)[later]
        assert np.sqrt(np.mean(error**2)) < 0.7e-6
        assert found.consistency.passed
        assert found.consistency.mean_nis == pytest.approx(1.0, abs=0.1)
        assert found.segments[0].known_empty is bool(pressed)


def test_the_blind_start_is_filled_backwards():
    run = tank_run(V0=0.02e-3, minutes=60)
    found = run.course()
    assert found.first_echo > 600.0
    before = found.time < found.first_echo
    assert np.sqrt(np.mean((found.smoothed_volume - run.V)[before] ** 2)) < 3e-6
    assert found.smoothed_sd[0] < 5e-6
    assert found.volume_sd[0] > 100e-6  # nobody had told the volume at the time


def test_the_final_volume_is_covered():
    covered = []
    for seed in range(60):
        run = tank_run(seed, minutes=40)
        final = run.course().final
        covered.append(final.ci95[0] < run.V[-1] < final.ci95[1])
    assert 0.9 <= np.mean(covered) <= 1.0  # 60 tries of 95 % are 57 +- 1.7


def test_the_gain_is_the_runs_mean_and_its_error_that_of_the_lasting_one():
    lasting, realised = [], []
    for seed in range(40):
        run = tank_run(seed, minutes=60)
        found = mean_gain(run.course(), run.command)
        on = run.asked > 0.0
        lasting.append(found.gain.ci95[0] < 0.97 < found.gain.ci95[1])
        realised.append((found.gain.value - run.gain[on].mean()) / found.realised_sd)
    assert np.mean(lasting) >= 0.9
    assert 0.7 < np.std(realised) < 1.3


def test_noise_larger_than_expected_is_found_told_and_counted():
    run = tank_run(noise=2.5e-3)
    found = run.course()
    assert np.sqrt(found.consistency.noise_factor) == pytest.approx(2.5, rel=0.1)
    assert "scatters by 2." in found.consistency.verdict
    assert not found.consistency.passed
    assert found.final.std_error > 1.5 * tank_run().course().final.std_error
    assert any("scatters" in p.message for p in found.problems)


def test_errors_that_hang_together_widen():
    rng = np.random.default_rng(0)
    slow = np.convolve(rng.standard_normal(4010), np.ones(10) / np.sqrt(10), "valid")
    told = consistency(slow, np.zeros(slow.size, dtype=bool))
    assert 2.3 < told.widening < 4.5
    assert "correlated" in told.verdict


def test_without_any_echo_the_command_carries_on_and_the_error_grows():
    run = tank_run(V0=0.0, minutes=12)
    found = run.course([0.0])
    assert found.first_echo is None
    assert found.volume[-1] == pytest.approx(run.asked.sum(), rel=0.01)
    assert found.volume_sd[-1] > 0.14 * run.asked.sum()
    with pytest.raises(InputError, match="no echoes"):
        mean_gain(found, run.command)


def test_a_missing_command_is_replaced_by_the_set_point_and_told():
    run = tank_run()
    stand_in = command_of(None, run.signals["set"], stopped=[(100.0, 200.0), (3000.0, np.inf)])
    assert "set-point" in stand_in.problems[0].message
    assert stand_in.at(np.array([150.0, 250.0, 3100.0])).tolist() == [0.0, RATE, 0.0]
    with pytest.raises(InputError, match="uf_pump_command"):
        command_of(None, None)


def test_a_gap_in_the_log_is_bridged_by_the_command():
    run = tank_run()
    levels = run.levels()
    kept = (levels.time < 1500.0) | (levels.time > 1900.0)
    cut = replace(levels, **{n: getattr(levels, n)[kept] for n in ("time", "level", "variance", "raw", "common_sd", "tilt", "moving", "why")})  # fmt: skip
    found = track_volume(cut, run.tank, run.command)
    error = found.volume - run.V[kept]
    assert np.sqrt(np.mean(error[found.time > 600.0] ** 2)) < 1e-6


def test_one_wild_echo_at_the_very_start_does_not_set_the_filter_off():
    run = tank_run()
    D = run.signals["distance"]
    D.values[0] = 0.03
    run.signals["distance"] = Signal(D.name, D.time, D.values)
    found = run.course()
    assert abs(found.volume[30] - run.V[30]) < 5e-6
