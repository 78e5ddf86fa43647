"""TDMS, MDF, HDF5, MATLAB 7.3, Parquet and Feather: the same record as from CSV, blocks, broken files, missing libraries."""

from __future__ import annotations

import random
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import format_logs as logs
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.ingest import registry
from pipeline.ingest.ingest import ingest_run
from pipeline.ingest.mapping import ChannelMap
from pipeline.ingest.reader import RawLog
from pipeline.ingest.scan import scan_log
from pipeline.recording import Recording
from pipeline.recording.storage import read_folder
from pipeline.rigs.experiment import ChannelSpec

SPECS = (
    ChannelSpec("force", "N", "force"),
    ChannelSpec("displacement", "m", "displacement"),
    ChannelSpec("state", "", "state", required=False),
    ChannelSpec("temperature", "K", "oil", required=False),
)
WRITERS: dict[str, Callable[[Path], Path]] = {
    "log.tdms": logs.write_tdms,
    "log.mf4": logs.write_mdf,
    "log.h5": logs.write_hdf5,
    "log.parquet": logs.write_parquet,
    "log.feather": logs.write_feather,
    "log.mat": logs.write_matlab_73,
    "log.bag": logs.write_bag,
    "log.db3": logs.write_db3,
}
NAMES = {"log.mat": {"force": ChannelMap("rec.force"), "displacement": ChannelMap("rec.displacement"),}}  # fmt: skip
UNITLESS = {
    "log.mat": {"force": "kN", "displacement": "mm"},
    "log.bag": {"force": "kN", "displacement": "mm"},
    "log.db3": {"force": "kN", "displacement": "mm"},
}


def ingested(path: Path, folder: Path, name: str = "") -> Recording:
    maps = dict(NAMES.get(name, {}))
    for channel, unit in UNITLESS.get(name, {}).items():
        maps[channel] = ChannelMap(maps[channel].channel if channel in maps else None, unit=unit)
    ingest_run("r1", [("", path)], SPECS, maps, {}, {}, folder)
    (found,) = read_folder(folder)
    return found


@pytest.mark.parametrize("name", WRITERS)
def test_a_record_is_read_as_from_csv(tmp_path: Path, name: str) -> None:
    expected = ingested(logs.write_csv(tmp_path / "log.csv"), tmp_path / "csv")
    found = ingested(WRITERS[name](tmp_path / name), tmp_path / "out", name)
    for channel in ("force", "displacement"):
        time, values = found.signal(channel)
        np.testing.assert_allclose(time, expected.signal(channel)[0], atol=1e-9)
        # A logger's integers resolve 1e-5 kN.
        np.testing.assert_allclose(
            values, expected.values(channel), rtol=1e-12, atol=6e-3 if name == "log.mf4" else 1e-12
        )
    if name != "log.mat":
        assert list(found.values("state")) == list(logs.STATE)
    if name in ("log.tdms", "log.mf4", "log.h5", "log.bag", "log.db3"):
        time, oil = found.signal("temperature")
        np.testing.assert_allclose(oil, 293.15 + np.arange(6.0))
        np.testing.assert_allclose(time, 0.5 + np.arange(6.0), atol=1e-9)
    assert not [q for q in found.quality if q.level != "note"]


@pytest.mark.parametrize("name", ["log.tdms", "log.mf4", "log.parquet", "log.feather", "log.bag", "log.db3"])
def test_the_date_of_the_first_sample_is_kept(tmp_path: Path, name: str) -> None:
    found = ingested(WRITERS[name](tmp_path / name), tmp_path / "out", name)
    assert found.provenance.begins == pytest.approx(
        logs.BEGIN.astype("datetime64[ns]").astype(np.int64) / 1e9, abs=1e-3
    )


@pytest.mark.parametrize("name", ["log.tdms", "log.h5", "log.parquet", "log.mat"])
def test_what_the_log_says_of_itself_is_offered_as_conditions(tmp_path: Path, name: str) -> None:
    log = registry.open_log(WRITERS[name](tmp_path / name))
    said = {key: text for key, text in log.metadata.items() if "coil" in key}
    assert said in ({"coil_current": "3 A"}, {"coil_current": "3.0 A"}, {"coil_current": "3.0"})


@pytest.mark.parametrize("name", WRITERS)
def test_the_content_counts_whatever_the_file_is_called(tmp_path: Path, name: str) -> None:
    path = WRITERS[name](tmp_path / name)
    other = tmp_path / "renamed.bin"
    shutil.copy(path, other)
    assert registry.reader_for(other).name == registry.reader_for(path).name


@pytest.mark.parametrize("name", WRITERS)
def test_blocks_are_the_whole_and_only_what_is_asked_is_read(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = WRITERS[name](tmp_path / name)
    whole = _columns(registry.open_log(path))
    for module in ("column_table", "columnar", "matlab.reader", "mcap_log.table"):
        monkeypatch.setattr(f"pipeline.ingest.{module}.BLOCK_ROWS", 257)
    pieces = _columns(registry.open_log(path))
    assert pieces.keys() == whole.keys()
    for key, values in whole.items():
        np.testing.assert_array_equal(pieces[key], values)
    (table, *_) = registry.open_log(path).tables
    one = next(channel.name for channel in table.channels if "force" in channel.name)
    assert all(set(block) == {one} for block in table.blocks([one]))


def _columns(log: RawLog) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for table in log.tables:
        blocks = list(table.blocks())
        for channel in table.channels:
            found[f"{table.name}/{channel.name}"] = np.concatenate([block[channel.name] for block in blocks])
    return found


@pytest.mark.parametrize("name", WRITERS)
def test_broken_files_are_refused_in_words_or_read(tmp_path: Path, name: str) -> None:
    content = WRITERS[name](tmp_path / name).read_bytes()
    rng = random.Random(7)
    bad = tmp_path / f"bad{Path(name).suffix}"
    spoilt = [content[: len(content) * k // 9] for k in range(1, 9)]
    for _ in range(12):
        bytes_ = bytearray(content)
        for _ in range(rng.choice((1, 8))):
            bytes_[rng.randrange(min(len(bytes_), 4000))] = rng.randrange(256)
        spoilt.append(bytes(bytes_))
    refused = []
    for bytes_ in spoilt:
        bad.write_bytes(bytes_)
        try:
            scan_log(bad)
        except InputError as error:
            refused.append(str(error))
    # Bags are read up to the damage, see test_rosbags.
    assert len(refused) >= 3 or name == "log.bag"
    assert all(str(bad) in text and len(text) > 60 for text in refused)


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [
        ("log.tdms", "nptdms", "tdms"),
        ("log.mf4", "asammdf", "mdf"),
        ("log.h5", "h5py", "hdf5"),
        ("log.mat", "h5py", "hdf5"),
    ],
)
def test_a_missing_library_is_named_with_the_line_that_installs_it(
    tmp_path: Path, name: str, module: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = WRITERS[name](tmp_path / name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=rf"optional extra '{extra}'.*pip install 'rigfit\[{extra}\]'"):
        registry.open_log(path)


def test_frames_of_a_bus_are_not_taken_for_signals(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF() as mdf:
        names = ["CAN_DataFrame.ID", "CAN_DataFrame.DataLength"]
        mdf.append([Signal(np.arange(40.0), np.arange(40.0), name=name) for name in names], acq_name="CAN 1")
        mdf.save(tmp_path / "bus.mf4")
    with pytest.raises(InputError, match=r"frames of a bus.*decoded first.*DBC"):
        registry.open_log(tmp_path / "bus.mf4")


def test_channels_of_other_lengths_and_clocks_are_tables_of_their_own(tmp_path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject("g", "fast", np.arange(100.0), {"wf_increment": 0.01}),
                ChannelObject("g", "slow", np.arange(10.0), {"wf_increment": 0.1}),
                ChannelObject("g", "shifted", np.arange(10.0), {"wf_increment": 0.1, "wf_start_offset": 2.0}),
                ChannelObject("g", "nothing", np.empty(0), {"wf_increment": 0.1}),
            ]
        )
    scan = scan_log(tmp_path / "a.tdms")
    found = {table.summary.channels[0].name: table.summary for table in scan.tables}
    assert {name: (table.n, table.start) for name, table in found.items()} == {
        "fast": (100, 0.0),
        "slow": (10, 0.0),
        "shifted": (10, 2.0),
    }
    assert any("'g/nothing' is empty" in note.message for note in scan.quality)


def test_tables_of_records_and_matrices_of_hdf5_are_channels(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["m"] = np.vstack([np.arange(50.0), 2.0 * np.arange(50.0)])  # by rows
        file["t"] = np.arange(50.0)
        records = np.zeros(20, dtype=[("time", "f8"), ("F", "f4"), ("xyz", "f8", (3,)), ("odd", "f8", (2, 2))])
        records["time"], records["F"] = np.arange(20.0), 3.0
        file["pandas_like/table"] = records
        file["cube"] = np.zeros((5, 5, 5))
        file["far"] = h5py.ExternalLink("other.h5", "/x")
    log = registry.open_log(tmp_path / "a.h5")
    assert {table.name: [c.name for c in table.channels] for table in log.tables} == {
        "50 rows": ["m_1", "m_2", "t"],
        "pandas_like/table": ["time", "F", "xyz_1", "xyz_2", "xyz_3"],
    }
    left_out = " ".join(note.message for note in log.notes)
    assert all(word in left_out for word in ("cube", "far (a link)", "odd"))
    np.testing.assert_array_equal(_columns(log)["50 rows/m_2"], 2.0 * np.arange(50.0))


def test_structures_words_and_matrices_of_matlab_73_are_those_of_version_7(tmp_path: Path) -> None:
    log = registry.open_log(logs.write_matlab_73(tmp_path / "a.mat"))
    assert log.details["version"] == "7.3"
    assert log.metadata["operator"] == "M. Éxample"
    names = {channel.name for table in log.tables for channel in table.channels}
    assert {"rec.time", "rec.force", "rec.displacement", "sheet_1", "sheet_2"} <= names
    columns = {key.split("/")[-1]: values for key, values in _columns(log).items()}
    np.testing.assert_array_equal(columns["sheet_2"], logs.DISPLACEMENT)


def test_dates_durations_and_missing_values_of_parquet_are_seconds_and_nan(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    lasting = pa.array(np.arange(10) * 250_000, pa.duration("us"))
    force = pa.array([None if k == 3 else float(k) for k in range(10)])
    nested = pa.array([[1.0, 2.0]] * 10)
    words = pa.array(["a", "b"] * 5).dictionary_encode()
    table = pa.table({"t": lasting, "force": force, "pairs": nested, "word": words})
    pq.write_table(table, tmp_path / "a.parquet")
    log = registry.open_log(tmp_path / "a.parquet")
    columns = {key.lstrip("/"): values for key, values in _columns(log).items()}
    np.testing.assert_allclose(columns["t"], 0.25 * np.arange(10))
    assert np.isnan(columns["force"][3])
    assert list(columns["word"]) == ["a", "b"] * 5
    assert any("'pairs'" in note.message for note in log.notes)
