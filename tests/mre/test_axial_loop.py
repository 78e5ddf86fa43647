"""The loop of compression as a model: the sheet's numbers, and its closed form against the equation itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.rigs.mre.axial.loop import (
    LoopModel,
    along_strokes,
    loading,
    loss_ratio,
    secant,
    slope,
    unloading,
    unloading_drop,
)
from pipeline.rigs.mre.axial.theory import Theory, theory_of

AT_0, AT_2 = LoopModel(4.55e5, 4.2e10, 24.0, 2e4), LoopModel(7.35e5, 6.0e10, 60.0, 2e4)
D_MAX = 6e-4


@pytest.mark.parametrize(("model", "expected"), [(AT_0, (510.1e3, 470.8e3, 0.261)), (AT_2, (856.6e3, 761.5e3, 0.377))])
def test_check_values_of_the_sheet(model: LoopModel, expected: tuple[float, float, float]) -> None:
    assert secant(model, D_MAX) == pytest.approx(expected[0], abs=50)
    assert slope(model, D_MAX) == pytest.approx(expected[1], abs=50)
    assert loss_ratio(model, D_MAX) == pytest.approx(expected[2], abs=5e-4)


def test_stiffening_depends_on_its_definition() -> None:
    assert secant(AT_2, D_MAX) / secant(AT_0, D_MAX) - 1 == pytest.approx(0.679, abs=5e-4)
    assert slope(AT_2, D_MAX) / slope(AT_0, D_MAX) - 1 == pytest.approx(0.617, abs=5e-4)


def test_w_is_the_solution_of_its_equation_over_two_loops() -> None:
    rho, turns = 2e4, [0.0, 6e-4, 1e-4, 5e-4, 0.0]
    s = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns)))])
    path = np.linspace(0, s[-1], 400)
    d = np.interp(path, s, turns)
    stroke = np.minimum(np.searchsorted(s[1:], path, side="left"), 3)
    direction = np.sign(np.diff(turns))

    def rate(at: float, w: np.ndarray) -> np.ndarray:
        sign = direction[min(int(np.searchsorted(s[1:], at, side="right")), 3)]
        return np.asarray(rho * (sign - w))

    expected = solve_ivp(rate, (0, s[-1]), [0.0], t_eval=path, rtol=1e-9, atol=1e-11, max_step=2e-6).y[0]
    assert along_strokes(d, stroke, turns, rho) == pytest.approx(expected, abs=2e-6)


def test_loss_is_the_area_between_the_branches() -> None:
    (d, up), (back, down) = loading(AT_0, D_MAX, 20_001), unloading(AT_0, D_MAX, 20_001)
    work = np.trapezoid(up, d)
    assert loss_ratio(AT_0, D_MAX) == pytest.approx((work + np.trapezoid(down, back)) / work, rel=1e-5)


def test_release_lies_below_by_the_drop_far_from_the_turn() -> None:
    d, F = unloading(AT_0, D_MAX)
    up = AT_0.force(d, -np.expm1(-AT_0.rho * d))
    middle = np.abs(d - 3e-4).argmin()
    assert up[middle] - F[middle] == pytest.approx(unloading_drop(AT_0, D_MAX), rel=5e-3)


def test_theory_needs_every_condition() -> None:
    given = {"pad_diameter": 0.05, "pad_height": 0.006, "powder_fraction": 0.25, "matrix_shear_modulus": 0.3e6}
    assert theory_of(given) == ["poisson_ratio"]
    found = theory_of({**given, "poisson_ratio": 0.2, "n_pads": 2.0})
    assert isinstance(found, Theory)
    assert found.stiffness == pytest.approx(2 * 516.9e3, rel=1e-4)
    assert found.bonded / found.stiffness == pytest.approx(9.68, abs=0.005)
