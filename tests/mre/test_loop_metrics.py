from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from loops_of_truth import logged

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.mre.model.loop import N_F, N_X, Loop, curve, fit_loop, half_range
from pipeline.rigs.mre.pads import Pads, group_levels
from pipeline.rigs.mre.shear.half_cycle import half_cycle_metrics
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics
from pipeline.rigs.mre.synthetic import ShearRun, shear_runs, shear_truth, true_loop

PADS = Pads(0.05, 0.006, 2)


def ellipse(storage: float, loss: float, amplitude: float = 4e-4, frequency: float = 10.0) -> Loop:
    X, F = np.zeros(N_X, dtype=complex), np.zeros(N_F, dtype=complex)
    X[0] = amplitude * np.exp(0.3j)
    F[0] = (storage + 1j * loss) * X[0]
    kept = np.ones(N_F, dtype=bool)
    return Loop("r", frequency, X, F, np.zeros(N_X), np.zeros(N_F), kept, 0.0, 0.0, 0.0, 0.0, 1000, 1.0)


def by_name(estimates: list[Estimate]) -> dict[str, float]:
    return {e.name: e.value for e in estimates}


def test_ellipse_gives_its_complex_stiffness() -> None:
    found = by_name(loop_metrics(ellipse(3e5, 6e4), pads=PADS))
    omega, area = 2 * math.pi * 10, math.pi * 0.05**2 / 4
    assert found["stiffness_storage"] == pytest.approx(3e5)
    assert found["loss_factor"] == pytest.approx(0.2)
    assert found["damping"] == pytest.approx(6e4 / omega)
    assert found["loop_area"] == pytest.approx(math.pi * 6e4 * 4e-4**2)
    assert found["stiffness_secant"] == pytest.approx(math.hypot(3e5, 6e4))  # not K'
    assert found["shear_modulus_storage"] == pytest.approx(3e5 * 0.006 / (2 * area))
    assert found["shear_modulus_loss"] == pytest.approx(6e4 * 0.006 / (2 * area))


def test_loop_that_yields_energy_has_negative_damping() -> None:
    assert by_name(loop_metrics(ellipse(3e5, -6e4)))["damping"] < 0


@pytest.mark.parametrize(("frequency", "secant", "damping"), [(5, 374.2, 2476), (10, 394.1, 1273), (15, 403.7, 802)])
def test_published_trends_of_the_rig(frequency: float, secant: float, damping: float) -> None:
    truth = shear_truth({"k2": 260.36e3, "second_harmonic": 0.0, "third_harmonic": 0.0})
    found = by_name(loop_metrics(true_loop(truth, ShearRun("r", "shear", frequency, 4e-4, 0.0))))
    assert found["stiffness_secant"] / 1e3 == pytest.approx(secant, abs=0.15)
    assert found["damping"] == pytest.approx(damping, abs=0.6)


def test_area_is_that_of_the_drawn_loop() -> None:
    loop = true_loop(shear_truth({}), ShearRun("r", "shear", 10.0, 6e-4, 2.0))
    x, F = curve(loop.X, 4096), curve(loop.F, 4096)
    drawn = float(np.sum(0.5 * (F + np.roll(F, -1)) * (np.roll(x, -1) - x)))
    assert by_name(loop_metrics(loop))["loop_area"] == pytest.approx(drawn, rel=1e-4)


def test_late_force_reads_as_damping_until_it_is_set_right() -> None:
    loop, lag = ellipse(3e5, 6e4), 200e-6
    late = replace(loop, F=loop.F * np.exp(-1j * loop.omega * lag * np.arange(1, N_F + 1)))
    assert by_name(loop_metrics(late))["damping"] == pytest.approx(6e4 / loop.omega - 3e5 * lag, rel=0.01)
    assert by_name(loop_metrics(late, force_lag=lag))["damping"] == pytest.approx(6e4 / loop.omega)


def test_standard_errors_are_those_of_repeated_noise() -> None:
    truth = shear_truth({})
    quiet = true_loop(truth, ShearRun("r", "shear", 10.0, 4e-4, 2.0))
    loop = replace(quiet, sd_x=np.full(N_X, 3e-8), sd_f=np.full(N_F, 0.02))
    rng = np.random.default_rng(0)
    found: dict[str, list[float]] = {}
    for _ in range(1000):
        shake_x = 3e-8 * (rng.normal(size=N_X) + 1j * rng.normal(size=N_X))
        shake_f = 0.02 * (rng.normal(size=N_F) + 1j * rng.normal(size=N_F))
        lag = 60e-6 + 2e-6 * rng.normal()
        late = loop.F * np.exp(1j * loop.omega * (lag - 60e-6) * np.arange(1, N_F + 1))
        for e in loop_metrics(replace(loop, X=loop.X + shake_x, F=late + shake_f), pads=PADS):
            found.setdefault(e.name, []).append(e.value)
    for e in loop_metrics(loop, force_lag_sd=2e-6, pads=PADS):
        assert e.std_error == pytest.approx(np.std(found[e.name]), rel=0.12), e.name


def test_run_scatter_widens_what_scales_with_the_force() -> None:
    quiet, wide = (
        {e.name: e for e in loop_metrics(ellipse(3e5, 6e4), run_scatter=s, scatter_dof=8)} for s in (0.0, 0.004)
    )
    assert wide["stiffness_secant"].std_error == pytest.approx(0.004 * wide["stiffness_secant"].value)
    assert wide["stiffness_secant"].ci95[1] / wide["stiffness_secant"].value - 1 == pytest.approx(
        2.306 * 0.004, rel=1e-3
    )
    assert wide["loss_factor"].std_error == quiet["loss_factor"].std_error
    assert wide["amplitude"].std_error == quiet["amplitude"].std_error


def test_fitted_maximum_is_not_biased_by_noise_as_the_raw_one_is() -> None:
    truth = shear_truth({"preload_runs": False})
    loop, run = logged(1)[0], shear_runs(truth)[0]  # 0.2 mm: the worst case
    late = {"force_lag": 60e-6}
    expected = by_name(loop_metrics(true_loop(truth, run, loop.frequency)))["stiffness_secant"]
    assert by_name(loop_metrics(loop, **late))["stiffness_secant"] == pytest.approx(expected, rel=0.003)


def test_harmonics_are_those_of_the_log() -> None:
    truth = shear_truth({"preload_runs": False})
    for loop, run in zip(logged(1), shear_runs(truth), strict=True):
        expected = true_loop(truth, run, loop.frequency)
        assert np.abs(loop.X) == pytest.approx(np.abs(expected.X), abs=1e-7)
        assert np.abs(loop.F[:4]) == pytest.approx(np.abs(expected.F[:4]), abs=0.05)
        assert loop.sigma_f == pytest.approx(1.0, abs=0.05)
        assert loop.sigma_x == pytest.approx(1.5e-6, rel=0.05)


def test_harmonics_on_the_mains_are_no_data() -> None:
    loops = {loop.run: loop for loop in logged(1)}
    assert np.flatnonzero(~loops["sh_5hz_0a"].kept).tolist() == [9]
    assert np.flatnonzero(~loops["sh_10hz_0a"].kept).tolist() == [4, 9, 14]
    assert np.flatnonzero(~loops["sh_15hz_0a"].kept).tolist() == [9]


def test_hum_off_the_harmonics_does_not_leak_into_them() -> None:
    t = np.arange(0, 2.13, 2e-4)
    x = 4e-4 * np.sin(2 * np.pi * 7 * t)
    rng = np.random.default_rng(0)
    hum = 5 * np.sin(2 * np.pi * 50 * t)
    clean, hummed = (fit_loop("r", t, x, 1e5 * x + f + 0.1 * rng.normal(size=t.size)) for f in (0 * hum, hum))
    assert pytest.approx(clean.F, abs=0.02) == hummed.F
    assert hummed.sd_f == pytest.approx(clean.sd_f, rel=0.3)


def test_coloured_noise_is_seen_where_it_is() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(0, 20, 1e-3)
    spectrum = np.fft.rfft(rng.normal(size=t.size)) / (1 + np.fft.rfftfreq(t.size, 1e-3) / 10)  # low-pass
    noise = np.fft.irfft(spectrum, t.size)
    x = 4e-4 * np.sin(2 * np.pi * 7 * t)
    loop = fit_loop("r", t, x, 1e5 * x + noise / noise.std())
    assert loop.sd_f[0] > 2 * loop.sd_f[-1]
    assert loop.sd_f[0] > 2 * loop.sigma_f * math.sqrt(2 / loop.n_samples)


def test_slow_sampling_keeps_the_harmonics_that_it_can() -> None:
    t = np.arange(0, 20, 0.02)  # 50 Hz for 3 Hz
    x = 1e-3 * np.sin(2 * np.pi * 3 * t)
    loop = fit_loop("r", t, x, 1e5 * x, mains=0.0)
    assert loop.kept.sum() == 7
    assert np.all(np.isfinite(loop.sd_f))


def test_dropouts_and_drift_do_not_matter() -> None:
    rng = np.random.default_rng(2)
    t = np.sort(rng.uniform(0, 6, 9000))
    x = 3e-4 * np.sin(2 * np.pi * 4 * t) + 1e-5 * t
    loop = fit_loop("r", t, x, 2e5 * 3e-4 * np.sin(2 * np.pi * 4 * t + 0.1) + 3 * t + 0.1 * rng.normal(size=t.size))
    found = by_name(loop_metrics(loop))
    assert found["stiffness_storage"] == pytest.approx(2e5 * math.cos(0.1), rel=1e-4)
    assert found["loss_factor"] == pytest.approx(math.tan(0.1), rel=2e-3)


def test_half_range_of_a_series() -> None:
    coefficients = np.array([1.0, 0.2j, -0.1])
    fine = curve(coefficients, 1 << 16)
    assert half_range(coefficients) == pytest.approx(0.5 * np.ptp(fine), rel=1e-7)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_half_cycle_gives_stiffness_and_loss(side: float) -> None:
    rng = np.random.default_rng(3)
    up, down = np.linspace(0, 0.04, 2000), np.linspace(0.04, 0.01, 1500)
    x = np.r_[up, down]
    F = np.r_[300 * up, 300 * 0.04 - 400 * (0.04 - down)] + 5 + 0.02 * rng.normal(size=x.size)
    found = {e.name: e for e in half_cycle_metrics("r", side * x, side * F)}
    assert found["stiffness_secant"].value == pytest.approx(300, rel=2e-3)
    # From 0.01 to 0.04 m the unloading is 100 N/m steeper: 100 * 0.03^2 / 2 is lost.
    assert found["loss_work"].value == pytest.approx(0.045, rel=0.02)
    assert found["loss_ratio"].value == pytest.approx(0.045 / (300 * (0.04**2 - 0.01**2) / 2), rel=0.02)
    assert found["stiffness_secant"].ci95[0] < 300 < found["stiffness_secant"].ci95[1]


def test_levels_are_grouped_by_neighbourhood() -> None:
    assert group_levels([6.01, 0.01, 2.0, 5.98, 0.0], 0.25) == ([2, 0, 1, 2, 0], [0.0, 2.0, 6.0])
    assert group_levels([], 0.25) == ([], [])
    assert group_levels([None, None], 0.25) == ([0, 0], [0.0])
    assert group_levels([-2.0, 2.0], 0.25)[1] == [-2.0, 2.0]


def test_triangular_motion_keeps_its_higher_harmonics() -> None:
    t = np.arange(0, 4, 5e-4)
    orders = np.arange(1, 200, 2)
    triangle = 1e-3 * 8 / np.pi**2 * sum((-1) ** (h // 2) / h**2 * np.sin(2 * np.pi * 3 * h * t) for h in orders)
    rng = np.random.default_rng(0)
    loop = fit_loop("r", t, triangle + 1e-7 * rng.normal(size=t.size), 1e5 * triangle + 0.01 * rng.normal(size=t.size))
    assert np.abs(loop.X[6]) == pytest.approx(1e-3 * 8 / np.pi**2 / 49, rel=0.01)
    assert loop.amplitude == pytest.approx(1e-3, rel=0.03)
    assert by_name(loop_metrics(loop))["stiffness_secant"] == pytest.approx(1e5, rel=1e-3)
    sine_ = fit_loop("r", t, 1e-3 * np.sin(2 * np.pi * 3 * t) + 1e-7 * rng.normal(size=t.size), 1e5 * triangle)
    assert np.all(sine_.X[5:] == 0)
    assert np.all(sine_.sd_x[5:] == 0)
