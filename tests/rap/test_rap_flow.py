"""`rap.flow` on the synthetic rig: coefficients, errors on calibration and hold-out, what cannot be determined (rap.md, 5.3, 6)."""

import math

import numpy as np
import pytest
from flow_logs import ML_MIN, identified, logs, of_the_usual, told, touched, usual, warnings, without

from pipeline.rigs.rap.circuit.hydraulics import Circuit, outlet_impedance
from pipeline.rigs.rap.circuit.pump import fundamental
from pipeline.rigs.rap.flow.estimators import (
    affine_columns,
    pressure_columns,
    pressure_flow,
    pulsation_columns,
    pulsation_flow,
    quadratic_columns,
    stroke_flow,
)
from pipeline.rigs.rap.flow.methods import methods
from pipeline.rigs.rap.flow.sections import sections

COEFFICIENTS = ("stroke_volume", "y0", "y1", "stroke_volume_mean", "pump_compliance")
METER_GAIN = 1.004


def admittance(f, pole=0.030, gain=1.015):
    """Return what a pascal read by the pre-filter sensor stands for at f (Hz), with the meter's gain, m^3/(s Pa)."""
    Z = abs(outlet_impedance(Circuit(), 2j * math.pi * f))
    return METER_GAIN / (2.0 * fundamental(0.35) * Z) * math.hypot(1.0, 2.0 * math.pi * f * pole) / gain


def test_columns_times_coefficients_are_the_estimators():
    f, A_1, P = np.array([1.4, 2.0, 2.6]), np.array([700.0, 800.0, 900.0]), np.array([4e3, 5e3, 9e3])
    assert pulsation_columns(f, A_1) @ [0.9e-6, 5e-10, 3e-10] == pytest.approx(
        pulsation_flow(f, A_1, 0.9e-6, 5e-10, 3e-10)
    )
    assert pressure_columns(f, P) @ [0.8e-6, 2e-11] == pytest.approx(pressure_flow(f, P, 0.8e-6, 2e-11))
    assert quadratic_columns(f, A_1)[:, :3] == pytest.approx(pulsation_columns(f, A_1))
    assert affine_columns(f) @ [2.0, 1.0] == pytest.approx(2.0 * f + 1.0)
    assert stroke_flow(f, 0.7e-6) == pytest.approx(0.7e-6 * f)


def test_coefficients_of_both_estimators_are_recovered():
    found = of_the_usual()
    truth = {
        "stroke_volume": METER_GAIN * 0.9e-6, "y0": admittance(2.0), "y1": (admittance(2.56) - admittance(1.41)) / 1.15,
        "stroke_volume_mean": METER_GAIN * 0.8e-6, "pump_compliance": METER_GAIN * 2.23e-11 / 1.0145,
    }  # fmt: skip
    within = {"stroke_volume": 0.01, "y0": 0.02, "y1": 0.03, "stroke_volume_mean": 0.002, "pump_compliance": 0.005}
    for name, true in truth.items():
        p = found.one(name)
        assert p.value == pytest.approx(true, rel=within[name]), name
        assert p.ci95[0] < true < p.ci95[1], name


def test_errors_on_the_hold_out_are_those_of_the_sheet():
    found = of_the_usual()
    largest = {e: found.one("flow_error_max", estimator=e, set="holdout").value for e in ("E0", "E1", "E2", "E3")}
    assert largest["E0"] == pytest.approx(0.380, abs=0.02)
    assert largest["E1"] == pytest.approx(0.165, abs=0.02)
    assert largest["E2"] < 0.022
    assert largest["E3"] < 0.005
    for estimator in largest:
        rms = found.one("flow_error_rms", estimator=estimator, set="holdout").value
        assert 0.0 < rms < largest[estimator]


def test_strokes_alone_with_the_line_open_are_as_wrong_as_the_paper():
    found = of_the_usual()
    row = next(p for p in found.published if p.name.startswith("worst error of E0"))
    assert row.found == pytest.approx(0.0912, abs=0.006)
    assert row.agrees is None
    alone = [p for p in found.published if p.basis == "paper"]
    assert any("5.47 / 7.30 / 9.12" in str(p.found) for p in alone)
    assert any("8.33 / 6.25 / 5.00" in str(p.found) for p in alone)


def test_a_left_out_set_point_is_predicted_by_e3_and_not_so_well_by_e2():
    left = of_the_usual().arrays["left_out"]
    worst = left.groupby("estimator")["worst"].max()
    assert worst["E3"] < 0.006
    assert 0.02 < worst["E2"] < 0.07
    assert worst["E2 quadratic"] > 0.05


def test_unclamped_set_points_alone_tell_nothing():
    trap = of_the_usual().arrays["trap"].set_index("law")
    assert trap.loc["E2", "inside"] < 0.015
    assert trap.loc["E2", "outside"] > 0.3
    assert trap.loc["affine", "inside"] < 0.02
    assert trap.loc["affine", "outside"] > 0.2
    assert trap.loc["E3", "outside"] < 0.02


def test_flow_is_told_for_each_run_set_point_and_estimator_and_covers_the_meter():
    found = of_the_usual()
    for run in ("rap_flow_cal", "rap_flow_val"):
        for flow_set in (60.0, 80.0, 100.0):
            for estimator in ("E2", "E3"):
                p = found.one("flow", run=run, flow_set=flow_set * ML_MIN, estimator=estimator)
                rows = found.arrays["flows"]
                metered = rows[
                    (rows["run"] == run)
                    & np.isclose(rows["flow_set"], flow_set * ML_MIN)
                    & (rows["estimator"] == estimator)
                ]["metered"].iloc[0]
                assert p.ci95[0] < metered < p.ci95[1]


def test_a_good_campaign_is_ok_and_its_report_and_methods_are_written():
    found = of_the_usual()
    assert found.verdict == "ok"
    names = [chapter.name for chapter in sections(found)]
    assert names == ["errors", "calibration", "left_out", "trap", "set_points", "windows", "runs"]
    assert len(methods(found)) == 4
    slower = found.model_copy(update={"settings": {**found.settings, "slowest": 0.55}})
    assert "between 0.55 and 3.5 Hz" in methods(slower)[0]


def test_the_meter_s_gain_enters_as_type_b():
    sure = identified(told(usual(), {"flowmeter_gain_u": 0.0})).one("stroke_volume_mean")
    doubted = identified(told(usual(), {"flowmeter_gain_u": 0.03})).one("stroke_volume_mean")
    assert sure.std_error < 0.002 * sure.value
    assert doubted.std_error == pytest.approx(0.03 * doubted.value, rel=0.02)
    assert "type B" in doubted.description


def test_e2_is_refused_on_unclamped_set_points():
    found = identified(logs(calibration_clamps=[1.0]))
    for name in ("stroke_volume", "y0", "y1"):
        p = found.one(name)
        assert p.value is None
        assert "clamped" in p.description
    assert found.one("stroke_volume_mean").value is not None
    assert found.verdict == "warning"
    assert any("2, 4 and 6 times" in text for text in found.advice)
    assert found.one("flow_error_max", estimator="E2", set="holdout").value is None


def test_one_speed_does_not_determine_e2():
    found = identified(logs(flows=[80.0 * ML_MIN]))
    assert found.one("y1").value is None
    assert found.one("pump_compliance").value == pytest.approx(2.207e-11, rel=0.02)


def test_one_operating_point_determines_nothing():
    found = identified(logs(["calibration"], flows=[80.0 * ML_MIN], calibration_clamps=[1.0]))
    assert found.verdict == "rejected"
    assert all(found.one(name).value is None for name in COEFFICIENTS)


def test_settings_of_the_clamp_may_be_runs_or_events():
    split = identified(logs(split=True))
    for name in COEFFICIENTS:
        a, b = split.one(name), of_the_usual().one(name)
        assert a.value == pytest.approx(b.value, abs=1.5 * b.std_error)


def test_held_out_tubes_are_told_apart_by_a_key_of_their_own_where_there_are_several():
    found = identified(logs(["calibration", "holdout", "tube"]))
    own = found.one("flow_error_max", estimator="E3", set="holdout", tube_set_id="A").value
    other = found.one("flow_error_max", estimator="E3", set="holdout", tube_set_id="B").value
    assert own < 0.005
    assert other == pytest.approx(0.037, abs=0.008)
    assert any("tube (B) is another" in q.message for q in found.quality)
    errors = found.find("flow_error_max") + found.find("flow_error_rms")
    assert {p.at["set"] for p in errors} == {"calibration", "holdout"}
    assert all(("tube_set_id" in p.at) == (p.at["set"] == "holdout") for p in errors)
    assert any("hold-out, tube B" in reason for reason in found.reasons)


def test_the_flow_through_another_tube_holds_what_its_volume_may_differ_by():
    both = logs(["calibration", "tube"])
    metered = identified(both).arrays["flows"].set_index(["run", "estimator", "flow_set"])["metered"]
    found = identified(without(both, "blood_flow_bench", run="rap_flow_val_tube"))
    told_flows = found.find("flow", run="rap_flow_val_tube")
    assert len(told_flows) == 6
    for p in told_flows:
        assert p.ci95[0] < metered["rap_flow_val_tube", p.at["estimator"], p.at["flow_set"]] < p.ci95[1]
        assert "tube was not calibrated" in p.description


def test_the_width_of_e2_s_intervals_is_said_to_be_misfit_and_not_noise():
    found = of_the_usual()
    assert "what the law misses between set-points" in found.one("y1").description
    assert "misses" not in found.one("pump_compliance").description


def test_a_hold_out_of_one_tube_needs_no_further_key():
    found = identified(logs(["calibration", "tube"]))
    p = found.one("flow_error_max", estimator="E3", set="holdout")
    assert p.at == {"estimator": "E3", "set": "holdout"}
    assert p.value == pytest.approx(0.037, abs=0.008)
    assert any("tube (B) is another" in q.message for q in found.quality)


def test_a_tube_that_nobody_states_is_suspected():
    runs = [*usual(), *(r for r in logs(["tube"]))]
    found = identified(told(runs, {"tube_set_id": None}))
    assert "stroke holds 2.9 % less" in warnings(found, "rap_flow_val_tube") or "stroke holds" in warnings(found)
    assert found.verdict == "warning"


def test_a_run_without_a_set_is_estimated_only():
    runs = [r if r.run != "rap_flow_val" else told([r], {"set": None})[0] for r in usual()]
    found = identified(runs)
    assert found.find("flow", run="rap_flow_val", estimator="E3")
    assert found.one("flow_error_max", estimator="E3", set="holdout").value is None


def test_without_any_set_all_runs_calibrate_and_that_is_told():
    found = identified(told(usual(), {"set": None}))
    assert "no run states the condition 'set'" in warnings(found)
    assert found.one("pump_compliance").value is not None


def test_set_points_that_are_not_logged_are_found():
    found = identified(without(usual(), "blood_flow_set"))
    assert found.one("pump_compliance").value == pytest.approx(2.207e-11, rel=0.01)
    assert len({p.at["flow_set"] for p in found.find("flow", run="rap_flow_cal", estimator="E3")}) == 3


def test_the_device_s_own_estimate_is_judged_where_it_is_logged():
    found = of_the_usual()
    assert found.one("flow_error_max", estimator="rap", set="holdout").value > 0.2
    gone = identified(without(usual(), "blood_flow_rap"))
    assert not gone.find("flow_error_max", estimator="rap")


def test_a_zero_of_the_sensors_does_not_matter_where_the_pump_stops():
    moved = touched(usual(), "pressure_prefilter_rap", lambda _t, v: v + 300.0)
    a, b = identified(moved).one("stroke_volume_mean"), of_the_usual().one("stroke_volume_mean")
    assert a.value == pytest.approx(b.value, rel=2e-4)


def test_without_a_stop_the_zero_is_uncertain_and_said_so():
    found = identified(logs(zero_time=0.5, stop_time=0.5))
    p = found.one("stroke_volume_mean")
    assert "zero of the pressures unknown" in p.description
    assert p.ci95[0] < METER_GAIN * 0.8e-6 < p.ci95[1]
    assert "zero" in warnings(found)


@pytest.mark.parametrize("rate", [10.0, 50.0])
def test_other_sampling_rates_give_the_same(rate):
    found = identified(logs(device_rate=rate, bench_rate=rate))
    for name in COEFFICIENTS:
        usual_one = of_the_usual().one(name)
        assert found.one(name).value == pytest.approx(usual_one.value, abs=2.0 * usual_one.std_error)
    assert found.one("flow_error_max", estimator="E3", set="holdout").value < 0.006
