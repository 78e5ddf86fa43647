import numpy as np
import pytest
from gearbox_known import A, known

from pipeline.rigs.gearbox.torques.pooled_map import pooled
from pipeline.rigs.gearbox.torques.torque_map import (
    Transfer,
    brake_transfer,
    startup_transfer,
    steady_transfer,
    straight_line,
    total_least_squares,
)

# Start-up peak, FOS, brake peak, SOS: input and output torque, N m (fact sheet 4.1).
AT_120 = np.array([(1.38, 0.54), (0.94, 0.30), (2.17, 0.97), (1.41, 0.56)])
AT_210 = np.array([(1.75, 0.77), (0.89, 0.34), (2.40, 1.20), (1.83, 0.76)])


def test_the_four_published_states_at_120_rpm_lie_on_one_line():
    line = straight_line(*AT_120.T)
    assert line.slope == pytest.approx(0.5443, abs=5e-5)
    assert line.intercept == pytest.approx(-0.2104, abs=5e-5)
    assert line.largest_residual < 0.003


def test_all_eight_published_points():
    line = straight_line(*np.vstack([AT_120, AT_210]).T)
    assert line.slope == pytest.approx(0.561, abs=5e-4)
    assert line.slope_error == pytest.approx(0.032, abs=5e-4)
    assert line.intercept == pytest.approx(-0.216, abs=5e-4)
    assert line.intercept_error == pytest.approx(0.053, abs=5e-4)
    assert line.r2 == pytest.approx(0.981, abs=5e-4)


def test_the_points_at_210_rpm_scatter_more():
    line = straight_line(*AT_210.T)
    assert line.slope == pytest.approx(0.557, abs=5e-4)
    assert 0.06 < line.largest_residual < 0.075


def test_drag_lock_and_slip_torque_of_the_published_120_rpm_numbers():
    line = straight_line(*AT_120.T)
    t_00 = -line.intercept / line.slope
    peak_in, sos_in = AT_120[2, 0], AT_120[3, 0]
    assert (t_00, peak_in - t_00, sos_in - t_00) == pytest.approx((0.387, 1.783, 1.023), abs=6e-4)


def test_locked_start_up_has_slope_0_545_where_a_rigid_box_has_one():
    (start_in, start_out), (fos_in, fos_out) = AT_120[0], AT_120[1]
    assert (start_out - fos_out) / (start_in - fos_in) == pytest.approx(0.545, abs=5e-4)


def test_noise_on_the_input_does_not_flatten_the_slope():
    rng = np.random.default_rng(3)
    true = rng.normal(size=20000)
    x, y = true + 0.5 * rng.normal(size=true.size), 0.5443 * true + 0.25 * rng.normal(size=true.size)
    x, y = x - x.mean(), y - y.mean()
    assert float(x @ y / (x @ x)) < 0.46, "ordinary least squares is a fifth too flat"
    assert total_least_squares(x, y, 0.25) == pytest.approx(0.5443, abs=0.01)


def test_slopes_of_falling_lines_are_found_as_well():
    x = np.array([-1.0, 0.0, 1.0])
    assert total_least_squares(x, -2 * x, 1.0) == pytest.approx(-2.0)


@pytest.mark.parametrize("name", ["g3", "g7"])
def test_the_brakes_rise_gives_the_slope_of_the_synthetic_rig(name):
    for seed in range(3):
        case = known(name, seed)
        found = brake_transfer(case.run, case.steady)
        assert abs(found.slope - A) < min(4 * found.slope_error, 0.05)
        assert 0.006 < found.slope_error < 0.02
        drag = case.true("torque_in", 9.0) - case.true("torque_out", 9.0) / A
        assert abs(found.intercept - drag) < 4 * found.intercept_error


def test_a_start_up_gives_the_same_slope_but_for_the_gearboxs_own_inertia():
    for seed in range(3):
        case = known("g3", seed)
        found = startup_transfer(case.run, case.steady)
        assert abs(found.slope - A * 0.0195 / 0.0201) < 4 * found.slope_error
        assert np.isnan(found.intercept)


def test_steady_levels_at_120_rpm_lie_on_the_line_of_the_rise():
    case = known("g3", 0)
    before, loaded = [tuple(case.level(side, stage) for side in ("in", "out")) for stage in ("fos", "sos")]
    found = steady_transfer(before, loaded)
    assert abs(found.slope - A) < 4 * found.slope_error + 0.003
    assert steady_transfer(before, before) is None, "no change of load, no slope"


def test_without_events_or_steady_stretches_there_is_no_slope():
    case = known("g3", 0)
    assert brake_transfer(case.run, []) is None
    assert startup_transfer(case.run, []) is None


def test_runs_together_are_more_certain_and_honest_about_their_scatter():
    alike = [Transfer("brake", 0.54 + 0.001 * i, 0.012, 0.39, 0.02, 10.0) for i in range(8)]
    apart = [Transfer("brake", 0.44 + 0.03 * i, 0.012, 0.39, 0.02, 10.0) for i in range(8)]
    assert pooled(alike).slope_error == pytest.approx(0.012 / np.sqrt(8))
    scatter = np.std([t.slope for t in apart], ddof=1) / np.sqrt(8)
    assert pooled(apart).slope_error == pytest.approx(scatter)
    assert pooled([]) is None


@pytest.mark.parametrize("runs", [2, 3, 8])
def test_the_mean_slope_of_few_runs_has_an_interval_that_covers_and_is_of_use(runs):
    """One degree of freedom for two runs that scatter a little more than they say made it five times too wide."""
    rng = np.random.default_rng(runs)
    covered, widths = 0, []
    for _ in range(400):
        errors = 0.01 * np.exp(rng.uniform(-0.3, 0.3, runs))
        told = errors * np.sqrt(rng.chisquare(20, runs) / 20)
        slopes = 1.0 + errors * rng.standard_normal(runs)
        mean = pooled([Transfer("brake", a, e, 0.4, 0.01, 20.0) for a, e in zip(slopes, told, strict=True)])
        low, high = mean.slope_ci95
        covered += low < 1.0 < high
        widths.append(high - low)
    assert covered / 400 > 0.93
    assert np.median(widths) < 1.6 * 2 * 1.96 * 0.01 / np.sqrt(runs)
