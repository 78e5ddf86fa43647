from dataclasses import replace

import numpy as np
import pytest
from gearbox_known import D0, D1, J_L, known

from pipeline.estimation.uncertainty import Covariance
from pipeline.rigs.gearbox.aligned_run import AlignedRun
from pipeline.rigs.gearbox.load.inertia import _undetermined, load_parameters
from pipeline.rigs.gearbox.load.load_windows import free_spans, modulated

TRUE = np.array([J_L, D0, D1])
NAMES = [f"g{i}" for i in range(1, 9)]


def made(J, d0, d1, rate=125.0, counts=None, ramp=2.0, top=20.0):
    """A run whose load equation holds exactly: an S-shaped ramp, then steady."""
    t = np.arange(0, 12, 5e-4)
    x = np.clip((t - 1.0) / ramp, 0, 1)
    w = top * (3 * x**2 - 2 * x**3)
    dw = np.where((x > 0) & (x < 1), top * 6 * x * (1 - x) / ramp, 0.0)
    angle = np.cumsum(w) * 5e-4
    torque = np.where(w > 0, J * dw + d0 + d1 * w, 0.0)
    at = np.arange(0, 12, 1 / rate)
    read = np.interp(at, t, angle)
    if counts:
        read = np.floor(read * counts / (2 * np.pi)) * 2 * np.pi / counts
    stages = {"startup": (1.0, 1.0 + ramp), "fos": (1.0 + ramp, 12.0)}
    return AlignedRun("r", t, 2 * torque, torque, at, read, stages, {}, top)


@pytest.mark.parametrize(("rate", "counts"), [(125.0, None), (1000.0, None), (125.0, 512), (125.0, 256)])
def test_the_load_equation_is_solved_exactly_whatever_the_encoder(rate, counts):
    run = made(0.03, 0.2, 0.005, rate, counts)
    found = load_parameters([modulated(run, [(4.0, 11.0)])])
    assert found.values[0] == pytest.approx(0.03, rel=2e-3 if counts is None else 6e-3)
    assert found.values[1:] == pytest.approx([0.2, 0.005], rel=0.02 if counts is None else 0.1)


def test_a_shaft_that_hardly_accelerates_leaves_the_inertia_open():
    run = made(0.03, 0.2, 0.005)
    windows = modulated(run, [(4.0, 11.0)]).part((4.5, 11.0))
    found = load_parameters([windows])
    assert found is None or "inertia_load" in found.undetermined or found.covariance.std_error[0] > 0.01


@pytest.mark.parametrize("name", ["g3", "g7"])
def test_one_run_gives_the_inertia_within_six_percent(name):
    for seed in range(3):
        case = known(name, seed)
        found = load_parameters([modulated(case.run, case.steady)])
        assert abs(found.values[0] / J_L - 1) < 0.06
        assert np.all(np.abs(found.values - TRUE) < 4 * found.covariance.std_error)
        assert found.covariance.std_error[0] < 0.035 * J_L


def test_a_campaign_gives_inertia_within_one_and_a_half_percent_and_both_drags():
    # One seed would give all runs, each made alone, the same noise.
    cases = [known(name, seed) for seed, name in enumerate(NAMES)]
    windows = [modulated(case.run, case.steady) for case in cases]
    found = load_parameters(windows)
    assert abs(found.values[0] / J_L - 1) < 0.015
    assert np.all(np.abs(found.values - TRUE) < 4 * found.covariance.std_error)
    assert found.covariance.std_error[1] < 0.004
    assert found.undetermined == {}
    steady, common = found.steady_torque(np.array([12.566]))
    assert abs(steady[0] - 0.30) < 4 * np.linalg.norm(common[0])


def test_start_up_and_release_agree_on_the_inertia():
    case = known("g7", 1)
    windows = modulated(case.run, case.steady)
    parts = [load_parameters([windows.part(span)]) for span in free_spans(case.run).values()]
    gap = parts[0].values[0] - parts[1].values[0]
    assert abs(gap) < 4 * np.hypot(*(part.covariance.std_error[0] for part in parts))


def test_a_gap_of_the_encoder_costs_its_windows_only():
    run = made(0.03, 0.2, 0.005)
    kept = (run.angle_time < 6.0) | (run.angle_time > 6.5)
    gappy = AlignedRun(
        "r", run.time, run.torque_in, run.torque_out, run.angle_time[kept], run.angle[kept], run.stages, {}, 20.0
    )
    whole, found = modulated(run, [(4.0, 11.0)]), modulated(gappy, [(4.0, 11.0)])
    assert 0 < whole.torque.size - found.torque.size < 16
    assert load_parameters([found]).values[0] == pytest.approx(0.03, rel=3e-3)


def test_the_gain_of_the_torque_sensor_goes_straight_into_the_inertia():
    run = made(0.03, 0.2, 0.005)
    wrong = AlignedRun(
        "r", run.time, run.torque_in, 0.55 * run.torque_out, run.angle_time, run.angle, run.stages, {}, 20.0
    )
    assert load_parameters([modulated(wrong, [])]).values[0] == pytest.approx(0.55 * 0.03, rel=2e-3)


def test_an_impossible_inertia_is_no_number() -> None:
    error = Covariance(np.diag([1e-8, 1e-6, 1e-8]), 20.0, "given")
    reasons = _undetermined(np.array([-4e-3, 0.25, 4e-3]), error)
    assert set(reasons) == {"inertia_load", "drag_coulomb", "drag_viscous"}
    assert "no bench has" in reasons["inertia_load"]
    assert not _undetermined(np.array([2e-2, 0.25, 4e-3]), error)


def test_a_drift_of_one_run_leaves_its_inertia_right():
    run = made(0.03, 0.2, 0.005)
    drifting = AlignedRun(
        "r", run.time, run.torque_in, run.torque_out + 0.01 * run.time, run.angle_time, run.angle, run.stages, {}, 20.0
    )
    windows = modulated(drifting, [(4.0, 11.0)])
    assert abs(load_parameters([windows]).values[0] / 0.03 - 1) > 0.02
    found = load_parameters([windows.drifting(windows.time)])
    assert found.values[0] == pytest.approx(0.03, rel=3e-3)
    assert found.values[2] == pytest.approx(0.005, rel=0.05)


@pytest.mark.parametrize("scatter", [(0.0, 0.0, 0.0), (0.03, 0.05, 0.1)])
def test_intervals_of_a_campaign_hold_the_truth_whether_its_runs_scatter_or_not(scatter):
    rng = np.random.default_rng(4)
    base = [modulated(known(name, seed).run, known(name, seed).steady) for seed, name in enumerate(NAMES)]
    fit = load_parameters(base)
    held = np.zeros(3)
    draws = 150
    for _ in range(draws):
        runs = []
        for w in base:
            # The noise of a run's windows from elsewhere in its own residual, sign at random: all as correlated as they are.
            own = TRUE * (1 + np.array(scatter) * rng.standard_normal(3))
            noise = rng.choice([-1.0, 1.0]) * np.roll(w.residual(fit.values), rng.integers(w.time.size))
            runs.append(replace(w, torque=w.columns @ own + noise))
        found = load_parameters(runs)
        half = np.diff(found.covariance.intervals(found.values), axis=1)[:, 0] / 2
        held += np.abs(found.values - TRUE) <= half
    assert np.all(held / draws > 0.88)
