"""The blood pump against closed forms and the sheet's speeds (rap.md, 3.4 and 6)."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.rigs.rap.circuit.hydraulics import Circuit
from pipeline.rigs.rap.circuit.pump import Pump, back_pressure, back_suction, flow_at, fundamental, speed_for, stroke

ML_MIN = 1e-6 / 60.0


@pytest.mark.parametrize(("flow", "f", "volume"), [(60.0, 1.407, 0.711), (80.0, 1.958, 0.681), (100.0, 2.559, 0.651)])
def test_speed_and_stroke_at_the_set_points_are_those_of_the_sheet(flow: float, f: float, volume: float) -> None:
    c, p = Circuit(), Pump()
    Q = flow * ML_MIN
    assert speed_for(p, c, Q) == pytest.approx(f, abs=5e-4)
    assert stroke(p, back_pressure(c, Q, 0.0)) == pytest.approx(volume * 1e-6, abs=5e-10)


def test_a_stroke_calibrated_at_60_is_nine_per_cent_off_at_100() -> None:
    c, p = Circuit(), Pump()
    sixty = 60.0 * ML_MIN / speed_for(p, c, 60.0 * ML_MIN)
    assert sixty * speed_for(p, c, 100.0 * ML_MIN) / (100.0 * ML_MIN) - 1.0 == pytest.approx(0.091, abs=1e-3)


def test_flow_at_a_speed_undoes_the_speed_for_a_flow() -> None:
    c, p = Circuit(), Pump()
    for Q, Q_uf in ((1e-6, 0.0), (1.5e-6, 8e-8)):
        assert flow_at(p, c, speed_for(p, c, Q, Q_uf), Q_uf) == pytest.approx(Q, rel=1e-12)


@pytest.mark.parametrize("w", [0.2, 0.35, 0.8, 1.0])
def test_back_suction_has_area_one_and_the_fundamental_of_the_closed_form(w: float) -> None:
    phase = (np.arange(200000) + 0.5) / 200000
    h = back_suction(phase, w)
    assert h.mean() == pytest.approx(1.0, abs=1e-8)
    assert abs(np.mean(h * np.exp(-2j * np.pi * phase))) == pytest.approx(fundamental(w), rel=1e-6)


def test_fundamental_at_the_sheet_s_width() -> None:
    assert fundamental(0.35) == pytest.approx(0.923, abs=1e-3)
