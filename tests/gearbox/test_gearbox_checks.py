import numpy as np
import pytest
from gearbox_known import known

from pipeline.estimation.uncertainty import Covariance
from pipeline.rigs.gearbox.aligned_run import AlignedRun
from pipeline.rigs.gearbox.load import checks
from pipeline.rigs.gearbox.load.inertia import LoadFit, load_parameters
from pipeline.rigs.gearbox.load.load_windows import free_spans, modulated
from pipeline.rigs.gearbox.torques.nominal import Level
from pipeline.rigs.gearbox.torques.torque_map import Transfer


def level(value, own=0.002, total=0.003):
    return Level(value, total, 30.0, own, (0.0, 6.0), 12, 0.1)


def fitted(inertia, error):
    covariance = Covariance(np.diag([error**2, 1e-6, 1e-8]), 30.0)
    return LoadFit(np.array([inertia, 0.25, 0.004]), covariance, {}, 1.0, {}, {})


def with_torque(case, torque_out):
    run = case.run
    return AlignedRun(
        run.run, run.time, run.torque_in, torque_out, run.angle_time, run.angle, run.stages, run.events,
        run.speed_nominal, run.offset_in, run.offset_out,
    )  # fmt: skip


def test_a_sound_run_fails_no_check():
    case = known("g3", 0)
    windows = modulated(case.run, case.steady)
    parts = [load_parameters([windows.part(span)]) for span in free_spans(case.run).values()]
    fos = [case.level(side, "fos") for side in ("in", "out")]
    made = [
        checks.load_law([windows], load_parameters([windows])),
        checks.inertia_parts(*parts),
        checks.dissipated_power(*fos, 12.566),
        checks.ripple_share(0.015, fos[1].value, "torque_out"),
    ]
    assert [check.name for check in made if check.failed] == []


def test_drag_that_grows_with_the_square_of_speed_is_told():
    case = known("g8", 1)
    speed = np.gradient(np.convolve(case.run.angle, np.ones(25) / 25, "same"), case.run.angle_time)
    air = 5e-4 * np.interp(case.run.time, case.run.angle_time, speed) ** 2
    run = with_torque(case, case.run.torque_out + air)
    windows = modulated(run, case.steady)
    found = checks.load_law([windows], load_parameters([windows]))
    assert found.failed
    assert found.value > 0


def test_a_brake_that_is_not_free_after_the_release_is_told():
    check = checks.inertia_parts(fitted(0.0195, 4e-4), fitted(0.0230, 4e-4))
    assert check.failed
    assert "brake is not free" in check.text
    assert not checks.inertia_parts(fitted(0.0195, 4e-4), fitted(0.0199, 4e-4)).failed


def test_slopes_that_differ_between_start_up_and_brake_are_told():
    brake = Transfer("brake", 0.544, 0.01, 0.387, 0.015, 20.0)
    assert checks.slopes(Transfer("startup", 0.8, 0.03, np.nan, np.nan, 10.0), brake).failed
    assert not checks.slopes(Transfer("startup", 0.528, 0.03, np.nan, np.nan, 10.0), brake).failed


def test_a_gain_of_power_is_told():
    assert checks.dissipated_power(level(0.30), level(0.94), 12.566).failed
    assert not checks.dissipated_power(level(0.94), level(0.30), 12.566).failed


def test_warming_up_over_the_runs_is_told():
    order, errors = np.arange(8.0), np.full(8, 0.005)
    dofs = np.full(8, 20.0)
    drift = checks.run_order(0.005 * order - 0.0175, errors, dofs, "T_0", "N m")
    assert drift.failed
    assert "+0.005 N m from run to run" in drift.text
    assert not checks.run_order(np.array([1, -1, 1, -1, 1, -1, 1, -1]) * 0.005, errors, dofs, "T_0", "N m").failed
    assert checks.run_order(order[:3], errors[:3], dofs[:3], "T_0", "N m") is None


def test_runs_in_the_order_of_their_speed_leave_open_what_the_trend_is_over():
    order, errors, dofs = np.arange(8.0), np.full(8, 0.005), np.full(8, 20.0)
    sorted_, mixed = 6.0 + 3.0 * order, np.array([3, 7, 1, 5, 0, 6, 2, 4.0])
    for speeds, told in ((sorted_, True), (mixed, False)):
        drift = checks.run_order(0.005 * order, errors, dofs, "T_0", "N m", speeds)
        assert drift.failed
        assert ("depends on speed" in drift.text) is told


@pytest.mark.parametrize("runs", [4, 5, 8])
@pytest.mark.parametrize("dof", [3, 10, 30])
def test_chance_makes_no_trend_over_the_runs_more_often_than_its_level(runs, dof):
    """Errors are estimates of `dof` degrees of freedom; at 3 sigma one sound campaign in 370 may be accused."""
    rng = np.random.default_rng(100 * runs + dof)
    accused = 0
    for _ in range(1500):
        sigma = np.exp(rng.uniform(-0.7, 0.7, runs))
        errors = sigma * np.sqrt(rng.chisquare(dof, runs) / dof)
        values = sigma * rng.standard_normal(runs)
        accused += checks.run_order(values, errors, np.full(runs, float(dof)), "J", "").failed
    assert accused <= 9  # of 4 expected


def test_a_run_with_another_slope_is_named():
    def transfers(*slopes, error=0.01):
        return {f"g{i}": Transfer("brake", a, error, 0.4, 0.02, 20.0) for i, a in enumerate(slopes, 1)}

    check = checks.same_slope(transfers(0.95, 0.55))
    assert check.failed
    assert "run g1 has 0.950, run g2 0.550" in check.text
    check = checks.same_slope(transfers(0.95, 0.96, 0.55, 0.94))
    assert check.failed
    assert "run g3 has 0.550, the others 0.95" in check.text
    assert not checks.same_slope(transfers(0.95, 0.97, 0.96)).failed
    assert not checks.same_slope(transfers(0.95, 0.55, error=0.2)).failed
    assert checks.same_slope(transfers(0.95)) is None


@pytest.mark.parametrize(("amplitude", "fails"), [(0.03, False), (0.3, True)])
def test_ripple_is_held_against_the_level_it_rides_on(amplitude, fails):
    assert checks.ripple_share(amplitude, 0.94, "torque_in").failed is fails
