"""The device's own codes and states beside what was re-derived."""

import pytest
from rap_device_log import device, events

from pipeline.recording import Recording
from pipeline.rigs.rap.alarms import alarm_numbers
from pipeline.rigs.rap.alarms.codes import CODES, understood
from pipeline.rigs.rap.alarms.rates import rate
from pipeline.rigs.rap.alarms.transitions import STATES, TABLE, may_follow, target

FAULT = (("access", 4.0, 200.0, 240.0),)


def _rows(*codes, factors=FAULT, **more):
    table = events((0.0, "therapy_state", "READY"), *((t, "alarm_code", word) for t, word in codes))
    return alarm_numbers(device(factors=factors, tables={"events": table}, **more))


def _verdicts(found):
    return [(row.code, row.verdict) for row in found.comparison.rows]


def test_a_code_that_belongs_is_a_match_with_its_delay():
    found = _rows((202.0, "ACCESS_OCCLUDED"))
    assert _verdicts(found) == [("ACCESS_OCCLUDED", "match")]
    assert found.comparison.rows[0].delay == pytest.approx(202.0 - found.alarms[0].time, abs=1e-4)
    assert found.false_alarms.count == 0


def test_late_missed_and_extra_codes_are_told_apart():
    assert _verdicts(_rows((225.0, "ACCESS_OCCLUDED"))) == [("ACCESS_OCCLUDED", "late")]
    missed = _rows((300.0, "AIR"))
    assert _verdicts(missed) == [("ACCESS_OCCLUDED", "missed"), ("AIR", "extra")]
    assert missed.false_alarms.count == 1


def test_another_code_does_not_stand_for_it():
    assert _verdicts(_rows((202.0, "RETURN_OCCLUDED"))) == [("ACCESS_OCCLUDED", "missed"), ("RETURN_OCCLUDED", "extra")]


def test_a_code_written_again_and_again_is_one_alarm():
    again = [(202.0 + i, "ACCESS_OCCLUDED") for i in range(35)]
    assert _verdicts(_rows(*again)) == [("ACCESS_OCCLUDED", "match")]


def test_a_column_that_says_none_in_between_is_understood():
    rows = [(0.0, "NONE"), (202.0, "ACCESS_OCCLUDED"), (240.0, "OK")]
    assert _verdicts(_rows(*rows)) == [("ACCESS_OCCLUDED", "match")]


def test_codes_in_unknown_words_are_told():
    found = _rows((202.0, "E17"))
    assert [entry.text for entry in found.comparison.unknown] == ["E17"]
    assert any("'E17'" in problem.message for problem in found.problems)


@pytest.mark.parametrize(
    ("word", "code"),
    [
        ("access occluded", "ACCESS_OCCLUDED"),
        ("Return line clotted", "RETURN_OCCLUDED"),
        ("RETURN_COAGULATED", "RETURN_OCCLUDED"),
        ("Air in line", "AIR"),
        ("air_detected", "AIR"),
        ("E-STOP", "EMERGENCY_STOP"),
        ("sensor mismatch (pre)", "SENSOR_MISMATCH"),
        ("Blood leak", "BLOOD_LEAK"),
        ("pair", None),
        ("17", None),
    ],
)
def test_words_of_other_loggers(word, code):
    assert understood(word) == code


def test_every_code_understands_itself():
    assert all(understood(code) == code for code in CODES)


def test_a_log_without_codes_has_nothing_to_compare():
    found = alarm_numbers(device(factors=FAULT))
    assert found.comparison.rows == ()
    assert not found.comparison.logged_any


def test_states_that_cannot_follow_one_another_are_told():
    table = events(
        (0.0, "therapy_state", "SETUP"), (19.0, "therapy_state", "THERAPY"), (300.0, "therapy_state", "PRIMING")
    )
    messages = [p.message for p in alarm_numbers(device(tables={"events": table})).problems]
    assert any("SETUP to THERAPY" in message for message in messages)
    assert any("THERAPY to PRIMING" in message for message in messages)
    unknown = events((0.0, "therapy_state", "DANCING"))
    assert any("DANCING" in p.message for p in alarm_numbers(device(tables={"events": unknown})).problems)


def test_the_table_knows_the_ways_of_the_fact_sheet():
    assert target("THERAPY", "pump stops") == "PAUSE"
    assert target("PAUSE", "pump starts") == "THERAPY"
    assert target("PAUSE", "blood stood too long") == "ALARM"
    assert {target(state, "cause of an alarm") for state in ("THERAPY", "PAUSE", "ALARM")} == {"ALARM"}
    assert target("OFF", "cause of an alarm") is None
    assert target("ALARM", "cause gone, pump runs") == "THERAPY"
    assert {row.source for row in TABLE} | {row.target for row in TABLE} == set(STATES)
    assert may_follow("TERMINATION", "OFF")
    assert not may_follow("OFF", "THERAPY")


def test_no_event_in_5_hours_bounds_the_rate_at_0_6_an_hour():
    assert rate(0, 5 * 3600.0).upper95 == pytest.approx(0.599, abs=0.001)
    assert rate(3, 3600.0).upper95 == pytest.approx(7.754, abs=0.001)


def test_states_of_a_log_that_begins_anywhere():
    found = alarm_numbers(device(start=0.0))
    assert [s.state for s in found.states] == ["THERAPY"]
    assert any("no standstill" in p.message for p in found.problems)


def test_two_alarms_of_one_code_half_a_minute_apart_are_two():
    twice = (("access", 4.0, 200.0, 215.0), ("access", 4.0, 240.0, 255.0))
    found = _rows((202.0, "ACCESS_OCCLUDED"), (242.0, "ACCESS_OCCLUDED"), factors=twice)
    assert _verdicts(found) == [("ACCESS_OCCLUDED", "match")] * 2


def test_states_alone_tell_stagnation_and_pressures_are_not_judged():
    rows = ((0.0, "READY"), (20.0, "THERAPY"), (600.0, "PAUSE"), (720.1, "ALARM"), (745.0, "THERAPY"), (900.0, "PAUSE"), (990.0, "THERAPY"))  # fmt: skip
    table = events(
        *((t, "therapy_state", word) for t, word in rows), (720.1, "alarm_code", "PROLONGED_STAGNATION"),
        (100.0, "alarm_code", "ACCESS_OCCLUDED"), (1200.0, "therapy_state", "TERMINATION"),
    )  # fmt: skip
    found = alarm_numbers(Recording("run", {"events": table}, {}))
    assert [alarm.code for alarm in found.alarms] == ["PROLONGED_STAGNATION"]
    assert found.alarms[0].time == pytest.approx(720.0, abs=0.1)
    assert _verdicts(found) == [("PROLONGED_STAGNATION", "match")]
    assert any("cannot be checked" in problem.message for problem in found.problems)


@pytest.mark.parametrize("start", [200.0, 200.37])
def test_a_stop_seen_in_the_pulsation_alone_is_timed_by_the_fall_of_the_pressure(start):
    log = device(stops=((start, 350.0),), told=("uf_pump_command",), uf_runs=lambda t, on: (t > 20.0) * 1.0)
    (alarm,) = [a for a in alarm_numbers(log).alarms if a.code == "PROLONGED_STAGNATION"]
    assert alarm.time == pytest.approx(start + 120.0, abs=0.25)
    assert abs(alarm.time - start - 120.0) < 2.0 * alarm.std_error
