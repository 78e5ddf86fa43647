import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.estimation.harmonic import fit_harmonics, fundamental, noise_beside


def periodic(t, f, phase=0.4):
    w = 2 * np.pi * f * t
    return 1.7 + np.cos(w + phase) + 0.1 * np.cos(2 * w - 1.0) + 0.05 * np.cos(3 * w + 2.0)


def coefficients(phase=0.4):
    return np.array([np.exp(1j * phase), 0.1 * np.exp(-1j), 0.05 * np.exp(2j)])


def stamps(rng, n=4000, rate=1000.0, jitter=5e-6):
    """Jitter, a gap of 0.5 s, and single dropouts."""
    t = np.arange(n) / rate + jitter * rng.normal(size=n) + 3.7
    kept = (np.arange(n) < 1200) | (np.arange(n) > 1700)
    return t[kept & (rng.random(n) > 0.01)]


def coloured(rng, n, memory=0.9):
    noise = rng.normal(size=n)
    out = np.empty(n)
    out[0] = noise[0] / np.sqrt(1 - memory**2)
    for i in range(1, n):
        out[i] = memory * out[i - 1] + noise[i]
    return out * np.sqrt(1 - memory**2)


def test_coefficients_are_exact_at_exact_stamps_whatever_the_gaps():
    t = stamps(np.random.default_rng(0))
    fit = fit_harmonics(t, periodic(t, 7.123), 7.123, [1, 2, 3])
    np.testing.assert_allclose(fit.coefficients, coefficients(), atol=1e-12)
    assert fit.offset == pytest.approx(1.7, abs=1e-12)
    assert fit.sigma < 1e-12


def test_normal_equations_give_the_digits_of_a_qr_factorisation():
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(0, 0.25, 300))  # 1.2 cycles, drift, eight orders: badly conditioned
    x = 1e3 + rng.normal(size=t.size)
    fit = fit_harmonics(t, x, 4.8, range(1, 9), drift=2)
    w = 2 * np.pi * 4.8 * t[:, None] * np.arange(1, 9)
    columns = [np.vander((t - t.mean()) / 0.125, 3), np.cos(w), -np.sin(w)]
    A = np.hstack(columns)
    expected, *_ = np.linalg.lstsq(A, x, rcond=None)
    np.testing.assert_allclose(fit.coefficients, expected[3:11] + 1j * expected[11:], rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(fit.curve(t), A @ expected, rtol=1e-12)


def test_samples_that_are_nan_do_not_count():
    t = np.arange(1000) / 500
    x = periodic(t, 6.0)
    x[100:140] = np.nan
    fit = fit_harmonics(t, x, 6.0, [1, 2, 3])
    assert fit.n == 960
    assert np.isnan(fit.residual[100:140]).all()
    np.testing.assert_allclose(fit.coefficients, coefficients(), atol=1e-12)


def test_covariance_is_that_of_the_scatter_over_many_records():
    rng = np.random.default_rng(2)
    t = stamps(rng, 600, 200.0)
    estimates = []
    for _ in range(300):
        fit = fit_harmonics(t, periodic(t, 3.3) + 0.2 * rng.normal(size=t.size), 3.3, [1, 2, 3])
        estimates.append(np.r_[fit.offset, np.stack([fit.coefficients.real, fit.coefficients.imag], axis=1).ravel()])
    whitening = np.linalg.inv(np.linalg.cholesky(fit.covariance))
    scatter = whitening @ np.cov(np.array(estimates).T) @ whitening.T
    np.testing.assert_allclose(scatter, np.eye(7), atol=4 * np.sqrt(2 / 300))


def test_drift_columns_take_a_drifting_mean_and_leave_the_harmonics_alone():
    t = np.arange(5000) / 1000
    fit = fit_harmonics(t, periodic(t, 2.37) + 0.5 * t + 0.2 * t**2, 2.37, [1, 2, 3], drift=2)
    np.testing.assert_allclose(fit.coefficients, coefficients(), atol=1e-10)
    np.testing.assert_allclose(fit.periodic(t), periodic(t, 2.37) - 1.7, atol=1e-10)
    np.testing.assert_allclose(fit.curve(t), periodic(t, 2.37) + 0.5 * t + 0.2 * t**2, atol=1e-10)


def test_a_million_samples_are_one_regression():
    t = np.arange(1_000_000) / 5000
    x = np.cos(2 * np.pi * 15.003 * t + 0.3)
    fit = fit_harmonics(t, x, 15.003, range(1, 16))
    assert abs(fit.coefficients[0] - np.exp(0.3j)) < 1e-10
    assert np.abs(fit.coefficients[1:]).max() < 1e-10


def test_effective_fraction_tells_the_correlation_time_of_the_residual():
    rng = np.random.default_rng(3)
    t = np.arange(20000) / 1000
    white = fit_harmonics(t, periodic(t, 5.0) + rng.normal(size=t.size), 5.0, [1, 2, 3])
    slow = fit_harmonics(t, periodic(t, 5.0) + coloured(rng, t.size), 5.0, [1, 2, 3])
    assert white.effective_fraction > 0.9
    assert slow.effective_fraction == pytest.approx((1 - 0.9) / (1 + 0.9), rel=0.3)


def test_noise_beside_a_line_gives_errors_that_cover_under_coloured_noise():
    rng = np.random.default_rng(7)
    t = np.arange(3000) / 500
    hits = []
    for _ in range(200):
        x = periodic(t, 5.0) + 0.5 * coloured(rng, t.size)
        x[700:720] = np.nan
        fit = fit_harmonics(t, x, 5.0, [1, 2, 3])
        errors = np.array([noise_beside(t, fit, order) for order in (1, 2, 3)]) * np.sqrt(2 / fit.n)
        hits.append(np.abs((fit.coefficients - coefficients()).real) < 1.96 * errors)
    share = np.mean(hits, axis=0)
    assert np.all((share >= 0.90) & (share <= 0.99))


@pytest.mark.parametrize(
    ("time", "orders"),
    [
        (np.arange(6) / 10, [1, 2, 3]),  # fewer samples than coefficients
        (np.arange(100) / 100, [1, 10]),  # order 10 of 5 Hz sampled at 100 Hz has no sine
        (np.arange(100) / 1e5, [1, 2, 3]),  # a two-hundredth of a cycle
    ],
)
def test_what_the_samples_cannot_tell_is_refused(time, orders):
    with pytest.raises(InputError):
        fit_harmonics(time, np.random.default_rng(0).normal(size=time.size), 5.0, orders)


def test_frequency_is_found_within_its_error_at_the_cramer_rao_bound():
    rng = np.random.default_rng(4)
    z, errors = [], []
    for _ in range(150):
        t = stamps(rng, 2000, 500.0)
        f = rng.uniform(2.0, 20.0)
        found = fundamental(t, periodic(t, f, rng.uniform(0, 6)) + 0.1 * rng.normal(size=t.size))
        z.append((found.value - f) / found.std_error)
        errors.append(found.std_error)
    assert 0.90 <= np.mean(np.abs(z) < 1.96) <= 0.99
    w = t - t.mean()
    bound = 0.1 / (2 * np.pi * 1.0) / np.sqrt(0.5 * (w**2).sum())  # a little less with the overtones
    assert np.mean(errors) == pytest.approx(bound, rel=0.1)


def test_coloured_noise_widens_the_error_of_the_frequency():
    rng = np.random.default_rng(5)
    t = np.arange(1500) / 500
    z = []
    for _ in range(150):
        f = rng.uniform(3.0, 6.0)
        found = fundamental(t, np.cos(2 * np.pi * f * t) + 0.1 * coloured(rng, t.size, 0.95))
        z.append((found.value - f) / found.std_error)
    assert 0.90 <= np.mean(np.abs(z) < 1.96) <= 0.99


@pytest.mark.parametrize("cycles", [3, 4, 6.5, 12, 45.3])
@pytest.mark.parametrize(
    "shape",
    [
        lambda w: np.cos(w) + 0.02 * np.cos(9 * w),
        lambda w: 0.3 * np.cos(w) + np.cos(2 * w + 1),  # the second order dominates
        lambda w: 0.4 * np.cos(w) + 0.2 * np.cos(2 * w) + np.cos(3 * w + 1),
        lambda w: np.arcsin(np.cos(w)),
        lambda w: np.cos(w) + 2 * w / w[-1],  # drift of twice the amplitude
    ],
)
def test_the_fundamental_is_found_and_not_a_harmonic(cycles, shape):
    t = np.linspace(0, cycles / 3.0, int(70 * cycles))
    x = shape(2 * np.pi * 3.0 * t) + 0.01 * np.random.default_rng(6).normal(size=t.size)
    assert fundamental(t, x).value == pytest.approx(3.0, rel=0.01)


def test_a_guess_decides_which_line_is_meant():
    t = np.arange(4000) / 1000
    x = np.cos(2 * np.pi * 5 * t) + 3 * np.cos(2 * np.pi * 50 * t)
    resolution = 1 / 4.0
    assert fundamental(t, x, guess=5.3).value == pytest.approx(5.0, abs=resolution / 500)
    assert fundamental(t, x).value == pytest.approx(50.0, abs=resolution / 500)


def test_mains_hum_is_not_taken_for_a_sub_harmonic():
    t = np.arange(8000) / 2000
    x = np.cos(2 * np.pi * 15 * t) + 0.03 * np.cos(2 * np.pi * 50 * t + 1)
    assert fundamental(t, x).value == pytest.approx(15.0, rel=1e-5)


def test_records_without_a_frequency_are_refused():
    t = np.arange(100) / 10
    with pytest.raises(InputError, match="does not move"):
        fundamental(t, 3 + 0.1 * t)
    with pytest.raises(InputError, match="too few"):
        fundamental(t[:5], t[:5])
    with pytest.raises(InputError, match="cycle"):
        fundamental(t, np.cos(2 * np.pi * 0.05 * t) + 0.001 * np.cos(7 * t))
