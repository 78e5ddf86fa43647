"""What a drive takes of a bench campaign: checked, corrected, or withheld with the reason."""

from __future__ import annotations

import math

import numpy as np
import pytest
from road_bench import CONDITIONS, TRUTH, VALUES, bench

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.rigs.tire.road.carried_errors import covariance
from pipeline.rigs.tire.road.handed_over import Carried, carried, chosen
from pipeline.rigs.tire.road.library import UNKNOWNS


def held(*, given: Findings | None = None, **changed: float | str | None) -> Carried:
    """Return what of the bench holds for a drive that states other conditions."""
    told = {name: value for name, value in {**CONDITIONS, **changed}.items() if value is not None}
    return carried(chosen({"b": given or bench()}), "road", told)


def said(found: Carried, level: str = "warning") -> str:
    return " ".join(q.message for q in found.findings if q.level == level)


def test_the_same_tire_is_carried_over_without_a_word():
    found = held()
    assert found.tire is not None
    assert not found.findings
    assert found.tire.ring.p0b == pytest.approx(TRUTH.inflation_pressure * TRUTH.b)
    assert found.tire.Ro == pytest.approx(0.3266)
    assert found.radius.value == TRUTH.R


def test_without_any_bench_the_speed_is_nominal_and_forces_have_a_reason():
    found = carried(chosen({}), "road", CONDITIONS)
    assert found.tire is None
    assert "no bench campaign" in found.reason
    assert found.radius.value == pytest.approx(0.3171, rel=1e-3)
    assert found.radius.std_error == pytest.approx(0.0032, rel=0.02)
    assert "nominal" in found.radius.source


def test_without_bench_and_tire_size_there_is_no_speed():
    found = carried(chosen({}), "road", {})
    assert math.isnan(found.radius.value)


def test_a_rejected_bench_gives_no_forces():
    found = held(given=bench(verdict="rejected"))
    assert found.tire is None
    assert "rejected (told)" in found.reason


@pytest.mark.parametrize("name", ["sensor_gain", "foundation_tangential", "loss_factor"])
def test_what_the_bench_does_not_determine_is_named_with_its_reason(name: str):
    found = held(given=bench(nulls={name: "one load only"}))
    assert found.tire is None
    assert name in found.reason
    assert "one load only" in found.reason


def test_findings_of_another_experiment_are_named_and_not_used():
    other = bench().model_copy(update={"experiment": "tire.road"})
    choice = chosen({"o": other, "b": bench()})
    assert choice.bench is not None
    assert choice.bench.campaign == "b"
    assert any("'o' (tire.road) are not used" in q.message for q in choice.findings)


def test_the_first_whole_bench_of_several_is_used():
    choice = chosen({"a": bench(nulls={"sensor_gain": "no load cell"}), "b": bench(), "c": bench()})
    assert choice.bench is not None
    assert choice.bench.campaign == "b"
    assert sum("is not used" in q.message for q in choice.findings) == 2


def test_a_bench_with_a_warning_hands_it_on():
    choice = chosen({"b": bench(verdict="warning")})
    assert [q.level for q in choice.findings] == ["warning"]
    assert "carries a warning: told" in choice.findings[0].message


def test_another_tire_size_withholds_everything_of_the_bench():
    found = held(tire_size="205/55R16")
    assert found.tire is None
    assert "205/55R16" in found.reason
    assert "245/40R18" in found.reason
    assert found.radius.value == pytest.approx(3.05 * 0.6319 / (2 * math.pi), rel=1e-3)


@pytest.mark.parametrize("size", ["245/40 ZR18 97Y", "P245/40R18"])
def test_the_same_size_written_otherwise_is_the_same_tire(size: str):
    assert held(tire_size=size).tire is not None


def test_no_tire_size_in_the_drive_is_the_benchs_and_told():
    found = held(tire_size=None)
    assert found.tire is not None
    assert "taken to be the bench's" in said(found, "note")


def test_a_tire_size_that_is_none_is_refused():
    with pytest.raises(InputError, match="no tire size"):
        held(tire_size="wide")


def test_ten_percent_less_pressure_is_told_and_corrected_by_the_tension():
    found = held(inflation_pressure=0.9 * TRUTH.inflation_pressure)
    assert found.tire is not None
    assert found.tire.ring.p0b == pytest.approx(0.9 * TRUTH.inflation_pressure * TRUTH.b)
    assert "calibration was made at p0 = 2.2 bar, now p0 = 1.98 bar (-10 %)" in said(found)
    assert "would read about +7 %" in said(found)
    assert 0.003 < found.tire.correction_u < 0.01


def test_half_the_pressure_withholds_the_forces():
    found = held(inflation_pressure=0.5 * TRUTH.inflation_pressure)
    assert found.tire is None
    assert "too far" in found.reason


def test_a_drive_without_pressure_is_warned_and_less_certain():
    found = held(inflation_pressure=None)
    assert found.tire is not None
    assert found.tire.pressure_u == pytest.approx(0.05)
    assert "inflation_pressure is not stated" in said(found)


def test_a_bench_without_pressure_gives_no_forces():
    found = held(given=bench(inflation_pressure=None))
    assert found.tire is None
    assert "does not state inflation_pressure" in found.reason


def test_another_sensor_length_withholds_the_forces():
    found = held(sensor_length_flex=0.095)
    assert found.tire is None
    assert "95 mm" in found.reason
    assert "50 mm" in found.reason


def test_another_resistor_is_told_and_used_for_its_own_log():
    found = held(divider_resistance=22e3)
    assert found.tire is not None
    assert found.tire.sensor.R1 == 22e3
    assert "carried over in ohm" in said(found, "note")


def test_what_the_bench_leaves_uncertain_is_carried_as_one_covariance():
    found = held(given=bench(relative=1e-3, type_b={"load_gain": 5e-3}))
    assert found.tire is not None
    total = covariance(found.tire)
    place = {name: UNKNOWNS.index(name) for name in ("EI", "p0b", "c", "R")}
    assert total[place["EI"], place["EI"]] == pytest.approx(1e-6 + 25e-6)
    assert total[place["c"], place["c"]] == pytest.approx(1e-6)
    assert total[place["EI"], place["p0b"]] == pytest.approx(25e-6)
    assert total[place["p0b"], place["p0b"]] == pytest.approx(1e-6 + 25e-6 + 1e-4)  # and 1 % of the drive's pressure
    assert total[place["R"], place["R"]] == pytest.approx(1e-6)
    assert np.linalg.eigvalsh(total).min() >= -1e-18


def test_without_the_benchs_covariance_its_standard_errors_are_taken():
    given = bench(relative=2e-3)
    given.arrays.clear()
    found = held(given=given)
    assert found.tire is not None
    assert not found.tire.bench.correlated
    total = covariance(found.tire)
    place = UNKNOWNS.index("kw")
    assert total[place, place] == pytest.approx(4e-6 + 25e-6)  # and half a percent of the load cell
    assert set(VALUES) <= set(found.tire.bench.values)
