"""Faults of therapy logs (rap.md, section 8): each is told with what to do, none becomes a number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rap_therapy_known import altered, cut, faults, found, made, said, short

from pipeline.errors import InputError
from pipeline.recording import Recording, Stream
from pipeline.rigs.rap.therapy.check import check
from pipeline.rigs.rap.therapy.faults import examined


def removed(run: Recording) -> dict[str, str]:
    record, _ = examined(run)
    return dict(record.removed)


def test_sound_run_has_no_fault() -> None:
    record, findings = examined(short())
    assert not record.removed
    assert [f.message for f in findings if f.level == "error"] == []


def test_degrees_celsius_labelled_kelvin_are_named_and_not_used() -> None:
    findings = found(altered(short(), lambda k, v: v - 273.15 if k == "temperature_air_rap" else v))
    assert "logged in degC" in said(findings)
    assert findings.one("temperature_error_max").value is None
    assert findings.one("temperature_final", source="rap").value is None
    assert findings.one("uf_volume_final").value is not None


def test_scale_in_grams_labelled_kilograms_is_named_and_not_used() -> None:
    findings = found(altered(short(), lambda k, v: v * 1e3 if k == "uf_mass_scale" else v))
    assert "give its unit" in findings.one("uf_volume_error_rms").description
    assert findings.verdict == "warning"


def test_scale_with_turned_sign_is_named() -> None:
    assert (
        "sign is turned" in removed(altered(short(), lambda k, v: -v if k == "uf_mass_scale" else v))["uf_mass_scale"]
    )


def test_scale_in_pounds_is_named() -> None:
    reasons = removed(altered(short(), lambda k, v: v * 2.2046 if k == "uf_mass_scale" else v))
    assert "pounds" in reasons["uf_mass_scale"]


def test_level_logged_in_place_of_the_distance_is_named() -> None:
    reasons = removed(altered(short(), lambda k, v: np.where(v > 0, 0.285 - v, 0.0) if k == "uf_level_distance" else v))
    assert "seems to be the level over the floor" in reasons["uf_level_distance"]


def test_level_in_millimetres_labelled_metres_is_named() -> None:
    reasons = removed(altered(short(), lambda k, v: v * 1e3 if k == "uf_level_distance" else v))
    assert "another unit" in reasons["uf_level_distance"]


def test_geometry_of_another_tank_is_named_and_no_volume_told() -> None:
    findings = found(altered(short(), conditions={"tank_lx": 0.24}))
    assert "another tank" in findings.one("uf_volume_final").description
    assert findings.one("uf_volume_final").value is None


def test_weak_pump_is_no_wrong_unit_where_level_and_scale_agree() -> None:
    run = made(pump_gain=0.5, closed_loop=False)
    assert not removed(run)
    gain = found(run).one("uf_pump_gain")
    assert gain.ci95 is not None
    assert gain.ci95[0] < 0.5 < gain.ci95[1]


def test_missing_geometry_is_asked_for_by_name() -> None:
    findings = found(altered(short(), conditions={"tank_lx": None, "tank_ly": None}))
    assert "tank_lx, tank_ly" in findings.one("uf_volume_final").description


def test_exchanged_set_points_are_named() -> None:
    run = short()
    blood, uf = run.values("blood_flow_set"), run.values("uf_flow_set")
    other = {"blood_flow_set": uf, "uf_flow_set": blood}
    assert "exchanged" in removed(altered(run, lambda k, v: other.get(k, v)))["blood_flow_set"]


def test_gravity_along_another_axis_is_named() -> None:
    run = short()
    x, z = run.values("tank_accel_x"), run.values("tank_accel_z")
    other = {"tank_accel_x": z, "tank_accel_z": x}
    findings = found(altered(run, lambda k, v: other.get(k, v)))
    assert said(findings).count("gravity lies along tank_accel_x") >= 1
    assert sum("gravity lies along" in q.message for q in findings.quality) == 1


def test_dead_accelerometer_is_named() -> None:
    reasons = removed(altered(short(), lambda k, v: v * 0.0 if k.startswith("tank_accel") else v))
    assert "not even gravity" in reasons["tank_accel_z"]


def test_table_in_minutes_is_named_and_not_used() -> None:
    run = short()
    scale = run.streams["scale"]
    streams = {**run.streams, "scale": Stream("scale", scale.time / 60.0, scale.channels)}
    findings = found(replace(run, streams=streams))
    assert "is its time in minutes" in said(findings)
    assert findings.one("uf_volume_error_rms").value is None


def test_table_that_ends_early_is_told() -> None:
    run = short()
    streams = {**run.streams, "scale": cut(run, 0.0, 1500.0).streams["scale"]}
    assert "table 'scale' ends" in said(found(replace(run, streams=streams)))


def test_log_that_ends_in_therapy_is_told() -> None:
    assert "without TERMINATION" in said(found(cut(short(), 0.0, 1800.0)))


def test_what_level_and_scale_disagree_by_is_in_the_errors_of_what_rests_on_the_level() -> None:
    run = altered(short(), tables=("device_status", "device_temperature", "bench_temperature", "scale"))
    clock, known = run.streams["scale"].time, found(run)
    drift = 20e-3 * (clock - clock[0]) / 600.0
    findings = found(altered(run, lambda k, v: v + drift if k == "uf_mass_scale" else v))
    for name in ("uf_volume_final", "uf_pump_gain"):
        told, before = findings.one(name), known.one(name)
        assert told.value == pytest.approx(before.value, rel=1e-9)
        assert told.std_error is not None
        assert before.std_error is not None
        assert told.std_error > 3.0 * before.std_error
        assert "level and scale disagree" in told.description
        assert "disagree" not in before.description
    assert "one of them is wrong" in said(findings)
    assert "Calibrate the pump" not in said(findings)


def test_battery_that_reads_nothing_is_no_battery_that_gave_nothing() -> None:
    run = altered(short(), lambda k, v: v * 0.0 if k == "battery_voltage" else v, tables=("device_status",))
    by_gauge = found(run).one("energy_used")
    assert by_gauge.value == pytest.approx(
        found(altered(short(), tables=("device_status",))).one("energy_used").value, rel=0.1
    )
    assert "battery_level" in by_gauge.method
    findings = found(altered(run, drop=("battery_level",)))
    assert findings.one("energy_used").value is None
    assert "reads 0 throughout" in findings.one("energy_used").description


def test_part_that_a_run_cannot_tell_is_warned_of_though_another_run_tells_it() -> None:
    run = altered(short(), tables=("device_status",))
    findings = found(run, replace(altered(run, conditions={"tank_lx": None}), run="no_tank"))
    assert findings.one("uf_volume_final", run="rap_therapy_312").value is not None
    assert any("no_tank" in reason and "uf_volume_final" in reason for reason in findings.reasons)


def test_skew_of_the_two_units_is_told() -> None:
    assert "samples 10.0 ms later" in said(found(faults()))


@pytest.mark.parametrize("tables", [("device_temperature", "bench_temperature"), ("device",), ("device_status",)])
def test_each_table_alone_gives_what_it_can(tables: tuple[str, ...]) -> None:
    findings = found(altered(short(), tables=tables))
    told = {p.name for p in findings.parameters if p.value is not None}
    if "device_temperature" in tables:
        assert told >= {"temperature_final", "temperature_error_max"}
        assert not findings.find("uf_volume_final")
    if "device_status" in tables:
        assert told >= {"uf_volume_final", "energy_used"}
        assert not findings.find("temperature_final")


def test_log_without_anything_of_a_therapy_is_refused_with_what_is_needed() -> None:
    with pytest.raises(InputError, match="needs at least one of"):
        found(altered(short(), tables=("bench",)))
    with pytest.raises(InputError, match="needs at least one of"):
        check(altered(short(), tables=("bench",)))


def test_seconds_of_log_are_refused_in_words_or_give_nothing() -> None:
    findings = found(cut(short(), 0.0, 3.0))
    assert findings.one("uf_pump_gain").value is None
    assert findings.verdict != "ok"


def test_check_speaks_in_the_words_of_identify() -> None:
    run = altered(short(), lambda k, v: -v if k == "uf_mass_scale" else v)
    assert any("sign is turned" in q.message and q.level == "error" for q in check(run))


@pytest.mark.thorough
def test_scale_without_tare_on_a_filled_tank_tells_changes_only() -> None:
    findings = found(altered(made(), conditions={"mass_tare": None}))
    assert "mass_tare is not stated and the scale starts at" in said(findings)
    rms = findings.one("uf_volume_error_rms").value
    assert rms is not None
    assert rms < 5e-6


@pytest.mark.thorough
def test_clock_that_began_long_before_the_run_changes_no_number() -> None:
    run = short()
    streams = {n: Stream(n, s.time + 86400.0, s.channels) for n, s in run.streams.items()}
    late, usual = found(replace(run, streams=streams)), found(run)
    for name in ("time_constant", "temperature_initial"):
        for source in ("rap", "bench"):
            expected = usual.one(name, source=source).value
            same = pytest.approx(expected, rel=1e-3) if expected is not None else None
            assert late.one(name, source=source).value == same
    assert usual.one("temperature_initial", source="bench").value is not None
    assert late.one("uf_volume_final").value == pytest.approx(usual.one("uf_volume_final").value, rel=1e-3)


STATUS = ("device_status", "device_temperature", "bench_temperature")


def test_level_alone_tells_the_volume_at_the_end_and_no_gain() -> None:
    usual = found(altered(short(), tables=STATUS)).one("uf_volume_final").value
    findings = found(altered(short(), tables=STATUS, drop=("uf_pump_command", "uf_flow_set")))
    final = findings.one("uf_volume_final")
    assert final.ci95 is not None
    assert final.ci95[0] < usual < final.ci95[1]
    assert final.std_error < 3e-6
    assert "levels of the last ten minutes" in final.description
    assert findings.one("uf_pump_gain").value is None


def test_unstated_place_of_the_level_sensor_is_in_the_error_of_the_volume() -> None:
    run = altered(short(), tables=STATUS)
    known = found(run).one("uf_volume_final")
    vague = found(altered(run, conditions={"level_sensor_dx": None})).one("uf_volume_final")
    assert abs(vague.value - known.value) > 3.0 * known.std_error
    assert abs(vague.value - known.value) < 2.0 * vague.std_error


def test_bench_thermometer_whose_clock_is_an_hour_late_is_fitted_by_its_own_clock_and_not_compared() -> None:
    run = altered(short(), tables=STATUS)
    bench = run.streams["bench_temperature"]
    late = Stream(bench.name, bench.time + 3600.0, bench.channels)
    findings = found(replace(run, streams={**run.streams, bench.name: late}))
    usual = found(run).one("time_constant", source="bench").value
    assert findings.one("time_constant", source="bench").value == pytest.approx(usual, rel=0.01)
    error = findings.one("temperature_error_max")
    assert error.value is None
    assert "clocks stand apart" in error.description


def test_degrees_fahrenheit_labelled_celsius_are_named() -> None:
    def relabelled(name: str, values: np.ndarray) -> np.ndarray:
        return (values - 273.15) * 1.8 + 32.0 + 273.15 if name == "temperature_air_rap" else values

    assert "unit: degF" in removed(altered(short(), relabelled, tables=STATUS))["temperature_air_rap"]


def test_level_that_stands_still_is_no_wrong_unit() -> None:
    run = altered(short(), lambda k, v: 0.25 + 1e-4 * np.sin(np.arange(v.size)) if k == "uf_level_distance" else v)
    assert "does not move" in removed(run)["uf_level_distance"]


def test_fastest_table_in_minutes_is_named_by_the_others() -> None:
    run = altered(short(), tables=(*STATUS, "scale"))
    status = run.streams["device_status"]
    hasty = Stream(status.name, status.time / 60.0, status.channels)
    findings = found(replace(run, streams={**run.streams, status.name: hasty}))
    assert "table 'device_status' lasts 40" in said(findings)
    assert "is its time in minutes" in findings.one("energy_used").description


def test_device_whose_own_volume_is_off_is_told_without_doubt_of_tank_and_scale() -> None:
    run = altered(short(), lambda k, v: 1.2 * v if k == "uf_volume_rap" else v, tables=(*STATUS, "scale"))
    told = said(found(run))
    assert "the device's own estimate is off" in told
    assert not any("stands" in reason and "off the scale" in reason for reason in found(run).reasons)


def test_turned_sign_of_all_ultrafiltrate_pressures_is_told_without_a_bench() -> None:
    device = altered(short(), tables=("device", "device_status"))
    assert not any("sign is turned" in q.message for q in found(device).quality)
    findings = found(altered(device, lambda k, v: -v if k in ("pressure_uf_rap", "pressure_uf_prot") else v))
    assert findings.one("k_uf_initial").value is None
    assert any("sign is turned" in q.message and q.channel == "pressure_uf_rap" for q in findings.quality)


def test_tables_whose_clocks_stand_minutes_apart_are_named() -> None:
    run = altered(short(), tables=("device", "device_status", "device_temperature", "scale", "events"))
    events, scale = run.streams["events"], run.streams["scale"]
    later = {"events": Stream("events", events.time + 240.0, events.channels),
             "scale": Stream("scale", scale.time + 240.0, scale.channels)}  # fmt: skip
    told = said(found(replace(run, streams={**run.streams, **later})))
    assert "the events stand 237 s behind the pressures" in told
    assert "whose clock stands" in told
    assert "another clock" not in said(found(run))
