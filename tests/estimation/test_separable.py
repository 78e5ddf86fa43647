from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.estimation.separable import covariance_of, fit_separable, linear_fit, multi_start, per_group

NIST = Path(__file__).resolve().parents[2].parent / "shared" / "nist_strd"
needs_nist = pytest.mark.skipif(not NIST.is_dir(), reason=f"certified problems of NIST are not here ({NIST})")


def certified(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Parameters (rows: two starts, value, sd), x, y and the residual sum of squares."""
    text = (NIST / f"{name}.dat").read_text()
    table = re.findall(r"^\s*b\d+ =\s*(\S+)\s+(\S+)\s+(\S+)\s+(\S+)", text, re.MULTILINE)
    first, last = map(int, re.search(r"Data\s+\(lines\s+(\d+) to\s+(\d+)\)", text).groups())
    data = np.array([[float(v) for v in line.split()] for line in text.splitlines()[first - 1 : last]])
    rss = float(re.search(r"Residual Sum of Squares:\s*(\S+)", text)[1])
    return np.array(table, dtype=float).T, data[:, 1], data[:, 0], rss


def rise(x: np.ndarray) -> Callable:
    return lambda q: ((1 - np.exp(-q[0] * x))[:, None], (x * np.exp(-q[0] * x))[None, :, None])


def decays(x: np.ndarray) -> Callable:
    def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        A = np.exp(-np.outer(x, q))
        dA = np.zeros((q.size, x.size, q.size))
        for k in range(q.size):
            dA[k, :, k] = -x * A[:, k]
        return A, dA

    return columns


def rational(x: np.ndarray) -> Callable:
    def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        powers = x[:, None] ** np.arange(4)
        below = (1 + q[0] * x + q[1] * x**2 + q[2] * x**3)[:, None]
        return powers / below, np.array([-powers * x[:, None] ** (k + 1) / below**2 for k in range(3)])

    return columns


def two_bells(x: np.ndarray) -> Callable:
    """Gauss1-3: a decay and two bells, q = (decay rate, centre, width, centre, width)."""

    def columns(q: np.ndarray) -> tuple[np.ndarray, Callable]:
        decay = np.exp(-q[0] * x)
        away = [(x - q[1]) / q[2], (x - q[3]) / q[4]]
        bells = [np.exp(-(a**2)) for a in away]

        def slopes(c: np.ndarray) -> np.ndarray:
            parts = [-c[0] * x * decay]
            for a, bell, width, amplitude in zip(away, bells, (q[2], q[4]), c[1:], strict=True):
                parts += [amplitude * bell * 2 * a / width, amplitude * bell * 2 * a**2 / width]
            return np.stack(parts, axis=1)

        return np.stack([decay, *bells], axis=1), slopes

    return columns


# name, model, nonlinear parameters of the certificate, digits of the parameters that are asked
PROBLEMS = [
    ("Misra1a", rise, [1], 9),
    ("BoxBOD", rise, [1], 7),
    ("Lanczos1", decays, [1, 3, 5], 9),
    ("Lanczos2", decays, [1, 3, 5], 8),
    ("Lanczos3", decays, [1, 3, 5], 6),
    ("Gauss1", two_bells, [1, 3, 4, 6, 7], 7),
    ("Gauss2", two_bells, [1, 3, 4, 6, 7], 7),
    ("Gauss3", two_bells, [1, 3, 4, 6, 7], 7),
    ("Thurber", rational, [4, 5, 6], 6),
]


@needs_nist
@pytest.mark.parametrize(("name", "model", "nonlinear", "digits"), PROBLEMS)
def test_certified_parameters_and_errors(name: str, model: Callable, nonlinear: list[int], digits: int) -> None:
    table, x, y, rss = certified(name)
    starts = [table[i, nonlinear] for i in (0, 1)]
    scale = np.abs(table[2, nonlinear])
    fit, _, _ = multi_start(lambda q: fit_separable(model(x), y, q, scale=scale, tolerance=1e-15), starts)
    linear = [i for i in range(table.shape[1]) if i not in nonlinear]
    assert fit.q == pytest.approx(table[2, nonlinear], rel=10.0**-digits)
    assert fit.c == pytest.approx(table[2, linear], rel=10.0**-digits)
    if name != "Lanczos1":  # its residual is rounding only
        assert fit.chi2 == pytest.approx(rss, rel=1e-8)
        sd = np.sqrt(np.diag(fit.covariance) * fit.chi2 / fit.dof)
        assert sd == pytest.approx(table[3, nonlinear + linear], rel=1e-5)


def test_complex_data_count_both_parts() -> None:
    rng = np.random.default_rng(0)
    omega = np.linspace(1, 100, 60)
    noise = 0.01 * (rng.normal(size=60) + 1j * rng.normal(size=60))
    y = 3 * (1j * omega * 0.05 / (1 + 1j * omega * 0.05)) + 2 + noise

    def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turn = 1j * omega * np.exp(q[0])
        A = np.stack([turn / (1 + turn), np.ones_like(turn)], axis=1)
        return A, np.stack([turn / (1 + turn) ** 2, np.zeros_like(turn)], axis=1)[None]

    fit = fit_separable(columns, y, np.array([np.log(0.5)]), weights=np.full(60, 100.0))
    assert fit.dof == 120 - 3
    assert fit.chi2 / fit.dof == pytest.approx(1, abs=0.4)
    errors = np.array([np.exp(fit.q[0]) / 0.05 - 1, *(fit.c - [3, 2])])
    assert np.all(np.abs(errors) < 4 * np.sqrt(np.diag(fit.covariance)))


def test_claimed_errors_are_the_actual_ones() -> None:
    x = np.linspace(0, 3, 80)
    rng = np.random.default_rng(1)
    z = []
    for _ in range(200):
        fit = fit_separable(
            decays(x), 2 * np.exp(-1.3 * x) + 0.02 * rng.normal(size=80), np.array([1.0]), weights=np.full(80, 50.0)
        )
        z.append((np.r_[fit.q, fit.c] - [1.3, 2.0]) / np.sqrt(np.diag(fit.covariance)))
    assert np.std(z, axis=0) == pytest.approx([1, 1], abs=0.15)


def test_bounds_hold_and_are_told() -> None:
    x = np.linspace(0, 3, 40)
    fit = fit_separable(decays(x), np.exp(-1.3 * x), np.array([0.5]), lower=np.array([0.1]), upper=np.array([1.0]))
    assert fit.q[0] == pytest.approx(1.0, abs=1e-6)
    assert fit.at_bound.tolist() == [True]


def test_dependent_columns_are_survived() -> None:
    x = np.linspace(0, 1, 20)
    fit = linear_fit(np.stack([x, x, np.ones(20)], axis=1), 3 * x + 1)
    assert fit.c[:2].sum() == pytest.approx(3)
    assert fit.condition > 1e8
    assert fit.chi2 < 1e-20


def test_groups_share_some_coefficients_and_own_others() -> None:
    x = np.tile(np.linspace(0, 2, 30), 3)
    labels = np.repeat([0, 1, 2], 30)
    offsets = np.array([1.0, -2.0, 5.0])

    def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        e = np.exp(-q[0] * x)
        A = np.stack([e, np.ones_like(x)], axis=1)
        return per_group(A, np.stack([-x * e, np.zeros_like(x)], axis=1)[None], labels, own=[1], groups=3)

    fit = fit_separable(columns, 4 * np.exp(-0.7 * x) + offsets[labels], np.array([2.0]))
    assert fit.q == pytest.approx([0.7])
    assert fit.c == pytest.approx([4.0, *offsets])


def test_slopes_may_be_a_function_of_the_coefficients() -> None:
    x = np.linspace(0, 2, 30)
    y = 3 * np.exp(-1.7 * x) + 0.1 * np.sin(9 * x)
    full = decays(x)
    by_array = fit_separable(full, y, np.array([1.0]))
    by_function = fit_separable(lambda q: (full(q)[0], lambda c: (full(q)[1] @ c).T), y, np.array([1.0]))
    assert by_function.q == pytest.approx(by_array.q, rel=1e-12)
    assert by_function.jacobian == pytest.approx(by_array.jacobian)


def test_correlated_rows_are_whitened() -> None:
    rng = np.random.default_rng(2)
    x = np.linspace(0, 2, 60)
    half = np.tril(rng.normal(size=(60, 60))) * 0.05 + 0.2 * np.eye(60)
    inverse = np.linalg.inv(half)
    z = []
    for _ in range(100):
        y = 2 * np.exp(-1.3 * x) + half @ rng.normal(size=60)
        fit = fit_separable(decays(x), y, np.array([1.0]), whiten=lambda rows: inverse @ rows)
        z.append((fit.q[0] - 1.3) / np.sqrt(fit.covariance[0, 0]))
    assert np.std(z) == pytest.approx(1, abs=0.25)


def test_multi_start_prefers_an_acceptable_end_and_counts_agreement() -> None:
    x = np.linspace(-1, 1, 200)

    def columns(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # sin(q x): many minima
        return np.sin(q[0] * x)[:, None], (x * np.cos(q[0] * x))[None, :, None]

    y = np.sin(12 * x)
    best, agreeing, tried = multi_start(
        lambda q: fit_separable(columns, y, q), [np.array([s]) for s in (1.0, 11.5, 12.5, 30.0)]
    )
    assert best.q == pytest.approx([12.0])
    assert (agreeing, tried) == (2, 4)
    other, _, _ = multi_start(
        lambda q: fit_separable(columns, y, q), [np.array([s]) for s in (1.0, 12.5)], lambda end: end.q[0] < 10
    )
    assert other.q[0] < 10


def test_too_few_data_are_refused() -> None:
    x = np.array([0.0, 1.0])
    with pytest.raises(ValueError, match="cannot determine"):
        fit_separable(decays(x), np.exp(-x), np.array([1.0, 2.0]))


def test_covariance_of_a_known_matrix() -> None:
    jacobian = np.array([[1.0, 0.0], [0.0, 10.0], [0.0, 0.0]])
    covariance, condition = covariance_of(jacobian)
    assert covariance == pytest.approx(np.diag([1.0, 0.01]))
    assert condition == pytest.approx(1.0)
