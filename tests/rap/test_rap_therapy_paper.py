"""The paper's arithmetic (rap.md, section 4, rows 1-4, 6, 7, 12, 13), computed and not typed in."""

from __future__ import annotations

import pytest

from pipeline.rigs.rap.therapy.outcome.paper import ML_H, ML_MIN, heparin_flow, paper_alone, set_point_notes

ROWS = {row.name: row for row in paper_alone()}


def test_battery_lasts_longer_than_five_hours_and_hardly_the_trial() -> None:
    assert ROWS["battery runtime"].found == "5.432 h (325.9 min)"
    assert "69.5 Wh, 92.1 %" in ROWS["battery runtime"].remark
    assert "0.90: 4.89 h, 0.85: 4.62 h" in ROWS["battery runtime"].remark
    trial = ROWS["312 min trial on one battery"]
    assert trial.found == "72.28 Wh, 95.7 %"
    assert "0.957" in trial.remark
    assert "20.4 Ah" in trial.remark


def test_a_day_takes_more_than_four_batteries() -> None:
    assert ROWS["use 24 h a day"].found == "333.6 Wh, 4.42 batteries a day"


def test_need_and_accelerated_trial() -> None:
    assert ROWS["ultrafiltration that a patient needs"].found == "1.042 to 1.389 mL/min"
    trial = ROWS["accelerated ultrafiltration"]
    assert trial.agrees is True
    assert trial.found == "1.50 L (312 min: 1.56 L); 24 h would be 7.2 L"
    for text in ("3.6 to 4.8", "6.67 h", "5.43 h", "1.63 L", "7.33 h", "3.27 times", "35.2 to 26.4 h"):
        assert text in trial.remark


def test_upper_end_of_the_heparin_flow_is_contradicted() -> None:
    row = ROWS["heparin flow"]
    assert row.agrees is False
    assert heparin_flow() == pytest.approx((1.0 * ML_H, 3.0 * ML_H))
    for text in ("1250 IU/h", "600 IU/mL", "0.83 mL/h", "0.33 to 1 %", "1.2 to 4.8 %"):
        assert text in row.remark


def test_temperature_error_is_a_share_of_degrees_celsius() -> None:
    assert ROWS["largest temperature error"].found == "1.25 K at 25 °C, 1.50 K at 30 °C"
    assert "15 K" in ROWS["largest temperature error"].remark
    assert "33 in all" in ROWS["start of the temperature run"].remark


def test_medium_passes_and_hemolysis() -> None:
    assert ROWS["passes of the culture medium in the cytotoxicity test"].found == "72 at 100 mL/min, 43.2 at 60 mL/min"
    assert ROWS["low hemolysis"].agrees is None


def test_all_rows_speak_of_the_paper_alone() -> None:
    assert {row.basis for row in ROWS.values()} == {"paper"}


def test_notes_stand_beside_the_set_points_of_a_run() -> None:
    uf, heparin, meter = set_point_notes(80 * ML_MIN, 5 * ML_MIN, 2 * ML_H)
    assert "3.6 to 4.8 times the need" in uf
    assert "7.33 h" in uf
    assert "1 to 3 mL/h" in heparin
    assert "0.67 %" in heparin
    assert "6.25 % less" in meter


def test_heparin_outside_of_what_the_doses_need_is_told() -> None:
    assert "outside that range" in set_point_notes(None, 5 * ML_MIN, 4 * ML_H)[-1]
