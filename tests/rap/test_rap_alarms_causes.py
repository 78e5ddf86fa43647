"""Alarms re-derived from pressures, flags and standstills, on circuits whose faults are known."""

import numpy as np
import pytest
from rap_device_log import ML_MIN, device, events, flag, with_channel, without

from pipeline.rigs.rap.alarms import AlarmLimits, alarm_numbers

ONE_EACH = (
    ("access", 4.0, "ACCESS_OCCLUDED"),
    ("access", 0.2, "ACCESS_DISCONNECTED"),
    ("filter", 2.5, "FILTER_COAGULATION"),
    ("return", 2.5, "RETURN_OCCLUDED"),
    ("return", 0.2, "RETURN_DISCONNECTED"),
    ("membrane", 2.0, "MEMBRANE_COAGULATION"),
    ("membrane", 0.2, "UF_LINE_OPEN"),
)


def _codes(recording, **limits):
    return [alarm.code for alarm in alarm_numbers(recording, AlarmLimits(**limits)).alarms]


@pytest.mark.parametrize(("what", "factor", "code"), ONE_EACH)
def test_each_fault_gives_its_own_alarm_and_no_other(what, factor, code):
    found = alarm_numbers(device(factors=[(what, factor, 200.0, 240.0)]))
    assert [alarm.code for alarm in found.alarms] == [code]
    alarm = found.alarms[0]
    assert 1.0 <= alarm.time - 200.0 <= (5.0 if what == "membrane" else 2.0)
    assert alarm.ended == pytest.approx(240.0, abs=3.0)
    assert [s.state for s in found.states] == ["READY", "THERAPY", "ALARM", "THERAPY"]


@pytest.mark.parametrize(
    ("flow", "uf", "frequency"), [(60.0, 5.0, 1.407), (100.0, 5.0, 2.559), (100.0, 1.4, 2.559), (120.0, 0.0, 3.1)]
)
def test_other_set_points_are_understood(flow, uf, frequency):
    faults = [
        ("access", 4.0, 100.0, 130.0),
        ("filter", 2.5, 180.0, 210.0),
        ("return", 0.2, 260.0, 290.0),
        ("return", 2.5, 340.0, 370.0),
    ]
    assert _codes(device(flow=flow, uf=uf, frequency=frequency, factors=faults)) == [
        "ACCESS_OCCLUDED", "FILTER_COAGULATION", "RETURN_DISCONNECTED", "RETURN_OCCLUDED",
    ]  # fmt: skip


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
def test_other_rates_are_understood(rate):
    assert _codes(device(300.0, rate, factors=[("return", 2.5, 200.0, 230.0)])) == ["RETURN_OCCLUDED"]


def test_a_sound_run_raises_nothing():
    found = alarm_numbers(device(1200.0, stops=[(500.0, 600.0)]))
    assert found.alarms == ()
    assert found.false_alarms.count == 0
    assert all(noise < 0.02 for noise in found.ratios.noise.values())
    assert found.ratios.zero["prefilter"] == pytest.approx(80.0, abs=5.0)


def test_baseline_is_that_of_the_circuit():
    ratios = alarm_numbers(device(factors=[("access", 4.0, 30.0, 120.0)])).ratios
    assert ratios.baseline["access"] == pytest.approx(1.4e9, rel=0.01)
    assert ratios.baseline["filter"] == pytest.approx(1.2e9, rel=0.01)
    assert ratios.baseline["membrane"] == pytest.approx(2.0835e-11, rel=0.01)


def test_a_fault_at_the_start_is_seen_though_the_baseline_is_taken_there():
    assert _codes(device(factors=[("filter", 2.5, 30.0, 90.0)])) == ["FILTER_COAGULATION"]


def test_a_start_unlike_the_rest_is_doubted_in_words():
    found = alarm_numbers(device(1500.0, factors=[("return", 2.5, 0.0, 330.0)]))
    assert any("first minutes" in problem.message for problem in found.problems)
    assert [alarm.code for alarm in found.alarms] == ["RETURN_OCCLUDED"]


def test_ramps_and_new_set_points_raise_nothing():
    def steps(t):
        return np.select([t < 120.0, t < 220.0, t < 320.0], [60.0, 80.0, 100.0], 60.0)

    assert _codes(device(flow_at=steps, frequency=2.0)) == []
    ramp = device(flow_at=lambda t: np.clip(60.0 + (t - 100.0), 60.0, 100.0))
    assert _codes(ramp) == []


def test_a_set_point_alone_is_enough_and_a_pause_is_seen_in_the_pressures():
    recording = device(stops=[(150.0, 290.0)])
    still_set = with_channel(recording, "blood_flow_set", lambda _t, v: np.full(v.size, 80.0 * ML_MIN))
    found = alarm_numbers(without(still_set, "uf_pump_command"))
    assert [alarm.code for alarm in found.alarms] == ["PROLONGED_STAGNATION"]
    assert found.alarms[0].time == pytest.approx(270.0, abs=1.0)


def test_without_any_flow_the_run_is_judged_and_told():
    found = alarm_numbers(without(device(factors=[("access", 4.0, 200.0, 230.0)]), "blood_flow_set"))
    assert [alarm.code for alarm in found.alarms] == ["ACCESS_OCCLUDED"]
    assert any("taken as constant" in problem.message for problem in found.problems)


def test_a_pump_that_slips_disconnects_nothing():
    recording = device()
    slow = with_channel(recording, "blood_flow_set", lambda t, v: np.where((t > 200.0) & (t < 240.0), 2.5 * v, v))
    found = alarm_numbers(without(slow, "uf_pump_command"))
    assert not [alarm for alarm in found.alarms if "DISCONNECTED" in alarm.code]
    assert any("less than its set-point" in problem.message for problem in found.problems)


def test_membrane_is_not_blamed_for_a_pressure_that_jumps():
    # At a low rate TMP is small, and an occluded return line moves it by more than half of it for seconds.
    for uf in (1.0, 2.0, 3.0):
        found = _codes(device(uf=uf, factors=[("return", 2.5, 200.0, 230.0)], flow=100.0, frequency=2.559))
        assert found == ["RETURN_OCCLUDED"]


@pytest.mark.parametrize(
    ("name", "code"),
    [("air_detected", "AIR"), ("blood_leak_detected", "BLOOD_LEAK"), ("estop_pressed", "EMERGENCY_STOP")],
)
def test_flags_are_alarms_at_once(name, code):
    found = alarm_numbers(device(tables={"flags": flag(name, (5.0, 8.0), (200.0, 203.0), duration=400.0)}))
    assert [alarm.code for alarm in found.alarms] == [code]  # before the pumps run there is nothing to stop
    assert found.alarms[0].time == pytest.approx(200.0, abs=0.06)


def test_a_watchdog_that_is_not_served_is_an_alarm():
    lost = flag("watchdog_ok", (0.0, 200.0), (210.0, 400.0))
    assert _codes(device(tables={"flags": lost})) == ["WATCHDOG"]


def test_a_standstill_beyond_120_s_is_an_alarm_and_one_of_100_s_is_none():
    found = alarm_numbers(device(500.0, stops=[(50.0, 150.0), (250.0, 395.0)]))
    assert [alarm.code for alarm in found.alarms] == ["PROLONGED_STAGNATION"]
    assert found.alarms[0].time - 250.0 == pytest.approx(120.05, abs=0.06)
    assert [s.state for s in found.states] == ["READY", "THERAPY", "PAUSE", "THERAPY", "PAUSE", "ALARM", "THERAPY"]
    assert _codes(device(500.0, stops=[(250.0, 395.0)]), stagnation=150.0) == []


def test_an_emergency_stop_counts_as_standstill_also_after_the_button_is_released():
    pressed = flag("estop_pressed", (100.0, 110.0))
    codes = _codes(device(stops=[(100.1, 260.0)], tables={"flags": pressed}))
    assert codes == ["EMERGENCY_STOP", "PROLONGED_STAGNATION"]


def test_an_alarm_that_stopped_the_pump_is_not_told_again_as_standstill():
    air = flag("air_detected", (100.0, 103.0))
    assert _codes(device(stops=[(100.1, 260.0)], tables={"flags": air})) == ["AIR"]


def test_no_standstill_is_counted_before_the_start_and_after_the_end():
    rows = [
        (0.0, "therapy_state", "SETUP"),
        (150.0, "therapy_state", "THERAPY"),
        (200.0, "therapy_state", "TERMINATION"),
    ]
    found = alarm_numbers(device(start=150.0, stops=[(200.0, 400.0)], tables={"events": events(*rows)}))
    assert found.alarms == ()
    assert found.states[-1].state == "TERMINATION"


def test_fluid_removed_before_the_stop_is_counted():
    air = flag("air_detected", (200.0, 230.0))
    goes_on = alarm_numbers(device(tables={"flags": air})).alarms[0]
    assert goes_on.fluid_removed == pytest.approx(5.0 * ML_MIN * 30.0, rel=0.02)
    assert not goes_on.uf_stopped
    stops = alarm_numbers(device(tables={"flags": air}, stops=[(206.0, 240.0)])).alarms[0]
    assert stops.fluid_removed == pytest.approx(5.0 * ML_MIN * 6.0, rel=0.02)
    assert stops.uf_stopped


def test_ultrafiltration_without_circulation_is_found():
    alone = device(stops=[(200.0, 260.0)], uf_runs=lambda t, on: on | ((t >= 200.0) & (t < 230.0)))
    found = alarm_numbers(alone).uf_alone
    assert len(found) == 1
    assert (found[0].start, found[0].end) == pytest.approx((200.0, 230.0), abs=0.3)
    assert found[0].volume == pytest.approx(5.0 * ML_MIN * 30.0, rel=0.02)
    assert found[0].certain
    # A set-point that stands during a pause is no ultrafiltration where the pressures say nothing of it.
    assert alarm_numbers(device(stops=[(200.0, 260.0)], told=("blood_flow_set", "uf_flow_set"))).uf_alone == ()


def test_exchanged_channels_and_a_turned_sign_give_no_number_but_a_reason():
    turned = with_channel(device(), "pressure_access_rap", lambda _t, v: -v)
    found = alarm_numbers(turned)
    assert "access" not in found.ratios.baseline
    assert any("not positive" in problem.message for problem in found.problems)


def test_missing_taps_leave_the_others():
    lacking = without(device(factors=[("access", 4.0, 200.0, 230.0)]), "pressure_uf_rap", "pressure_uf_prot")
    found = alarm_numbers(lacking)
    assert [alarm.code for alarm in found.alarms] == ["ACCESS_OCCLUDED"]
    assert any("ultrafiltrate" in problem.message for problem in found.problems)


def test_a_log_without_pressures_or_without_a_running_pump_is_told():
    nothing = without(
        device(),
        *(f"pressure_{tap}_{unit}" for tap in ("access", "prefilter", "return", "uf") for unit in ("rap", "prot")),
    )
    assert "no pressure" in alarm_numbers(nothing).undetermined
    assert "never runs" in alarm_numbers(device(start=1e9)).undetermined


def test_the_protective_unit_stands_in_for_the_control_unit():
    taps = tuple(f"pressure_{tap}_rap" for tap in ("access", "prefilter", "return", "uf"))
    assert _codes(without(device(factors=[("return", 2.5, 200.0, 230.0)]), *taps)) == ["RETURN_OCCLUDED"]


def test_a_hole_in_the_log_is_no_stop_of_the_pump():
    recording = device()
    stream = recording.streams["device"]
    kept = (stream.time < 150.0) | (stream.time > 153.0)
    channels = {n: type(c)(n, c.values[kept], c.unit) for n, c in stream.channels.items()}
    holed = type(recording)("run", {"device": type(stream)("device", stream.time[kept], channels)}, {})
    found = alarm_numbers(holed)
    assert found.alarms == ()
    assert [s.state for s in found.states] == ["READY", "THERAPY"]


def _slow(recording, averaged):
    """Return the recording once a second: its samples, or the means of its seconds."""
    stream = recording.streams["device"]
    n = stream.time.size // 20
    pick = (lambda v: v[: n * 20].reshape(n, 20).mean(axis=1)) if averaged else (lambda v: v[19 : n * 20 : 20])
    channels = {name: type(c)(name, pick(c.values), c.unit) for name, c in stream.channels.items()}
    return type(recording)("run", {"device": type(stream)("device", stream.time[19 : n * 20 : 20], channels)}, {})


def test_means_of_seconds_are_enough_and_aliased_samples_are_not():
    recording = device(1500.0, factors=[("return", 2.5, 900.0, 940.0)], skew=0.01)
    assert _codes(_slow(recording, averaged=True)) == ["RETURN_OCCLUDED"]
    found = alarm_numbers(_slow(recording, averaged=False))
    assert all("OCCLUDED" not in alarm.code and "DISCONNECTED" not in alarm.code for alarm in found.alarms)
    assert any("20 Hz" in problem.message for problem in found.problems)


def test_the_alarm_of_the_return_line_says_that_clotting_looks_alike():
    alarm = alarm_numbers(device(factors=[("return", 2.5, 200.0, 240.0)])).alarms[0]
    assert "occlusion and clotting look alike" in alarm.cause


def test_bubbles_in_a_train_are_one_alarm_and_a_flag_of_other_numbers_is_none():
    train = flag("air_detected", (200.0, 200.2), (201.0, 201.3), (203.0, 203.1), (300.0, 301.0))
    assert _codes(device(tables={"flags": train})) == ["AIR", "AIR"]
    odd = flag("air_detected", (200.0, 210.0))
    odd.channels["air_detected"].values[:] *= 3.3
    found = alarm_numbers(device(tables={"flags": odd}))
    assert found.alarms == ()
    assert any("is 0 or 1" in problem.message for problem in found.problems)


def test_a_reading_that_stands_still_raises_no_alarm_of_its_line():
    stuck = with_channel(device(), "pressure_return_rap", lambda t, v: np.where((t > 200.0) & (t < 300.0), v[4000], v))
    found = alarm_numbers(stuck)
    assert {alarm.code for alarm in found.alarms} == {"SENSOR_MISMATCH"}
    assert any("stands still from 200 to 300 s" in problem.message for problem in found.problems)
