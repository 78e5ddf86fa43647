"""Faults of section 8 that concern the flow: each is named, doubted or refused, and none gives a wrong number as a good one."""

from dataclasses import replace

import numpy as np
import pytest
from flow_logs import ML_MIN, identified, logs, of_the_usual, slowed, told, touched, usual, warnings, without

from pipeline.errors import InputError
from pipeline.recording import Channel, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.flow.check import check
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.identify import identify
from pipeline.rigs.rap.synthetic.rig import synthesize_therapy

COEFFICIENTS = ("stroke_volume", "y0", "y1", "stroke_volume_mean", "pump_compliance")
UF = 5.0 * ML_MIN
VAL = "rap_flow_val"


def same_as_usual(found, names=COEFFICIENTS):
    """Tell whether the coefficients are within an error of those of the logs without fault."""
    return all(
        abs(found.one(name).value - of_the_usual().one(name).value) < of_the_usual().one(name).std_error
        for name in names
    )


def test_a_meter_on_the_return_line_is_corrected_by_the_uf_rate():
    found = identified(logs(flowmeter_location="return", uf_flow=UF))
    assert found.verdict == "ok"
    assert found.one("stroke_volume_mean").value == pytest.approx(1.004 * 0.8e-6, rel=0.003)
    assert "UF rate" in found.one("stroke_volume_mean").description


def test_an_unknown_line_with_uf_on_is_refused_and_explained():
    found = identified(logs(flowmeter_location="return", uf_flow=UF, told={"flowmeter_location": None}))
    assert found.verdict == "rejected"
    assert all(found.one(name).value is None for name in COEFFICIENTS)
    assert "less the UF rate" in found.one("stroke_volume").description
    assert any("flowmeter_location" in text for text in found.advice)


def test_an_unknown_line_does_not_matter_with_uf_off_but_is_told():
    found = identified(told(usual(), {"flowmeter_location": None}))
    assert same_as_usual(found)
    assert "mandatory" in warnings(found)
    assert any("flowmeter_location is not stated" in reason for reason in found.reasons)


def test_a_line_that_some_runs_do_not_state_costs_their_windows_with_uf_on_only():
    silent = told(logs(["holdout"], uf_flow=UF), {"flowmeter_location": None})
    found = identified([*logs(["calibration"], uf_flow=UF), *silent])
    assert found.one("stroke_volume").value is not None
    assert "not stated for rap_flow_val" in warnings(found)
    assert found.one("flow_error_max", estimator="E3", set="holdout").value is None


def test_the_line_is_told_by_switching_uf():
    on = [replace(r, run=f"{r.run}_uf") for r in logs(["calibration"], seed=2, flowmeter_location="return", uf_flow=UF)]
    both = told([*logs(["calibration"], flowmeter_location="return"), *on], {"flowmeter_location": None})
    found = identified(both)
    assert "the logs themselves say return" in warnings(found)
    assert found.one("stroke_volume_mean").value == pytest.approx(1.004 * 0.8e-6, rel=0.003)
    wrong = identified(told(both, {"flowmeter_location": "access"}))
    assert "meter reads Q_b - Q_uf" in warnings(wrong)
    assert wrong.one("stroke_volume_mean").value == pytest.approx(1.004 * 0.8e-6, rel=0.003)


def test_air_in_the_circuit_spoils_e2_and_not_e3_and_is_told():
    found = identified(logs(faults=[{"kind": "air_bubble", "run": VAL}]))
    assert found.one("flow_error_max", estimator="E2", set="holdout").value > 0.1
    assert found.one("flow_error_max", estimator="E3", set="holdout").value < 0.006
    assert "compliance changed" in warnings(found, VAL)
    for flow_set in (60.0, 80.0, 100.0):
        assert found.one("flow", run=VAL, flow_set=flow_set * ML_MIN, estimator="E2").value is None
        assert found.one("flow", run=VAL, flow_set=flow_set * ML_MIN, estimator="E3").value is not None


def test_air_is_told_without_a_meter_too():
    runs = without(logs(faults=[{"kind": "air_bubble", "run": VAL}]), "blood_flow_bench", run=VAL)
    found = identified(runs)
    assert "E2 and E3 disagree" in warnings(found, VAL)
    assert found.one("flow", run=VAL, flow_set=100.0 * ML_MIN, estimator="E2").value is None


def test_another_filter_is_told_from_air():
    found = identified([*logs(["calibration"]), *logs(["holdout"], R_r=2.8e9, R_f=1.8e9)])
    assert "resistances differ" in warnings(found, VAL)
    assert found.one("flow_error_max", estimator="E3", set="holdout").value < 0.006


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"faults": [{"kind": "air_bubble", "run": VAL}]}, "compliance changed"),
        ({"R_r": 2.8e9, "R_f": 1.8e9}, "resistances differ"),
    ],
)
def test_air_and_another_filter_are_told_where_e2_is_not_calibrated(spoilt, words):
    calibration = logs(["calibration"], calibration_clamps=[1.0])
    found = identified([*calibration, *logs(["holdout"], **spoilt)])
    assert found.one("stroke_volume").value is None
    assert words in warnings(found, VAL)
    assert not warnings(identified([*calibration, usual()[1]]), VAL)


def test_air_takes_e2_s_flow_away_where_neither_e3_nor_a_meter_is_there_to_contradict():
    runs = without(logs(faults=[{"kind": "air_bubble", "run": VAL}]), "pressure_access_rap")
    found = identified(without(runs, "blood_flow_bench", run=VAL))
    p = found.one("flow", run=VAL, flow_set=80.0 * ML_MIN, estimator="E2")
    assert p.value is None
    assert "compliance changed" in p.description


@pytest.mark.thorough
def test_wear_is_told_as_a_drift_against_the_meter():
    """V_g falls by 3 % in 5 h, 0.9 % in 1.5 h: a stroke of 0.68 mL then loses 1.2 %."""
    therapy = synthesize_therapy({"runs": ["rap_therapy_312"], "duration": 5400.0}, 1)
    found = identified([*logs(["calibration"]), *told(therapy, {"set": "holdout"})])
    assert "drifts against the meter" in warnings(found, "rap_therapy_312")
    assert 0.009 < found.one("flow_error_max", estimator="E3", set="holdout").value < 0.018


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("swapped", "exchanged"),
        ("sign", "access must be negative"),
        ("mmhg", "mmHg"),
        ("kpa", "kPa"),
        ("unit", "as mL/min it would fit"),
    ],
)
def test_channels_that_are_not_what_they_are_called_are_refused(fault, words):
    runs = logs(["calibration"], faults=[fault])
    with pytest.raises(InputError, match=words):
        identified(runs)
    assert any(words in finding.message and finding.level == "error" for finding in check(runs[0]))


def test_a_frozen_access_sensor_costs_e3_only():
    found = identified(logs(faults=[{"kind": "stuck", "channel": "pressure_access_rap"}]))
    assert found.one("pump_compliance").value is None
    assert same_as_usual(found, ("stroke_volume", "y0", "y1"))
    assert "channel frozen" in warnings(found)


def test_a_frozen_meter_is_not_believed():
    found = identified(logs(faults=[{"kind": "stuck", "channel": "blood_flow_bench", "run": VAL}]))
    assert "channel frozen" in warnings(found, VAL)
    assert found.one("flow_error_max", estimator="E3", set="holdout").value < 0.01


@pytest.mark.thorough
def test_a_calibration_run_whose_meter_contradicts_the_others_is_named_and_not_calibrated_on():
    runs = logs(["calibration"], split=True)
    found = identified([*touched(runs, "blood_flow_bench", lambda _t, v: 0.6 * v, run=runs[1].run), usual()[1]])
    assert "it is not calibrated on" in warnings(found, runs[1].run)
    assert same_as_usual(found, ("stroke_volume_mean", "pump_compliance"))
    assert "not calibrated on" not in warnings(identified([*runs, usual()[1]]))


def test_a_meter_that_reads_a_flow_while_the_pump_stands_gives_no_zero():
    found = identified(touched(usual(), "blood_flow_bench", lambda _t, v: 0.0 * v + 80.0 * ML_MIN))
    assert "while the pump stands" not in warnings(found)
    assert "No zero is taken from it" in warnings(found)
    assert found.verdict == "rejected"


def test_a_meter_that_is_not_zero_at_rest_is_zeroed_and_told():
    found = identified(touched(usual(), "blood_flow_bench", lambda _t, v: v + 2.0 * ML_MIN))
    assert "while the pump stands" in warnings(found)
    assert found.one("stroke_volume_mean").value == pytest.approx(1.004 * 0.8e-6, rel=0.003)


def test_a_meter_far_from_what_is_set_is_doubted():
    found = identified(touched(usual(), "blood_flow_bench", lambda _t, v: 0.45 * v))
    assert found.verdict != "ok"
    assert "times the set-point" in warnings(found)


def test_the_encoder_is_a_cross_check():
    runs = logs(["calibration"], pump_encoder=True)
    assert "blood_pump_speed" not in warnings(identified(runs))
    turns = touched(runs, "blood_pump_speed", lambda _t, v: v / 3.0)
    assert "counts turns of the rotor" in warnings(identified(turns))


def test_slow_pressures_are_refused_without_an_encoder_and_give_e3_with_one():
    with pytest.raises(InputError, match="8 Hz or more"):
        identified(slowed(usual(), 20))
    found = identified(slowed(logs(pump_encoder=True), 20))
    assert found.one("stroke_volume").value is None
    assert found.one("pump_compliance").value == pytest.approx(2.207e-11, rel=0.04)


def test_without_a_meter_nothing_is_calibrated():
    found = identified(without(usual(), "blood_flow_bench"))
    assert found.verdict == "rejected"
    assert "blood_flow_bench" in found.one("stroke_volume").description


def test_without_pressures_on_the_bench_the_meter_s_steps_align_the_clocks():
    names = [f"pressure_{tap}_bench" for tap in ("access", "prefilter", "return", "uf")]
    found = identified(without(usual(), *names))
    assert same_as_usual(found)


def test_one_table_with_one_clock_needs_no_alignment():
    def joined(recording):
        device, bench = recording.streams["device"], recording.streams["bench"]
        read = np.interp(device.time + 3.38, bench.time, bench.channels["blood_flow_bench"].values)
        meter = {"blood_flow_bench": Channel("blood_flow_bench", read, "m^3/s")}
        log = Stream("device", device.time, {**device.channels, **meter})
        others = {name: stream for name, stream in recording.streams.items() if name not in ("device", "bench")}
        return replace(recording, streams={"device": log, **others})

    found = identified([joined(recording) for recording in usual()])
    assert same_as_usual(found)


@pytest.mark.parametrize("fault", ["dropout", "duplicated", "truncated"])
@pytest.mark.thorough
def test_lost_samples_cost_little(fault):
    found = identified(logs(faults=[fault]))
    assert found.one("flow_error_max", estimator="E3", set="holdout").value < 0.01
    assert found.one("pump_compliance").value == pytest.approx(2.207e-11, rel=0.02)


@pytest.mark.parametrize(
    ("condition", "words"), [("set", "calibration or holdout"), ("flowmeter_location", "access or return")]
)
def test_words_that_are_none_of_the_known_are_refused(condition, words):
    with pytest.raises(InputError, match=words):
        identified(told(usual(), {condition: "elsewhere"}))


def test_a_pump_that_never_turns_is_refused():
    rng = np.random.default_rng(1)
    still = list(usual())
    for tap, level in (("access", -60.0), ("prefilter", 80.0), ("return", 40.0)):
        still = touched(still, f"pressure_{tap}_rap", lambda t, _v, a=level: a + rng.normal(0.0, 25.0, t.size))
    with pytest.raises(InputError, match="the pump never turns"):
        identified(still)


def test_spikes_are_named_and_cost_little():
    def spiky(_t, values):
        hit = np.random.default_rng(3).random(values.size) < 0.01
        return np.where(hit, values + 20e3, values)

    runs = usual()
    for tap in ("access", "prefilter", "return"):
        runs = touched(runs, f"pressure_{tap}_rap", spiky)
    found = identified(runs)
    assert "lone spikes" in warnings(found)
    assert same_as_usual(found)


def test_a_check_tells_of_a_missing_line_and_a_missing_meter():
    run = usual()[0]
    assert not [finding for finding in check(run) if finding.level != "note"]
    assert any("mandatory" in finding.message for finding in check(told([run], {"flowmeter_location": None})[0]))
    assert any("no blood_flow_bench" in finding.message for finding in check(without([run], "blood_flow_bench")[0]))


def test_runs_may_have_their_meters_on_different_lines():
    """Inlet and outlet flow of the synthetic pump differ by up to 0.3 % behind a clamp: its back suction pulsates with the pressure."""
    found = identified(
        [*logs(["calibration"], uf_flow=UF), *logs(["holdout"], flowmeter_location="return", uf_flow=UF)]
    )
    assert found.verdict == "ok"
    assert found.one("flow_error_max", estimator="E3", set="holdout").value < 0.009


def test_a_pump_faster_than_looked_for_is_told_and_can_be_looked_for():
    runs = logs(["calibration"], flows=[1.5e-6, 1.9e-6, 2.3e-6])
    assert "no window at" in warnings(identified(runs))
    wider = identify(list(runs), FlowSettings(fastest=5.0), Context("test", {}))
    assert "no window at" not in warnings(wider)
    assert wider.one("pump_compliance").value == pytest.approx(2.207e-11, rel=0.02)
