"""What `rap.therapy` finds in runs of the synthetic device: names, truth, verdicts, report (rap.md, 6, 7, 10, 11)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from rap_therapy_known import altered, faults, found, made, said, short

from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Figure, Line
from pipeline.recording import Recording
from pipeline.report.page import render_report
from pipeline.report.parameters import key_table
from pipeline.rigs.rap.synthetic.rig import synthesize_therapy
from pipeline.rigs.rap.therapy.declaration import THERAPY, TherapySettings
from pipeline.rigs.rap.therapy.outcome.thinning import envelope, picked, spans

DEVICE_LATE = 3.37
ALARMS = {
    "ACCESS_OCCLUDED": 200.0,
    "FILTER_COAGULATION": 330.0,
    "RETURN_OCCLUDED": 460.0,
    "RETURN_DISCONNECTED": 590.0,
    "ACCESS_DISCONNECTED": 720.0,
    "MEMBRANE_COAGULATION": 850.0,
}


def number(parameter: Parameter) -> float:
    assert parameter.value is not None
    return parameter.value


@cache
def motion() -> Recording:
    return synthesize_therapy({"runs": ["rap_tank_motion"]}, 4)[0]


@cache
def campaign() -> Findings:
    """Return the findings of a short therapy, a tank on the move and injected faults together."""
    return found(short(), motion(), faults()).model_copy(update={"settings": TherapySettings().model_dump()})


def test_every_run_gives_what_its_channels_allow_and_no_more() -> None:
    parts = campaign().arrays["parts"]
    asked = {(row.run, row.part): bool(row.asked) for row in parts.itertuples()}
    assert asked["rap_tank_motion", "volume"]
    assert not asked["rap_tank_motion", "membrane"]
    assert not asked["rap_tank_motion", "alarms"]
    assert not asked["rap_faults", "battery"]
    assert not campaign().find("k_uf_initial", run="rap_tank_motion")
    assert not campaign().find("energy_used", run="rap_faults")
    assert not campaign().find("alarm_time", run="rap_tank_motion")


def test_parameters_are_told_at_the_keys_of_the_sheet() -> None:
    keys = {
        "temperature_final": {"run", "source"},
        "uf_volume_final": {"run"},
        "alarm_time": {"run", "alarm", "index"},
        "mismatch_time": {"run", "channel", "index"},
    }
    for name, expected in keys.items():
        assert {frozenset(p.at) for p in campaign().find(name)} == {frozenset(expected)}


def test_units_are_those_of_the_declaration() -> None:
    for parameter in campaign().parameters:
        assert parameter.unit == THERAPY.parameter(parameter.name).unit


@pytest.mark.parametrize("alarm", ALARMS)
def test_injected_fault_raises_its_alarm_alone_and_in_time(alarm: str) -> None:
    times = [number(p) for p in campaign().find("alarm_time", run="rap_faults", alarm=alarm)]
    assert len(times) == 1
    delay = times[0] - (ALARMS[alarm] - DEVICE_LATE)
    assert 0.9 < delay < 5.0


def test_pause_of_145_s_is_a_stagnation_and_that_of_100_s_is_none() -> None:
    (found_,) = campaign().find("alarm_time", run="rap_faults", alarm="PROLONGED_STAGNATION")
    assert found_.value == pytest.approx(1200.0 - DEVICE_LATE + 120.0, abs=0.6)


def test_mismatches_are_found_at_their_taps() -> None:
    taps = {p.at["channel"]: p.value for p in campaign().find("mismatch_time", run="rap_faults")}
    assert set(taps) == {"prefilter", "return"}
    assert taps["prefilter"] == pytest.approx(130.0 - DEVICE_LATE, abs=0.6)


def test_units_that_disagree_stand_among_the_findings_on_the_data_and_once_in_the_reasons() -> None:
    told = [q for q in campaign().quality if "Control and protective unit disagree" in q.message]
    assert [(q.level, q.run) for q in told] == [("warning", "rap_faults")]
    assert sum("protective unit disagree" in reason for reason in campaign().reasons) == 1


def test_alarms_match_the_log() -> None:
    checks = campaign().arrays["checks"]
    row = checks[(checks["run"] == "rap_faults") & (checks["criterion"] == "alarms beside the log")]
    assert row["word"].tolist() == ["match"]


def test_log_without_codes_is_not_checkable_and_said_so() -> None:
    findings = found(altered(faults(), drop=("alarm_code",)))
    assert "not checkable" in findings.arrays["checks"]["word"].tolist()
    assert "lists no codes" in said(findings)


def test_alarms_are_counted_in_runs_that_can_raise_them() -> None:
    counts = {p.at["run"]: p.value for p in campaign().find("alarm_count")}
    assert counts == {"rap_therapy_312": 0, "rap_faults": len(campaign().find("alarm_time", run="rap_faults"))}


def test_key_numbers_begin_with_the_volume_end_with_temperature_and_are_known_where_any_run_knows_them() -> None:
    rows = key_table(campaign(), THERAPY).rows
    assert "end</sub> at run" in rows[0][0].text
    assert "Δ" in rows[-1][0].text
    unknown = [row[0].text for row in rows if row[1].text == "not determined"]
    assert len(unknown) == 1  # the decline, for which each of these runs is too short
    assert unknown[0].startswith("<var>a</var>")


def test_runs_stand_side_by_side_in_the_figures_of_temperature() -> None:
    chapter = next(chapter for chapter in THERAPY.sections(campaign()) if chapter.name == "temperature")
    figures = [block for block in chapter.blocks if isinstance(block, Figure)]
    assert [(len(figure.panels), figure.columns) for figure in figures] == [(3, 3), (3, 3)]
    (allowed,) = [m for m in figures[1].panels[0].marks if isinstance(m, Line)]
    assert allowed.y[-1] == pytest.approx(0.05 * 30.0, abs=0.08)


def test_energy_is_power_over_time() -> None:
    used = campaign().one("energy_used", run="rap_therapy_312")
    power, duration = 13.9, float(short().stream_of("battery_voltage").duration)
    assert used.value == pytest.approx(power * duration, rel=0.01)
    runtime = campaign().one("runtime_projected", run="rap_therapy_312")
    assert runtime.value == pytest.approx(0.97 * 75.5 * 3600.0 / power, rel=0.01)


def test_temperature_of_the_device_is_off_by_its_offset() -> None:
    final = {s: number(campaign().one("temperature_final", run="rap_tank_motion", source=s)) for s in ("rap", "bench")}
    assert final["bench"] == pytest.approx(303.15, abs=0.1)
    assert final["rap"] - final["bench"] == pytest.approx(0.8, abs=0.35)


def test_volume_on_the_move_is_within_what_is_asked() -> None:
    assert number(campaign().one("uf_volume_error_rms", run="rap_tank_motion")) < 1.5e-6
    assert campaign().one("uf_volume_final", run="rap_tank_motion").value == pytest.approx(0.9e-3, abs=4e-6)


def test_short_runs_have_no_decline_and_say_what_it_takes() -> None:
    decline = campaign().one("k_uf_decline", run="rap_therapy_312")
    assert decline.value is None
    assert "2 h" in decline.description


def test_determined_numbers_stand_before_undetermined_ones_of_the_same_name() -> None:
    finals = [p.value is None for p in campaign().find("temperature_final")]
    assert finals == sorted(finals)


def test_number_that_another_run_gives_is_no_reason_to_warn() -> None:
    assert not any("temperature_final" in reason for reason in campaign().reasons)


def test_device_that_keeps_what_is_asked_has_verdict_ok() -> None:
    # Two and a half hours without any fault: a sensor without offset and a membrane that does not change.
    run = made(
        5, duration=9000.0, fouling=0.0, wear=0.0, temperature_offset=0.0, temperature_noise=0.05, initial_volume=0.2e-3
    )
    findings = found(run)
    assert findings.reasons
    assert findings.verdict == "ok", findings.reasons


def test_temperature_beyond_its_tolerance_is_red() -> None:
    findings = found(made(temperature_offset=3.0))
    checks = findings.arrays["checks"]
    assert checks[checks["criterion"].str.contains("temperature")]["mood"].tolist() == ["rejected"]
    assert findings.verdict == "warning"


def test_battery_that_does_not_last_is_red() -> None:
    findings = found(made(battery_efficiency=0.85))
    checks = findings.arrays["checks"]
    assert checks[checks["criterion"].str.contains("battery")]["word"].tolist() == ["too little"]
    assert "4.6" in said(findings)


def test_paper_rows_and_rows_of_the_logs_stand_apart() -> None:
    basis = {row.basis for row in campaign().published}
    assert basis == {"logs", "paper"}
    power = next(row for row in campaign().published if row.name.startswith("mean power"))
    assert power.agrees is True
    stagnation = next(row for row in campaign().published if row.name.startswith("stagnation alarm"))
    assert stagnation.agrees is True


def test_report_holds_every_chapter_and_the_notes_of_the_set_points() -> None:
    page = render_report(campaign(), THERAPY, "Therapy", "rigfit run")
    for words in ("Ultrafiltrate volume", "Membrane", "Battery", "Events and alarms", "Control and protective unit"):
        assert words in page
    assert "3.6 to 4.8 times the need" in page
    assert "1 to 3 mL/h, not the 1 to 2.5 mL/h" in page
    assert len(page) < 5e6


@pytest.mark.parametrize("tables", [("device_temperature",), ("device_status",), ("device", "events")])
def test_report_of_a_part_of_the_tables_is_drawn(tables: tuple[str, ...]) -> None:
    findings = found(altered(faults() if "events" in tables else short(), tables=tables))
    assert render_report(findings, THERAPY, "", "rigfit run")
    assert THERAPY.methods(findings)


def test_envelope_loses_no_extreme_and_keeps_gaps() -> None:
    time = np.linspace(0.0, 100.0, 50_001)
    values = np.sin(time)
    values[31_234] = 7.0
    values[10_000:20_000] = np.nan
    middle, low, high = envelope(time, values, 200)
    assert middle.size == 200
    assert np.nanmax(high) == 7.0
    assert np.isnan(low[45:75]).any()


def test_picked_places_hold_both_ends() -> None:
    places = picked(10_001, 101)
    assert places[0] == 0
    assert places[-1] == 10_000
    assert places.size == 101


def test_spans_end_where_the_mask_or_the_record_does() -> None:
    mask = np.array([1, 1, 0, 1, 0, 0, 1, 1], dtype=bool)
    assert spans(np.arange(8.0), mask) == [(0.0, 1.0), (3.0, 3.0), (6.0, 7.0)]
