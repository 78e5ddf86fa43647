"""tire.road end to end on the synthetic drive: accuracy, names, and what is said of faults."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from road_bench import TRUTH, bench

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.ingest.delimited.writer import write_csv
from pipeline.recording import Recording
from pipeline.recording.storage import read, write
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.road.arrays import REVOLUTIONS
from pipeline.rigs.tire.road.declaration import ROAD, RoadSettings
from pipeline.rigs.tire.synthetic.motion import Motion, road_motion
from pipeline.rigs.tire.synthetic.rig import synthesize_road
from pipeline.rigs.tire.synthetic.truth import road_truth

SEED = 21
KMH = 1.0 / 3.6
# Half a minute with driving, braking and one event: enough for what a fault makes of it.
SHORT: dict[str, Any] = {
    "duration": 24.0,
    "speeds": [[0.0, 30 * KMH], [8.0, 30 * KMH], [11.0, 48 * KMH], [16.0, 48 * KMH], [19.0, 30 * KMH]],
    "pulses": [[5.0, 1.2, 600.0]],
}


def identified(recordings: list[Recording], uses: dict[str, Findings] | None = None, **settings: Any) -> Findings:
    found = ROAD.identify(
        recordings, RoadSettings(**settings), Context("test", {"b": bench()} if uses is None else uses)
    )
    ROAD.sections(found)
    ROAD.methods(found)
    return found


@lru_cache(maxsize=1)
def drive() -> Findings:
    """The drive of the rig's sheet with a bench that found the truth."""
    return identified(synthesize_road({}, SEED))


def short(uses: dict[str, Findings] | None = None, **truth: Any) -> Findings:
    return identified(synthesize_road({**SHORT, **truth}, 5), uses)


def truth_of(overrides: dict[str, Any], seed: int) -> Motion:
    known = road_truth(overrides)
    return road_motion(known, np.random.default_rng((seed, known.number)))


def messages(found: Findings, level: str | None = None) -> str:
    return " ".join(q.message for q in found.quality if level in (None, q.level))


def test_load_and_force_of_every_revolution_are_those_of_the_truth():
    table, motion = drive().arrays["revolutions"], truth_of({}, SEED)
    for name, quantity, most in (("vertical_load", "Fz", 40.0), ("longitudinal_force", "Fx", 100.0)):
        for column in (name, f"{name}_filtered"):
            left = (table[column] - motion.at(quantity, table["time"].to_numpy())).dropna()
            assert len(left) > 0.95 * len(table)
            assert math.sqrt((left**2).mean()) < most


def test_peripheral_speed_is_radius_times_rotation():
    table, motion = drive().arrays["revolutions"], truth_of({}, SEED)
    time = table["time"].to_numpy()
    rotation = np.gradient(motion.angle, motion.time)
    true = TRUTH.R * np.interp(time, motion.time, rotation)
    steady = (time > 15.0) & (time < 29.0)
    off = table["speed"].to_numpy()[steady] / true[steady] - 1.0
    assert abs(np.median(off)) < 1e-4


def test_random_errors_cover_the_truth():
    found, motion = drive(), truth_of({}, SEED)
    table, evidence = found.arrays["revolutions"], found.arrays["evidence"]
    for name, quantity, random in (
        ("vertical_load", "Fz", "load_random"),
        ("longitudinal_force", "Fx", "force_random"),
    ):
        off = table[name] - motion.at(quantity, table["time"].to_numpy())
        within = (off.abs() < 1.96 * evidence[random])[evidence["fits"]]
        assert within.mean() > 0.92
        assert (table[f"{name}_se"].dropna() >= evidence[random][table[f"{name}_se"].notna()] - 1e-9).all()


def test_all_events_are_found_and_no_other():
    centres = {"vertical": [18.0, 20.0, 23.0, 26.0], "longitudinal": [11.85, 32.1]}
    for kind, expected in centres.items():
        found = sorted(p.value for p in drive().find("event_time", kind=kind))
        assert found == pytest.approx(expected, abs=0.5)
    assert [p.at["event"] for p in drive().find("event_time")] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_names_units_and_operating_points_are_those_of_the_sheet():
    found = drive()
    at = {(p.name, p.unit, tuple(p.at)) for p in found.parameters}
    assert at == {
        ("load_rms_error", "N", ("run",)),
        ("force_rms_error", "N", ("run",)),
        ("event_time", "s", ("run", "event", "kind")),
        ("packet_loss", "1", ("run",)),
    }
    assert tuple(found.arrays["revolutions"].columns) == REVOLUTIONS
    assert found.one("load_rms_error", run="road").value < 40.0
    assert found.one("force_rms_error", run="road").value < 100.0


def test_packet_loss_is_the_share_that_is_missing():
    (recording,) = synthesize_road({}, SEED)
    index = recording.values("sample_index")
    missing = 1.0 - index.size / (index[-1] - index[0] + 1.0)
    assert drive().one("packet_loss", run="road").value == pytest.approx(missing, rel=1e-6)


def test_a_sound_drive_is_ok_and_says_what_is_extrapolated():
    found = drive()
    assert found.verdict == "ok", found.reasons
    assert any("load is extrapolated" in reason for reason in found.reasons)
    assert any("bonding ok" in reason for reason in found.reasons)


def test_without_references_there_is_nothing_to_compare_with():
    found = short(references=False)
    assert not found.find("load_rms_error")
    assert not found.find("force_rms_error")
    assert found.arrays["revolutions"]["vertical_load"].notna().mean() > 0.9


def test_without_a_bench_only_the_speed_is_told():
    found = short(uses={})
    table = found.arrays["revolutions"]
    assert table["vertical_load"].isna().all()
    assert table["longitudinal_force_filtered"].isna().all()
    assert table["speed"].median() == pytest.approx(39 * KMH, rel=0.3)
    assert (table["speed_se"] > 0.009 * table["speed"]).all()
    parameter = found.one("load_rms_error", run="road")
    assert parameter.value is None
    assert "no bench campaign" in parameter.description
    assert found.verdict == "warning"
    assert "debonding" not in messages(found)


def test_what_is_not_known_of_a_revolution_is_empty():
    table = drive().arrays["revolutions"]
    for name in ("speed", "vertical_load", "longitudinal_force"):
        for suffix in ("", "_filtered"):
            value, error = table[f"{name}{suffix}"], table[f"{name}_se{suffix}"]
            assert (value.isna() == error.isna()).all()
    silent = short(silence=[10.0, 17.0]).arrays["revolutions"]
    assert silent.loc[silent["time"].between(12.0, 16.0), REVOLUTIONS[3:]].isna().all().all()


def test_a_wheel_that_stands_is_refused_in_words():
    (recording,) = synthesize_road({**SHORT, "duration": 5.0, "speeds": [[0.0, 1e-3]]}, 5)
    with pytest.raises(InputError, match="no passage"):
        identified([recording])


@pytest.mark.thorough
def test_pressure_that_is_told_is_corrected_and_one_that_is_not_shows_in_the_reference():
    low = {"inflation_pressure": 0.9 * TRUTH.inflation_pressure}
    told = short(**low)
    assert abs(told.arrays["drives"]["load_bias"][0]) < 20.0
    assert "now p0 = 1.98 bar" in messages(told, "warning")
    hidden = short(**low, told={"inflation_pressure": TRUTH.inflation_pressure})
    assert hidden.arrays["drives"]["load_bias"][0] == pytest.approx(0.085 * 3500.0, rel=0.2)
    assert "the waveform is that of a tire at p0 = 1.9" in messages(hidden, "warning")
    table, true = hidden.arrays["revolutions"], truth_of({**SHORT, **low}, 5)
    off = (table["vertical_load"] - true.at("Fz", table["time"].to_numpy())).abs()
    assert (off < 1.96 * table["vertical_load_se"])[off.notna()].mean() > 0.95
    assert hidden.verdict == "warning"


def test_wrong_direction_withholds_the_longitudinal_force():
    found = short(force_sign=-1)
    assert "rotation sense or sign of Fx reversed" in messages(found, "warning")
    assert found.arrays["revolutions"]["longitudinal_force"].isna().all()
    assert found.one("force_rms_error", run="road").value is None
    assert found.one("load_rms_error", run="road").value is not None


def test_a_speed_in_kmh_is_named_and_not_compared():
    found = short(speed_scale=3.6)
    assert "looks like km/h" in messages(found, "warning")


def test_debonding_withholds_what_comes_after():
    found = short(debond_time=14.0)
    assert "debonding" in messages(found, "warning")
    table = found.arrays["revolutions"]
    assert table["vertical_load"][table["time"] > 15.0].isna().all()
    assert table["vertical_load"][table["time"] < 13.0].notna().mean() > 0.9


def test_what_lies_before_the_ink_broke_is_kept():
    (recording,) = synthesize_road(SHORT, 5)
    device = recording.streams["device"]
    device.channels["flex_code"].values[device.time > 12.0] = 4095.0
    found = identified([recording])
    assert "broken ink" in messages(found, "warning")
    table = found.arrays["revolutions"]
    assert table["vertical_load"][table["time"] > 12.0].isna().all()
    assert table["vertical_load"][table["time"] < 11.5].notna().mean() > 0.9


def test_a_reference_that_begins_later_is_brought_to_the_transmitters_clock():
    found = short(reference_shift=1.5)
    drives = found.arrays["drives"]
    assert abs(drives["offset"][0]) == pytest.approx(1.5, abs=0.1)
    assert found.one("load_rms_error", run="road").value < 60.0
    assert "clocks of transmitter and vehicle" in messages(found, "note")


def test_a_colder_sensor_is_told():
    found = short(R0=10300.0)
    assert "temperature?" in messages(found, "warning")


def test_another_resistor_than_stated_withholds_the_forces():
    found = short(divider_resistance=12e3, told={"divider_resistance": 1e4})
    assert "another resistor R1" in messages(found, "warning")
    assert found.arrays["revolutions"]["vertical_load"].isna().all()
    assert found.arrays["revolutions"]["speed"].notna().mean() > 0.9


def test_a_short_drive_without_fault_is_ok():
    assert short().verdict == "ok"


def test_a_log_that_runs_backward_gives_no_longitudinal_force():
    found = short(time_reversed=True, references=False)
    assert "rotation sense or sign of Fx reversed" in messages(found, "warning")
    assert found.arrays["revolutions"]["longitudinal_force"].isna().all()


@pytest.mark.parametrize(
    "truth",
    [
        {"loss": 0.1, "burst": 20.0},
        {"gated": True},
        {"counter_bits": 10},
        {"counter_bits": 2},
        {"resistance_drift": 0.05},
        {"broken_time": 12.0},
        {"silence": [10.0, 14.0]},
        {"as_voltage": True, "counter": False},
        {"polarity": -1},
        {"swapped": True},
        {"speeds": [[0.0, 40 * KMH], [8.0, 40 * KMH], [12.0, 0.2 * KMH], [14.0, 0.2 * KMH], [18.0, 30 * KMH]]},
        {"supply_sag": 0.05},
        {"time_reversed": True},
        {"rate": 6000.0},
    ],
    ids=lambda truth: next(iter(truth)),
)
def test_no_fault_passes_for_good(truth: dict[str, Any]):
    """Either what is told of the load is right within its error, or a warning stands beside it."""
    overrides = {**SHORT, **truth}
    try:
        found = identified(synthesize_road(overrides, 5))
    except InputError:
        return
    table = found.arrays["revolutions"]
    motion = truth_of(overrides, 5)
    off = (table["vertical_load_filtered"] - motion.at("Fz", table["time"].to_numpy())).dropna()
    good = len(off) and math.sqrt((off**2).mean()) < 60.0
    assert good or found.verdict != "ok", found.reasons


def test_a_log_on_disk_gives_the_same_and_tells_how_far_it_is(tmp_path: Path):
    recordings = synthesize_road(SHORT, 5)
    paths = write(recordings[0], tmp_path)
    told: list[float] = []
    context = Context("test", {"b": bench()}, lambda share, _what: told.append(share))
    found = ROAD.identify([read(paths, lazily=True)], RoadSettings(), context)
    again = identified(recordings)
    np.testing.assert_allclose(
        found.arrays["revolutions"]["vertical_load"], again.arrays["revolutions"]["vertical_load"], rtol=1e-9
    )
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_two_tables_as_csv_are_one_drive(tmp_path: Path, rigfit: Callable[..., Any]):
    from pipeline.findings.storage import read as read_findings
    from pipeline.findings.storage import write as write_findings

    (recording,) = synthesize_road({**SHORT, "duration": 12.0}, 5)
    units = {spec.name: spec.unit for spec in ROAD.conditions}
    for name, stream in recording.streams.items():
        part = Recording("r1", {name: stream}, recording.conditions)
        write_csv(part, tmp_path / f"r1.{name}.csv", units)
    write_findings(bench(), tmp_path / "bench")
    logs = sorted(tmp_path.glob("r1.*.csv"))
    answer = rigfit("run", "tire.road", *logs, "--with", tmp_path / "bench", "--out", tmp_path / "out")
    assert answer.status == 0, answer.err
    found = read_findings(tmp_path / "out")
    assert found.verdict == "ok", found.reasons
    assert found.one("load_rms_error", run="r1").value < 60.0
    assert (tmp_path / "out" / "arrays" / "revolutions.parquet").is_file()
    assert (tmp_path / "out" / "report.html").stat().st_size < 2_000_000


def test_a_bench_run_is_sent_to_its_experiment():
    (recording,) = synthesize_road({**SHORT, "told": {"bench_or_road": "bench"}}, 5)
    with pytest.raises(InputError, match=r"belongs to tire\.bench"):
        identified([recording])
