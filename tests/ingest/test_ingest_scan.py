"""`rigfit check` shows what a log holds, whatever is wrong with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from memory_log import MemoryTable, Spec, log_of

from pipeline.errors import InputError
from pipeline.ingest import ingest
from pipeline.ingest.mapping import ChannelMap
from pipeline.ingest.scan import RunScan, scan_log, scan_run

N = 1000
TIME = np.arange(N) / 500.0
FORCE = np.sin(2 * np.pi * 5 * TIME)


def scanned(
    monkeypatch: pytest.MonkeyPatch,
    *tables: MemoryTable,
    specs: tuple[Spec, ...] = (),
    maps: dict[str, ChannelMap] | None = None,
) -> RunScan:
    monkeypatch.setattr(ingest, "open_log", lambda path: log_of(*tables, metadata={"pad": "A-7"}, path=str(path)))
    return scan_log(Path("logs/r1.csv"), specs, maps)


def errors(scan: RunScan) -> list[str]:
    return [finding.message for finding in scan.quality if finding.level == "error"]


def test_without_an_experiment_all_channels_are_shown_in_si(monkeypatch: pytest.MonkeyPatch) -> None:
    table = MemoryTable(
        {"Zeit": TIME * 1e3, "Kraft": FORCE, "Druck": FORCE, "Zustand": np.array(["an"] * N, dtype=object)},
        {"Zeit": "ms", "Kraft": "kN", "Druck": "bar"},
    )
    scan = scanned(monkeypatch, table)
    assert scan.logs[0].metadata == {"pad": "A-7"}
    (shown,) = scan.tables
    assert shown.time is not None
    assert (shown.time.channel, shown.time.unit) == ("Zeit", "ms")
    assert (shown.summary.n, shown.summary.rate) == (N, pytest.approx(500))
    assert (shown.summary.start, shown.summary.end) == (0.0, pytest.approx(1.998))
    kraft, druck, zustand = shown.summary.channels
    assert (kraft.name, kraft.unit, kraft.raw_unit) == ("Kraft", "N", "kN")
    assert (kraft.minimum, kraft.maximum) == (pytest.approx(-1000), pytest.approx(1000))
    assert kraft.mean == pytest.approx(0, abs=1e-9)
    assert druck.unit == "Pa"
    assert zustand.unit == ""
    assert [finding for finding in scan.quality if finding.level != "note"] == []


def test_with_an_experiment_every_missing_channel_is_said_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    table = MemoryTable({"t": TIME, "force": FORCE}, {"t": "s", "force": "N"})
    specs = (Spec("force", "N"), Spec("displacement", "m"), Spec("current", "A"), Spec("voltage", "V", required=False))
    scan = scanned(monkeypatch, table, specs=specs)
    assert len(errors(scan)) == 2
    assert "'displacement'" in errors(scan)[0]
    assert "'current'" in errors(scan)[1]
    assert scan.tables[0].mapped == {"force"}
    assert scan.tables[0].summary.n == N


def test_mapped_channels_bear_canonical_names_beside_the_logs_own(monkeypatch: pytest.MonkeyPatch) -> None:
    table = MemoryTable({"t": TIME, "force": FORCE, "Load cell": FORCE}, {"t": "s", "force": "V", "Load cell": "kN"})
    scan = scanned(monkeypatch, table, specs=(Spec("force", "N"),), maps={"force": ChannelMap("Load cell")})
    names = [(channel.name, channel.raw_name) for channel in scan.tables[0].summary.channels]
    assert names == [("force", "Load cell"), ("force (log)", "force")]


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"time": np.zeros(N), "force": FORCE}, "stands still"),
        ({"time": TIME[::-1], "force": FORCE}, "runs backward"),
        ({"x": FORCE, "force": FORCE}, "no channel is time"),
        ({"time": TIME[:0], "force": FORCE[:0]}, "holds no rows"),
        ({"time": np.array(["a"] * N, dtype=object), "force": FORCE}, "holds text"),
    ],
)
def test_a_time_of_no_use_is_an_error_and_the_rest_is_still_shown(
    monkeypatch: pytest.MonkeyPatch, columns: dict[str, np.ndarray], said: str
) -> None:
    scan = scanned(monkeypatch, MemoryTable(columns, {"force": "N", "time": "s"}))
    assert any(said in message for message in errors(scan))
    assert scan.tables[0].time is None
    force = next(channel for channel in scan.tables[0].summary.channels if channel.name == "force")
    rows = columns["force"].size
    assert scan.tables[0].summary.n == rows
    assert force.maximum == pytest.approx(columns["force"].max() if rows else np.nan, nan_ok=True)


def test_an_unknown_unit_is_said_and_the_numbers_are_shown_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    scan = scanned(monkeypatch, MemoryTable({"time": TIME, "q": FORCE}, {"time": "s", "q": "blorg"}))
    assert any("unknown unit 'blorg'" in finding.message for finding in scan.quality)
    assert scan.tables[0].summary.channels[0].maximum == pytest.approx(1.0)


def test_a_time_that_the_recipe_names_wrongly_is_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    table = MemoryTable({"time": TIME, "force": FORCE}, {"time": "s", "force": "N"})
    scan = scanned(monkeypatch, table, maps={"time": ChannelMap("clock")})
    assert len(errors(scan)) == 1
    assert "'clock'" in errors(scan)[0]
    assert scan.tables[0].time is not None


def test_streams_of_several_files_are_shown_together(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = {
        "r1.a.csv": MemoryTable({"time": 1.7e9 + TIME, "force": FORCE}, {"force": "N"}),
        "r1.b.csv": MemoryTable({"time": 1.7e9 + 5 + TIME, "x": FORCE}, {"x": "m"}),
    }
    monkeypatch.setattr(ingest, "open_log", lambda path: log_of(tables[path.name], path=str(path)))
    scan = scan_run([("a", Path("r1.a.csv")), ("b", Path("r1.b.csv"))])
    assert [table.file for table in scan.tables] == ["r1.a.csv", "r1.b.csv"]
    assert [table.summary.start for table in scan.tables] == [0.0, pytest.approx(5.0)]


def test_a_log_that_cannot_be_opened_is_an_error_of_the_caller(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        scan_log(tmp_path / "absent.csv")
