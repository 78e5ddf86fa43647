"""Tables that list entries: events and samples of a culture, of which several bear one time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.ingest.ingest import ingest_run, open_run
from pipeline.recording import Recording
from pipeline.recording.storage import read_folder
from pipeline.rigs.experiment import ChannelSpec

SPECS = (
    ChannelSpec("state", "", "state of the device", required=False, lists_entries=True),
    ChannelSpec("alarm", "", "alarm", required=False, lists_entries=True),
    ChannelSpec("viability", "1", "living cells", required=False),
    ChannelSpec("pressure", "Pa", "pressure", required=False),
)


def recording(folder: Path, specs: Sequence[ChannelSpec] = SPECS, **tables: str) -> Recording:
    folder.mkdir(exist_ok=True)
    logs = []
    for name, text in tables.items():
        path = folder / f"r1.{name}.csv"
        path.write_text(text)
        logs.append((name, path))
    ingest_run("r1", logs, specs, {}, {}, {}, folder / "out")
    (found,) = read_folder(folder / "out")
    return found


def test_events_of_one_moment_are_all_kept_in_their_order(tmp_path: Path) -> None:
    events = "time [s],state,alarm\n20,THERAPY,\n231.5,ALARM,AIR\n231.5,PAUSE,\n231.5,THERAPY,\n620,OFF,\n"
    found = recording(tmp_path, events=events)
    time, states = found.signal("state")
    assert list(states) == ["THERAPY", "ALARM", "PAUSE", "THERAPY", "OFF"]
    assert (np.diff(time) > 0).all()
    np.testing.assert_allclose(time, [20, 231.5, 231.5, 231.5, 620], atol=5e-6)
    assert [q.level for q in found.quality] == ["note"]


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1.0), ("min", 1 / 60), ("ms", 1e3)])
def test_a_list_that_is_sorted_by_something_else_is_sorted_by_time_and_loses_nothing(
    tmp_path: Path, unit: str, per_second: float
) -> None:
    hours = (0.0, 1800.0, 3600.0)
    rows = [(h, group, 0.9 + 0.01 * k) for group in ("control", "treated") for h in hours for k in range(4)]
    text = f"time [{unit}],state,viability\n" + "".join(f"{h * per_second:.9g},{g},{v}\n" for h, g, v in rows)
    found = recording(tmp_path, cells=text)
    time, groups = found.signal("state")
    assert time.size == len(rows)
    expected = sorted(rows, key=lambda row: row[0])
    np.testing.assert_allclose(time, [row[0] for row in expected], atol=1e-4)
    assert list(groups) == [row[1] for row in expected]
    np.testing.assert_allclose(found.values("viability"), [row[2] for row in expected])


def test_events_with_dates_keep_their_place_beside_the_other_tables(tmp_path: Path) -> None:
    begin = np.datetime64("2024-05-06T10:00:00")
    device = "time,pressure [Pa]\n" + "".join(
        f"{begin + np.timedelta64(50 * k, 'ms')},{100 + k % 7}\n" for k in range(400)
    )
    moments = [begin + np.timedelta64(s, "s") for s in (3, 3, 12)]
    events = "time,state\n" + "".join(f"{m},{w}\n" for m, w in zip(moments, ("A", "B", "C"), strict=True))
    found = recording(tmp_path, device=device, events=events)
    time, states = found.signal("state")
    assert list(states) == ["A", "B", "C"]
    np.testing.assert_allclose(time, [3.0, 3.0, 12.0], atol=1e-5)


def test_how_evenly_entries_come_is_not_judged_but_that_of_samples_is(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    moments = np.cumsum(rng.exponential(5.0, 300))
    moments[150:] += 1e4
    events = "time [s],state\n" + "".join(f"{m:.3f},{'A' if k % 2 else 'B'}\n" for k, m in enumerate(moments))
    samples = "time [s],pressure [Pa]\n" + "".join(
        f"{0.05 * k + (9.0 if k > 500 else 0.0):.3f},{k % 13}\n" for k in range(1000)
    )
    found = recording(tmp_path, events=events, device=samples)
    assert sum("gap" in q.message for q in found.quality) == 1


def test_a_list_of_one_event_is_taken_beside_a_long_table(tmp_path: Path) -> None:
    samples = "time [s],pressure [Pa]\n" + "".join(f"{k},{k % 5}\n" for k in range(50))
    one_event = "time [s],state\n3.5,ALARM\n"
    found = recording(tmp_path, device=samples, events=one_event)
    assert [list(found.signal("state")[0]), list(found.values("state"))] == [[3.5], ["ALARM"]]


def test_blanks_in_a_list_are_no_missing_samples_and_a_number_for_no_value_is_no_stuck_sensor(tmp_path: Path) -> None:
    events = "time [s],state,viability\n" + "".join(
        f"{5 * k},{'AB'[k % 2]},{'1' if k == 3 else ''}\n" for k in range(12)
    )
    level = 30.0 + np.random.default_rng(2).normal(size=400).round(3)
    level[200:260] = 0.0
    samples = "time [s],pressure [Pa]\n" + "".join(f"{k},{v}\n" for k, v in enumerate(level))
    silent = recording(tmp_path, events=events, device=samples)
    assert any("stuck at 0 Pa" in q.message for q in silent.quality)
    assert not any("no value" in q.message for q in silent.quality)
    expected = [replace(spec, no_value=0.0) if spec.name == "pressure" else spec for spec in SPECS]
    told = recording(tmp_path / "b", expected, events=events, device=samples)
    assert not any("stuck" in q.message or "spike" in q.message for q in told.quality)
    np.testing.assert_array_equal(told.values("pressure"), level)


def test_a_side_table_without_rows_is_left_out_and_told_and_a_run_without_any_is_refused(tmp_path: Path) -> None:
    samples = "time [s],pressure [Pa]\n" + "".join(f"{k},{k % 5}\n" for k in range(50))
    paths = {"device": samples, "scale": "# a scale\n", "events": "time [s],state\n", "log": ""}
    files = []
    for name, text in paths.items():
        (tmp_path / f"r1.{name}.csv").write_text(text)
        files.append((name, tmp_path / f"r1.{name}.csv"))
    logs, notes = open_run(files)
    assert [stream for stream, _ in logs] == ["device"]
    assert [note.level for note in notes] == ["warning"] * 3
    assert "r1.scale.csv" in notes[0].message
    with pytest.raises(InputError, match=r"r1\.events\.csv|r1\.scale\.csv"):
        open_run(files[1:])
