"""What real writers of TDMS, MDF, HDF5 and MATLAB do: scaled, packed, complex, invalid, short and wordy channels; other contents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import EmptyLogError, InputError
from pipeline.ingest import registry
from pipeline.ingest.ingest import ingest_run
from pipeline.ingest.mapping import ChannelMap, Source
from pipeline.ingest.reader import RawLog
from pipeline.ingest.scan import scan_log
from pipeline.ingest.timebase import find_times
from pipeline.recording.storage import read_folder
from pipeline.rigs.experiment import ChannelSpec

N = 2000
TIME = np.arange(N) / 1000.0
WAVE = np.sin(2 * np.pi * 5 * TIME)
WAVEFORM = {"wf_increment": 1e-3, "wf_start_offset": 0.0, "unit_string": "kN"}


def column(log: RawLog, name: str, table: str = "") -> np.ndarray:
    (found,) = (t for t in log.tables if t.name == table)
    return np.concatenate([block[name] for block in found.blocks([name])])


def tdms(path: Path, *objects: object) -> RawLog:
    from nptdms import TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment(list(objects))
    return registry.open_log(path)


def test_raw_samples_of_a_tdms_channel_are_scaled_as_its_properties_say(tmp_path: Path) -> None:
    from nptdms import ChannelObject, types

    scale = {
        "NI_Scaling_Status": "unscaled",
        "NI_Number_Of_Scales": types.Uint32(1),
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.01,
        "NI_Scale[0]_Linear_Y_Intercept": 2.0,
        "NI_Scale[0]_Linear_Input_Source": types.Uint32(0xFFFFFFFF),
    }
    counts = np.round(1000 * WAVE).astype(np.int16)
    log = tdms(tmp_path / "a.tdms", ChannelObject("Log", "ai0", counts, {**WAVEFORM, **scale}))
    np.testing.assert_allclose(column(log, "ai0"), 0.01 * counts + 2.0)


@pytest.mark.parametrize("asked", [None, ["a", "when"]])
def test_many_small_segments_give_what_the_channels_give_one_by_one(
    tmp_path: Path, asked: list[str] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Segments of changing length, one channel late by some of them, a group of another clock between."""
    from nptdms import ChannelObject, TdmsWriter

    begins, at = np.datetime64("2024-05-06T10:00:00", "us"), 0
    when = begins + np.arange(N).astype("timedelta64[ms]").astype("timedelta64[us]")
    values = {
        "a": WAVE,
        "b": TIME.astype(np.float32),
        "c": WAVE + 1j * TIME,
        "word": np.array(["on", "off"] * (N // 2)),
        "when": when,
    }
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        for k, length in enumerate([7, 40, 13] * 40):
            rows = slice(at, min(at + length, N))
            for names in (["a", "b"], ["c", "word", "when"]):
                objects = [ChannelObject("g", name, values[name][rows], {}) for name in names]
                if rows.start < N:
                    writer.write_segment(
                        [*objects, ChannelObject("other", "x", np.arange(3.0) + k, {"wf_increment": 0.1})]
                    )
            at += length
    monkeypatch.setattr("pipeline.ingest.tdms.BLOCK_ROWS", 300)
    monkeypatch.setattr("pipeline.ingest.column_table.BLOCK_ROWS", 300)
    found = {}
    for largest in (0, 1 << 30):
        monkeypatch.setattr("pipeline.ingest.tdms_samples._LARGEST_PIECE", largest)
        (table,) = (table for table in registry.open_log(tmp_path / "a.tdms").tables if table.name == "g")
        blocks = list(table.blocks(asked))
        found[largest] = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    assert set(found[0]) == set(found[1 << 30]) == set(asked or ["a", "b", "c.real", "c.imag", "word", "when"])
    for name, column_ in found[0].items():
        np.testing.assert_array_equal(found[1 << 30][name], column_)
    np.testing.assert_array_equal(found[0]["a"], WAVE)
    np.testing.assert_allclose(found[0]["when"], TIME, atol=1e-9)


def test_a_channel_far_ahead_of_another_is_not_held_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(tmp_path / "a.tdms") as writer:
        for name in "ab":
            for start in range(0, N, 50):
                writer.write_segment([ChannelObject("g", name, WAVE[start : start + 50], WAVEFORM)])
    monkeypatch.setattr("pipeline.ingest.tdms_samples._MOST_WAITING", 500)
    np.testing.assert_array_equal(column(registry.open_log(tmp_path / "a.tdms"), "b"), WAVE)
    (table,) = registry.open_log(tmp_path / "a.tdms").tables
    blocks = list(table.blocks())
    for name in "ab":
        np.testing.assert_array_equal(np.concatenate([block[name] for block in blocks]), WAVE)


def test_a_complex_channel_is_read_as_its_parts(tmp_path: Path) -> None:
    import h5py
    from nptdms import ChannelObject

    values = WAVE + 1j * TIME
    log = tdms(tmp_path / "a.tdms", ChannelObject("g", "frf", values, WAVEFORM))
    np.testing.assert_array_equal(column(log, "frf.imag"), TIME)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["frf"] = values
    np.testing.assert_array_equal(column(registry.open_log(tmp_path / "a.h5"), "frf.real"), WAVE)


def test_short_channels_and_words_without_a_time_are_no_tables(tmp_path: Path) -> None:
    from nptdms import ChannelObject

    log = tdms(
        tmp_path / "a.tdms",
        ChannelObject("daq", "force", WAVE, WAVEFORM),
        ChannelObject("cal", "gain", np.array([1.25]), {"unit_string": "mV/V"}),
        ChannelObject("notes", "event", ["start", "hold", "again", "stop", "end"], {}),
    )
    assert [channel.name for table in log.tables for channel in table.channels] == ["time", "force"]
    assert log.metadata == {"gain": "1.25 mV/V"}
    assert "'notes/event'" in log.notes[0].message


def test_properties_that_groups_give_differently_bear_the_groups_name(tmp_path: Path) -> None:
    from nptdms import ChannelObject, GroupObject

    groups = [
        (GroupObject(g, {"sensor": s, "rig": "A"}), ChannelObject(g, "x", WAVE, WAVEFORM)) for g, s in ("ap", "bq")
    ]
    log = tdms(tmp_path / "a.tdms", *groups[0], *groups[1])
    assert log.metadata == {"sensor": "p", "rig": "A", "b.sensor": "q"}


def test_invalid_samples_of_an_mdf_channel_are_missing_values_of_that_one_alone(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    invalid = (np.arange(N) >= 100) & (np.arange(N) < 200)
    for compression in (0, 2):
        with MDF(version="4.10") as mdf:
            whole, holed = (
                Signal(WAVE, TIME, name=n, unit="V", invalidation_bits=i) for n, i in (("a", None), ("b", invalid))
            )
            mdf.append([whole, holed], common_timebase=True)
            mdf.save(tmp_path / "a.mf4", overwrite=True, compression=compression)
        log = registry.open_log(tmp_path / "a.mf4")
        np.testing.assert_array_equal(column(log, "a"), WAVE)
        np.testing.assert_array_equal(column(log, "b"), np.where(invalid, np.nan, WAVE))
        np.testing.assert_array_equal(column(log, "time"), TIME)


def test_states_and_markers_of_an_mdf_are_words_also_in_a_group_of_their_own(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    names = {"val_0": 0, "val_1": 1, "text_0": b"OFF", "text_1": b"ON", "default": b"?"}
    with MDF(version="4.10") as mdf:
        mdf.append([Signal((TIME > 1).astype(np.uint8), TIME, name="state", conversion=names)], acq_name="s")
        marks = np.array([b"start", b"stop"], dtype="S8")
        mdf.append([Signal(marks, np.array([0.5, 1.5]), name="marker", encoding="utf-8")], acq_name="events")
        mdf.save(tmp_path / "a.mf4", overwrite=True)
    log = registry.open_log(tmp_path / "a.mf4")
    assert list(column(log, "state", "s")) == ["ON" if t > 1 else "OFF" for t in TIME]
    assert list(column(log, "marker", "events")) == ["start", "stop"]


def test_an_mdf_is_read_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        mdf.append([Signal(WAVE, TIME, name="a"), Signal(TIME, TIME, name="b")], common_timebase=True)
        mdf.save(tmp_path / "a.mf4", overwrite=True)
    monkeypatch.setattr("pipeline.ingest.mdf._FRAGMENT", 4096)
    (table,) = registry.open_log(tmp_path / "a.mf4").tables
    assert max(block["a"].size for block in table.blocks()) <= 4096 // 8
    np.testing.assert_array_equal(column(registry.open_log(tmp_path / "a.mf4"), "a"), WAVE)


def test_packed_numbers_of_netcdf_and_times_that_count_from_a_date(tmp_path: Path) -> None:
    import h5py

    counts = np.round(1000 * WAVE).astype(np.int16)
    counts[7] = -32768
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["time"] = np.arange(N)
        file["time"].attrs["units"] = "milliseconds since 2024-05-06 10:00:00"
        file["force"] = counts
        packing = {"scale_factor": 0.01, "add_offset": 5.0, "_FillValue": np.array([-32768], np.int16), "units": "kN"}
        file["force"].attrs.update(packing)
    log = registry.open_log(tmp_path / "a.nc")
    expected = 0.01 * counts + 5.0
    expected[7] = np.nan
    np.testing.assert_allclose(column(log, "force"), expected)
    assert not log.metadata
    (table,) = scan_log(tmp_path / "a.nc").tables
    assert table.summary.rate == pytest.approx(1000.0)
    assert table.begins == np.datetime64("2024-05-06T10:00:00", "s").astype(int)


@pytest.mark.parametrize("chunks", [None, (100, 4), (500, 1)])
@pytest.mark.parametrize("lies", [False, True])
def test_matrices_are_read_by_their_columns_however_stored(
    tmp_path: Path, chunks: tuple[int, int] | None, lies: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    import h5py

    matrix = np.arange(N * 4.0).reshape(N, 4)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        stored = matrix.T if lies else matrix
        file.create_dataset("m", data=stored, chunks=chunks[::-1] if chunks and lies else chunks)
    monkeypatch.setattr("pipeline.ingest.column_table.BLOCK_ROWS", 333)
    log = registry.open_log(tmp_path / "a.h5")
    blocks = list(log.tables[0].blocks())
    for k in range(4):
        np.testing.assert_array_equal(np.concatenate([block[f"m_{k + 1}"] for block in blocks]), matrix[:, k])


def test_records_have_the_units_that_are_listed_for_them(tmp_path: Path) -> None:
    import h5py

    rows = np.zeros(50, np.dtype([("t", "f8"), ("p", "f4"), ("v", "f8", (2,)), ("word", "S4")]))
    rows["t"], rows["v"][:, 1], rows["word"] = np.arange(50), 3.0, b"ok"
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log"] = rows
        file["log"].attrs["units"] = ["s", "bar", "m/s", ""]
    log = registry.open_log(tmp_path / "a.h5")
    assert {c.name: c.unit for c in log.tables[0].channels} == {
        "t": "s", "p": "bar", "v_1": "m/s", "v_2": "m/s", "word": None,
    }  # fmt: skip
    assert set(column(log, "v_2")) == {3.0}


def test_another_channel_that_is_taken_for_time_has_no_part_in_the_tables_date(tmp_path: Path) -> None:
    import format_logs

    entry = {"time": ChannelMap("header.stamp"), "force": ChannelMap(unit="kN")}
    ingest_run(
        "r1",
        [("", format_logs.write_bag(tmp_path / "r.bag"))],
        [ChannelSpec("force", "N", "")],
        entry,
        {},
        {},
        tmp_path / "out",
    )
    (found,) = read_folder(tmp_path / "out")
    assert found.provenance.begins == pytest.approx(format_logs.BEGIN.astype(np.int64) / 1e9)


def test_a_table_without_rows_is_an_empty_log(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"time": pa.array([], pa.float64())}), tmp_path / "a.parquet")
    with pytest.raises(EmptyLogError, match="holds no rows"):
        registry.open_log(tmp_path / "a.parquet")


@pytest.mark.parametrize("suffix", ["tdms", "mf4", "h5", "parquet", "feather", "bag", "db3", "mat"])
@pytest.mark.parametrize("content", [b"\0\1\2\3" * 2000, bytes(5000)], ids=["rubbish", "zeros"])
def test_a_file_that_is_only_called_so_is_told(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"a\.{suffix}.* no .*file|is no MAT file|is no ROS 1 bag|broken") as caught:
        registry.open_log(path)
    assert len(str(caught.value)) < 500
    path.write_bytes(b"")
    with pytest.raises(InputError, match="empty"):
        registry.open_log(path)


def test_files_without_a_vector_of_numbers_say_what_they_have(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["remark"], file["picture"] = "text", np.zeros((3, 80, 80))
    with pytest.raises(InputError, match=r"no vector of numbers.*it has remark, picture \(an array of 3 x 80 x 80"):
        registry.open_log(tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.h5", "w"):
        pass
    with pytest.raises(InputError, match="it has nothing"):
        registry.open_log(tmp_path / "b.h5")
    (tmp_path / "c.nc").write_bytes(b"CDF\x01" + bytes(100))
    with pytest.raises(InputError, match=r"netCDF file of the classic format.*nccopy -k nc4"):
        registry.open_log(tmp_path / "c.nc")


def test_objects_of_matlab_are_told_with_what_to_do(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("TT", data=np.zeros((1, 6), "u4")).attrs["MATLAB_class"] = np.bytes_("timetable")
    with (tmp_path / "a.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    with pytest.raises(InputError, match=r"TT \(a timetable; save it as vectors, in MATLAB: .*timetable2table"):
        registry.open_log(tmp_path / "a.mat")


def test_a_tdms_cut_off_within_a_segment_is_read_as_far_as_all_its_channels_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A logger that was killed: of the last 500 rows, time is whole, one channel in part there, one not at all."""
    from nptdms import ChannelObject, TdmsWriter

    whole = tmp_path / "whole.tdms"
    with TdmsWriter(whole) as writer:
        for start in range(0, N, 500):
            rows = slice(start, start + 500)
            values = {"time": TIME[rows], "force": WAVE[rows], "current": 2 * WAVE[rows]}
            writer.write_segment([ChannelObject("daq", name, part, {}) for name, part in values.items()])
    monkeypatch.setattr("pipeline.ingest.tdms.BLOCK_ROWS", 300)
    for cut, rows in ((8, 1999), (7, 1999), (8 * 700, 1500)):
        (tmp_path / "cut.tdms").write_bytes(whole.read_bytes()[:-cut])
        for largest in (0, 1 << 30):  # asked for one by one, and as they pass
            monkeypatch.setattr("pipeline.ingest.tdms_samples._LARGEST_PIECE", largest)
            log = registry.open_log(tmp_path / "cut.tdms")
            (table,) = log.tables
            np.testing.assert_array_equal(column(log, "current"), 2 * WAVE[:rows])
            blocks = list(table.blocks(["time", "force"]))  # which have more samples than the table has rows
            np.testing.assert_array_equal(np.concatenate([block["force"] for block in blocks]), WAVE[:rows])
            assert (
                f"'daq': {rows} rows, as far as each of its channels goes, at least {N - rows} row"
                in log.notes[0].message
            )


def test_channels_of_a_cut_off_tdms_that_were_never_of_one_length_stay_tables_of_their_own(tmp_path: Path) -> None:
    from nptdms import ChannelObject

    fast, slow = ChannelObject("daq", "force", WAVE, WAVEFORM), ChannelObject("daq", "oil", TIME[:200], {})
    tdms(tmp_path / "a.tdms", fast, slow)
    (tmp_path / "b.tdms").write_bytes((tmp_path / "a.tdms").read_bytes()[:-80])
    log = registry.open_log(tmp_path / "b.tdms")
    np.testing.assert_array_equal(column(log, "force", "daq"), WAVE)
    np.testing.assert_array_equal(column(log, "oil", "daq 2"), TIME[:190])


@pytest.mark.parametrize("third", [False, True])
def test_names_of_several_levels_in_parquet_are_joined_with_their_units(tmp_path: Path, third: bool) -> None:
    """As pandas has them of a header of two rows; where a third one holds units, they are taken from it."""
    import pandas as pd

    names = [("time", ""), ("a", "displacement"), ("b", "force"), ("b", "Unnamed: 3_level_1")]
    units = ["s", "mm", "kN", "A"]
    if third:
        names = [(*name, unit) for name, unit in zip(names, units, strict=True)]
    else:
        names = [(f"{first} [{unit}]", "") if second in ("", names[3][1]) else (first, f"{second} [{unit}]")
                 for (first, second), unit in zip(names, units, strict=True)]  # fmt: skip
    columns = pd.MultiIndex.from_tuples(names)
    frame = pd.DataFrame(np.column_stack([TIME, WAVE, 2 * WAVE, 3 * WAVE]), columns=columns)
    frame.to_parquet(tmp_path / "a.parquet")
    log = registry.open_log(tmp_path / "a.parquet")
    found = [(channel.name, channel.unit) for channel in log.tables[0].channels]
    assert found == list(zip(["time", "a.displacement", "b.force", "b"], units, strict=True))
    np.testing.assert_array_equal(column(log, "b.force"), 2 * WAVE)


def test_one_column_called_time_in_its_last_part_is_the_time(tmp_path: Path) -> None:
    import pandas as pd

    frame = pd.DataFrame({("a", "time [ms]"): 1000 * TIME, ("a", "force [N]"): WAVE, ("b", "times"): WAVE})
    frame.to_parquet(tmp_path / "a.parquet")
    log = registry.open_log(tmp_path / "a.parquet")
    (time,) = find_times([Source(log, log.tables[0], "a", "")], None)
    assert (time.channel, time.unit) == ("a.time", "ms")


def test_a_date_among_names_of_several_levels_is_the_time(tmp_path: Path) -> None:
    import pandas as pd

    when = pd.date_range("2024-05-06 10:00", periods=N, freq="ms")
    frame = pd.DataFrame({("t", "when"): when, ("a", "force [N]"): WAVE})
    frame.to_parquet(tmp_path / "a.parquet")
    (table,) = registry.open_log(tmp_path / "a.parquet").tables
    assert table.time_channel == "t.when"
    assert str(table.absolute_start).startswith("2024-05-06T10:00:00")
    np.testing.assert_allclose(next(iter(table.blocks()))["t.when"], TIME, atol=1e-9)


def test_a_group_of_hdf5_that_contains_itself_is_read_once(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("daq")
        group["time"], group["force"] = TIME, WAVE
        group["again"] = group
        group["root"] = file["/"]
        other = file.create_group("oil")
        other["time"], other["pressure"] = group["time"], 2 * WAVE  # a time that two groups share
    log = registry.open_log(tmp_path / "a.h5")
    assert [[c.name for c in table.channels] for table in log.tables] == [["force", "time"], ["pressure", "time"]]
    np.testing.assert_array_equal(column(log, "time", "oil"), TIME)
    assert sum("another name of a group that is read" in note.message for note in log.notes) == 2


def test_a_time_alone_in_a_group_of_hdf5_is_that_of_groups_as_long(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["axes/time"], file["data/force"], file["short/oil"] = TIME, WAVE, WAVE[:200]
        file["axes/time"].attrs["units"] = "seconds since 2024-05-06 10:00:00"
        file["own/t"], file["own/current"] = 2 * TIME, WAVE
    log = registry.open_log(tmp_path / "a.h5")
    names = {table.name: [channel.name for channel in table.channels] for table in log.tables}
    assert names == {"data": ["time", "force"], "own": ["current", "t"], "short": ["oil"]}
    data = next(table for table in log.tables if table.name == "data")
    assert (data.time_channel, data.absolute_start) == ("time", "2024-05-06T10:00:00")
    np.testing.assert_array_equal(column(log, "time", "data"), TIME)
    assert ["axes/time" in note.message for note in log.notes] == [True]
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["other/time"] = 3 * TIME  # which of them it is, nothing tells
    names = {table.name: len(table.channels) for table in registry.open_log(tmp_path / "a.h5").tables}
    assert names["data"] == 1
