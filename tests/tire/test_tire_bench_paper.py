"""The paper's own arithmetic, recomputed (tire.md, section 4)."""

import pytest

from pipeline.rigs.tire.bench.paper import BATTERY, CHARGE_ALWAYS, CHARGE_GATED, SENSITIVITY, life, paper_alone


def row(name):
    return next(one for one in paper_alone() if one.name == name)


def test_the_sleep_mode_saves_seventy_percent_and_not_a_third():
    found = row("energy saved by the sleep mode")
    assert found.published == 0.334
    assert found.found == pytest.approx(395.0 / 564.0)
    assert found.agrees is False
    assert "3.34" in found.remark
    assert "375.6 mAh" in found.remark


def test_a_charge_without_its_time_gives_no_life_and_with_an_hour_three():
    assert row("time for which the stated charges last").found is None
    assert life(CHARGE_ALWAYS, 3600.0) / 3600.0 == pytest.approx(500.0 / 564.0)
    assert life(CHARGE_GATED, 3600.0) / 3600.0 == pytest.approx(500.0 / 169.0)
    assert BATTERY == 1800.0


def test_sensitivity_in_si_and_one_step_of_the_converter():
    assert pytest.approx(1.428e-4, rel=1e-3) == SENSITIVITY
    assert pytest.approx(7005.0, abs=1.0) == 1.0 / SENSITIVITY
    assert "5.64 N = 0.575 kg" in row("sensitivity of the peak, in SI").remark


def test_what_contradicts_itself_is_said_and_nothing_is_said_of_the_logs():
    rows = paper_alone()
    assert all(one.basis == "paper" for one in rows)
    contradicting = {one.name for one in rows if one.agrees is False}
    assert {"voltage of the battery", "kind of radio", "data rate of two channels", "Fig. 2a"} <= contradicting
    assert row("curvature in the contact patch").agrees is True
    assert row("time of one revolution at 10 km/h").found == pytest.approx(0.739, abs=5e-4)
