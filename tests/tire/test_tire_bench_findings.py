"""tire.bench on its synthetic campaign: names and units of the sheet, truth within the intervals, a report of what was found."""

import numpy as np
import pytest
from bench_campaigns import findings, identified, logs

from pipeline.rigs.tire.bench.declaration import BENCH
from pipeline.rigs.tire.synthetic.rig import synthesize_bench

TRUTH = {
    "rolling_radius": (0.3171, 1e-3), "bending_stiffness": (6.0, 0.01), "foundation_radial": (6e5, 0.01), "foundation_tangential": (2e5, 0.02),
    "tread_stiffness": (1.2e8, 0.02), "loss_factor": (0.08, 0.02), "sensor_gain": (5000.0, 0.01), "sensor_lag": (1e-3, 0.02), "belt_width": (0.21, 0.01),
    "pvdf_gain": (2.4e-4, 0.02), "pvdf_time_constant": (2e-3, 0.02), "pvdf_offset_angle": (0.02, 0.02),
}  # fmt: skip
UNITS = {
    "rolling_radius": "m", "bending_stiffness": "N m^2", "belt_width": "m", "foundation_radial": "N/m^2", "foundation_tangential": "N/m^2",
    "tread_stiffness": "N/m^2", "loss_factor": "1", "sensor_gain": "ohm m", "sensor_lag": "s", "sensor_resistance": "ohm", "contact_length": "m",
    "deformation_length": "m", "slope_length": "m", "zero_length": "m", "peak_resistance": "ohm", "dip_leading": "ohm", "dip_trailing": "ohm",
    "load_sensitivity": "V/N", "calibration_0": "ohm", "calibration_1": "ohm/N", "calibration_2": "ohm/N^2", "pvdf_gain": "V/ohm",
    "pvdf_time_constant": "s", "pvdf_offset_angle": "rad", "pvdf_nrmse": "1", "packet_loss": "1",
}  # fmt: skip
# Load (N): Lc, Ld, L_slope, L_zero of the truth (tire.md, 3.5), m.
LENGTHS = {
    1000.0: (0.0350, 0.2008, 0.0531, 0.1038), 2000.0: (0.0491, 0.2041, 0.0557, 0.1071), 3000.0: (0.0625, 0.2082, 0.0593, 0.1113),
}  # fmt: skip


def test_every_name_of_the_sheet_stands_with_its_unit_and_operating_point():
    by_name = {}
    for p in findings().parameters:
        by_name.setdefault(p.name, []).append(p)
    assert set(by_name) == set(UNITS)
    for name, unit in UNITS.items():
        assert {p.unit for p in by_name[name]} == {unit}
    for name in ("contact_length", "deformation_length", "slope_length", "zero_length"):
        assert all(set(p.at) == {"load", "speed"} for p in by_name[name])
        assert len(by_name[name]) == 7
    for name in ("sensor_resistance", "peak_resistance", "dip_leading", "dip_trailing", "pvdf_nrmse", "packet_loss"):
        assert [p.at for p in by_name[name]] == [{"run": log.run} for log in logs()]


@pytest.mark.parametrize("name", TRUTH)
def test_the_truth_is_found_as_closely_as_the_sheet_asks(name):
    value, share = TRUTH[name]
    assert findings().one(name).value == pytest.approx(value, rel=share)


def test_the_intervals_hold_the_truth():
    """Of twelve numbers one or two may lie outside of 95 %, none far outside: chance is 2 % for three, 1e-3 for one of 4 sd."""
    rows = [(findings().one(name), value) for name, (value, _) in TRUTH.items()]
    outside = [p.name for p, value in rows if not p.ci95[0] < value < p.ci95[1]]
    assert len(outside) <= 2, outside
    assert all(abs(p.value - value) < 4.0 * p.std_error for p, value in rows)


@pytest.mark.parametrize("load", LENGTHS)
def test_contact_length_and_the_lengths_that_are_none_are_told_apart(load):
    at = {"load": load, "speed": pytest.approx(10.0 / 3.6)}
    names = ("contact_length", "deformation_length", "slope_length", "zero_length")
    for name, value in zip(names, LENGTHS[load], strict=True):
        p = next(p for p in findings().find(name, load=load) if p.at["speed"] == at["speed"])
        assert p.value == pytest.approx(value, abs=1e-3 if name != "deformation_length" else 2e-3)


def test_the_calibration_reads_every_load_back_within_its_interval():
    table = findings().arrays["calibration"]
    used = table[table["used"]]
    assert len(used) == 5
    assert (np.abs(used["read_load"] - used["load"]) < 15.0).all()
    assert ((used["read_low"] < used["load"]) & (used["load"] < used["read_high"])).all()
    assert findings().one("load_sensitivity").value == pytest.approx(70e-3 / 490.33, rel=0.03)


def test_a_sound_campaign_is_ok_and_says_what_to_measure_next():
    found = findings()
    assert found.verdict == "ok", found.reasons
    assert any("hub" in one for one in found.advice)
    assert any("pressure" in one for one in found.advice)
    assert all(run.used for run in found.runs)


def test_what_the_road_carries_on_stands_in_the_tables():
    arrays = findings().arrays
    covariance = arrays["ring_covariance"]
    names = list(covariance["parameter"])
    C = covariance[names].to_numpy()
    assert np.allclose(C, C.T)
    assert np.linalg.eigvalsh(C / np.sqrt(np.outer(np.diag(C), np.diag(C)))).min() > -1e-6
    assert {"bending_stiffness", "sensor_gain", "sensor_lag", "sensor_length"} <= set(names)
    assert set(arrays["type_b"]["source"]) >= {"pressure", "load_gain"}
    assert bool(arrays["fit"]["model_fits"].iloc[0])
    assert arrays["fit"]["Ro"].iloc[0] == pytest.approx(0.3266, abs=1e-5)
    assert arrays["calibration_covariance"].shape == (3, 4)


def test_the_report_shows_every_chapter_and_the_sentence_on_the_lengths():
    chapters = {section.name: section for section in BENCH.sections(findings())}
    assert set(chapters) == {
        "waveforms",
        "lengths",
        "calibration",
        "speed",
        "ring",
        "film",
        "revolutions",
        "data",
        "energy",
    }
    assert "never to be confused" in chapters["lengths"].blocks[0].paragraphs[0]
    assert "70.0 %" in chapters["energy"].blocks[0].paragraphs[0]
    assert len(BENCH.methods(findings())) >= 5


@pytest.mark.thorough
def test_another_tire_circuit_and_rate_are_found_as_well():
    truth = {
        "loads": [1500, 2200, 3000, 3800, 4500], "tire_size": "205/55R16", "R": 0.3071, "Ro": 0.3159, "flex_length": 0.04, "b": 0.18,
        "inflation_pressure": 2.5e5, "kt": 1.0e8, "rate": 10e3, "supply_voltage": 5.0, "adc_reference": 5.0, "divider_resistance": 1.5e4,
        "R0": 1.2e4, "c": 4000.0, "duration": 10.0, "as_voltage": True, "hub_height": True,
    }  # fmt: skip
    found = identified(synthesize_bench(truth, 5))
    for name, value in {
        "rolling_radius": 0.3071,
        "bending_stiffness": 6.0,
        "belt_width": 0.18,
        "tread_stiffness": 1e8,
        "sensor_gain": 4000.0,
    }.items():
        p = found.one(name)
        assert p.value == pytest.approx(value, rel=0.02)
        assert abs(p.value - value) < 3.0 * p.std_error
    for name in ("loss_factor", "sensor_lag"):
        p = found.one(name)
        assert p.value is None
        assert "speed" in p.description
    assert found.verdict == "warning"
