"""The circuit against closed forms, conservation and the sheet's table of steady signatures (rap.md, 3.3, 3.9, 6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.rap.circuit.hydraulics import (
    Circuit,
    discrete,
    filter_transfer,
    outlet_impedance,
    state_space,
    steady_state,
    transmembrane,
)
from pipeline.rigs.rap.circuit.pump import Pump, flow_at, speed_for

ML_MIN = 1e-6 / 60.0
MMHG = 133.322
UF = 5.0 * ML_MIN


def test_eigenvalues_are_those_of_the_sheet() -> None:
    found = np.sort_complex(np.linalg.eigvals(state_space(Circuit())[0]))
    sheet = np.sort_complex([-7 + 14.2j, -7 - 14.2j, -8.36 + 4.19j, -8.36 - 4.19j, -22.9, -0.668])
    assert np.allclose(found, sheet, atol=0.03)
    assert np.all(found.real < 0.0)


def test_steady_state_leaves_the_state_space_at_rest() -> None:
    c = Circuit()
    A, B = state_space(c)
    Q = 80.0 * ML_MIN
    x = steady_state(c, Q, UF)
    rate = A @ x + B @ np.array([Q, Q, UF])
    size = np.abs(A) @ np.abs(x)
    assert np.all(np.abs(rate) < 1e-12 * size)


def test_transmembrane_pressure_at_rest_knows_nothing_of_the_blood_flow() -> None:
    c = Circuit()
    for flow in (60.0, 80.0, 100.0):
        x = steady_state(c, flow * ML_MIN, UF)
        assert transmembrane(x[1], x[2], x[3]) == pytest.approx(UF / c.K_uf)


def test_offsets_of_the_sensors_become_an_offset_of_the_transmembrane_pressure() -> None:
    assert transmembrane(80.0, 40.0, -30.0) == 90.0


def test_transfer_of_the_filter_is_that_of_the_state_space() -> None:
    c = Circuit()
    A, B = state_space(c)
    for f in (0.05, 1.4, 1.958, 2.559, 7.7):
        s = 2j * np.pi * f
        x = np.linalg.solve(s * np.eye(6) - A, B[:, 1])
        assert filter_transfer(c, s) == pytest.approx(x[2] / x[1], rel=1e-10)
        assert outlet_impedance(c, s) == pytest.approx(x[1], rel=1e-10)


def test_a_step_is_exact_however_long_it_is() -> None:
    A, B = state_space(Circuit())
    u = np.array([1.2e-6, 1.3e-6, 8e-8])
    Ad, Bd = discrete(A, B, 0.001)
    x = np.zeros(6)
    for _ in range(200):
        x = Ad @ x + Bd @ u
    at_once = discrete(A, B, 0.2)[1] @ u
    assert np.allclose(x, at_once, rtol=1e-9)


def test_after_a_step_of_ultrafiltration_the_pressure_settles_with_C_u_over_K_uf() -> None:
    # With stiff blood side (pressures held), P_uf alone relaxes.
    c = replace(Circuit(), C_1=1e3, C_2=1e3)
    A, _ = state_space(c)
    assert -1.0 / A[3, 3] == pytest.approx(c.C_u / c.K_uf)


# Case: what changes, P_a, P_pre, P_ret, P_uf, TMP, P_pre - P_ret (mmHg) of the sheet's section 3.9.
SIGNATURES = [
    ({}, (-14.0, 24.8, 13.1, -11.1, 30.0, 11.6)),
    ({"R_a": 4.0}, (-48.5, 21.3, 11.2, -13.8, 30.0, 10.0)),
    ({"R_a": 0.2}, (-2.9, 25.9, 13.7, -10.2, 30.0, 12.1)),
    ({"R_f": 2.5}, (-13.2, 39.5, 12.3, -4.1, 30.0, 27.3)),
    ({"R_r": 2.5}, (-13.1, 41.3, 30.4, 5.9, 30.0, 10.8)),
    ({"R_r": 0.2}, (-14.6, 14.9, 2.7, -21.2, 30.0, 12.1)),
    ({"K_uf": 0.5}, (-14.0, 24.8, 13.1, -41.1, 60.0, 11.6)),
]


@pytest.mark.parametrize(("changed", "mmhg"), SIGNATURES)
def test_steady_signatures_are_those_of_the_sheet(changed: dict[str, float], mmhg: tuple[float, ...]) -> None:
    c, p = Circuit(), Pump()
    f = speed_for(p, c, 80.0 * ML_MIN, UF)
    faulty = replace(c, **{name: getattr(c, name) * times for name, times in changed.items()})
    x = steady_state(faulty, flow_at(p, faulty, f, UF), UF)
    found = np.array([*x[:4], transmembrane(x[1], x[2], x[3]), x[1] - x[2]]) / MMHG
    assert np.allclose(found, mmhg, atol=0.051)
