import numpy as np
import pytest

from pipeline.rigs.gearbox.load.friction_fit import (
    SharedErrors,
    distinct,
    drag_curve,
    shared_errors,
    slip_line,
    slip_torque_by_input,
)

RPM = 2 * np.pi / 60
SPEEDS = np.array([60, 90, 120, 120, 150, 180, 210, 240]) * RPM


def alone(runs, error):
    """Return equal errors that no runs share."""
    return SharedErrors(np.full(runs, error), np.zeros((runs, 1)))


def stribeck(w, c0=0.10, c_s=0.406, w_s=17.08, b0=0.004):
    return c0 + c_s * np.exp(-((w / w_s) ** 2)) + b0 * w


def test_the_stribeck_law_is_found_from_eight_runs():
    found = drag_curve(SPEEDS, stribeck(SPEEDS), alone(8, 0.005))
    assert found.law == "stribeck"
    assert dict(zip(found.names, found.values, strict=True)) == pytest.approx(
        {"c0": 0.10, "c_s": 0.406, "w_s": 17.08, "b0": 0.004}, rel=1e-3
    )


def test_the_curve_is_known_far_better_than_its_parameters():
    found = drag_curve(SPEEDS, stribeck(SPEEDS), alone(8, 0.005))
    assert found.error(np.array([100 * RPM]))[0] < 0.005
    assert found.covariance.std_error[0] > 0.05


def test_the_band_of_the_curve_covers():
    covered = []
    at = np.array([80, 130, 200]) * RPM
    for seed in range(60):
        noisy = stribeck(SPEEDS) + 0.005 * np.random.default_rng(seed).normal(size=8)
        found = drag_curve(SPEEDS, noisy, alone(8, 0.005))
        covered += list(np.abs(found.at(at) - stribeck(at)) < 1.96 * found.error(at))
    assert np.mean(covered) > 0.9


def test_four_speeds_give_a_line_and_two_give_nothing():
    four = SPEEDS[[0, 1, 2, 4]]
    found = drag_curve(four, 0.3 + 0.01 * four, alone(4, 0.01))
    assert found.law == "line"
    assert found.values == pytest.approx([0.3, 0.01])
    two = SPEEDS[[2, 3, 6]]
    assert drag_curve(two, stribeck(two), alone(3, 0.01)) is None


def test_twin_runs_count_as_one_speed():
    assert distinct(SPEEDS) == 7
    assert distinct(np.array([])) == 0


def test_an_error_of_the_slope_is_common_to_all_speeds():
    """T_0 = T_in - T_out/a: with a wrong, every T_0 moves by T_out/a^2 times it."""
    t_out = np.array([0.27, 0.30, 0.34])
    covariance = shared_errors(np.zeros(3), t_out, 0.5443, 0.01).matrix
    moved = 1.0 - t_out / 0.5543 - (1.0 - t_out / 0.5443)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(np.abs(moved), rel=0.03)
    correlation = covariance / np.outer(*[np.sqrt(np.diag(covariance))] * 2)
    assert correlation == pytest.approx(np.ones((3, 3)))


def test_whitening_undoes_own_and_common_errors():
    rng = np.random.default_rng(1)
    errors = SharedErrors(rng.uniform(0.5, 2.0, 6), rng.normal(size=(6, 2)))
    whiten = errors.whitening()
    assert whiten(whiten(errors.matrix).T) == pytest.approx(np.eye(6), abs=1e-12)
    rows = rng.normal(size=(6, 3))
    assert whiten(rows).T @ whiten(rows) == pytest.approx(rows.T @ np.linalg.solve(errors.matrix, rows))
    assert whiten(rows[:, 0]) == pytest.approx(whiten(rows)[:, 0])


def test_the_slip_line_is_weighted_and_widened_by_scatter():
    slip = SPEEDS * 0.985
    line = slip_line(slip, 0.5388 + 0.039 * slip, alone(8, 0.01))
    assert line.values == pytest.approx([0.5388, 0.039])
    rough = slip_line(slip, 0.5388 + 0.039 * slip + 0.1 * (-1.0) ** np.arange(8), alone(8, 0.01))
    assert rough.covariance.std_error[0] > 5 * line.covariance.std_error[0]
    assert slip_line(slip[2:4], np.array([1.0, 1.01]), alone(2, 0.01)) is None


def test_slip_torque_of_the_paper():
    assert slip_torque_by_input(1.41, 0.387) == pytest.approx(1.023)
