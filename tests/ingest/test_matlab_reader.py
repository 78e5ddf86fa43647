from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_logs import messages_of, rows

from pipeline.errors import InputError
from pipeline.ingest.matlab import READER
from pipeline.ingest.reader import RawLog

T = np.arange(300) / 100
REAL = Path(__file__).parents[3] / "shared" / "realdata" / "mr_damper_sine"


def saved(tmp_path: Path, variables: dict, **options) -> Path:
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, variables, **options)
    return path


def opened(tmp_path: Path, variables: dict, **options) -> RawLog:
    return READER.open(saved(tmp_path, variables, **options))


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("shape", [(-1, 1), (1, -1)])
def test_vectors_of_one_length_are_a_table_and_scalars_are_metadata(tmp_path, compressed, shape):
    variables = {
        "t": T.reshape(shape),
        "force": np.sin(T).reshape(shape),
        "steps": np.arange(300, dtype=np.int16).reshape(shape),
        "single": np.cos(T).astype(np.float32).reshape(shape),
        "on": (np.arange(300) % 2 == 0).reshape(shape),
        "f": 1.5,
        "Ts": 0.01,
        "n": np.int32(7),
        "sample": "pad ä 7",
    }
    log = opened(tmp_path, variables, do_compression=compressed)
    (table,) = log.tables
    assert table.name == ""
    assert table.time_channel == "t"
    read = rows(table)
    for name in ("t", "force", "steps", "single", "on"):
        np.testing.assert_array_equal(read[name], np.ravel(variables[name]).astype(float))
        assert read[name].dtype == np.float64
    assert all(channel.unit is None for channel in table.channels)
    assert log.metadata == {"f": "1.5", "Ts": "0.01", "n": "7", "sample": "pad ä 7"}
    assert list(rows(table, ["force"])) == ["force"]


def test_version_4_files_are_read(tmp_path):
    log = opened(tmp_path, {"t": T, "force": np.sin(T), "f": 1.5, "name": "abc"}, format="4")
    np.testing.assert_array_equal(rows(log.tables[0])["force"], np.sin(T))
    assert log.metadata == {"f": "1.5", "name": "abc"}
    assert log.details["version"] == "4"


def test_matrices_give_a_channel_a_column_whichever_way_they_lie(tmp_path):
    matrix = np.column_stack([T, np.sin(T), np.cos(T)])
    for given_as in (matrix, matrix.T):
        read = rows(opened(tmp_path, {"data": given_as}).tables[0])
        assert list(read) == ["data_1", "data_2", "data_3"]
        np.testing.assert_array_equal(read["data_2"], np.sin(T))


def test_structs_have_dotted_names_and_their_own_clocks(tmp_path):
    bench = {"time": T, "force": np.sin(T), "info": {"gain": 2.0, "name": "cell"}}
    device = {"time": T + 0.005, "current": np.cos(T)}
    log = opened(tmp_path, {"bench": bench, "device": device})
    tables = {table.name: table for table in log.tables}
    assert set(tables) == {"bench", "device"}
    assert tables["device"].time_channel == "device.time"
    np.testing.assert_array_equal(rows(tables["bench"])["bench.force"], np.sin(T))
    assert log.metadata == {"bench.info.gain": "2.0", "bench.info.name": "cell"}


def test_vectors_of_different_length_are_tables_named_by_their_time(tmp_path):
    variables = {
        "t_s": T,
        "force": T,
        "time": T[::10],
        "temperature": T[::10],
        "other": np.ones(77),
        "gains": [1.0, 2.5],
    }
    log = opened(tmp_path, variables)
    tables = {table.name: [c.name for c in table.channels] for table in log.tables}
    assert tables == {"t_s": ["t_s", "force"], "time": ["time", "temperature"], "77 rows": ["other"]}
    assert {table.name: table.time_channel for table in log.tables}["77 rows"] is None
    assert log.metadata == {"gains": "1 2.5"}


def test_a_time_with_repeated_and_backward_stamps_is_still_the_time(tmp_path):
    stamps = T.copy()
    stamps[50], stamps[100] = stamps[49], 0.0
    assert opened(tmp_path, {"time": stamps, "force": T}).tables[0].time_channel == "time"
    assert opened(tmp_path, {"T": 20 + np.sin(T), "force": T}).tables[0].time_channel is None


def test_simulink_structure_with_time(tmp_path):
    signals = np.empty((1, 2), dtype=object)
    signals[0, 0] = {"values": np.sin(T).reshape(-1, 1), "label": "force", "dimensions": 1.0, "blockName": "m/Scope"}
    signals[0, 1] = {"values": np.column_stack([T, -T]), "label": "", "dimensions": 2.0, "blockName": "m/Scope"}
    array = np.empty(
        (1, 2), dtype=[("values", object), ("label", object), ("dimensions", object), ("blockName", object)]
    )
    for i in range(2):
        array[0, i] = tuple(signals[0, i][name] for name in array.dtype.names)
    log = opened(tmp_path, {"scope": {"time": T.reshape(-1, 1), "signals": array, "blockName": "m/Scope"}})
    (table,) = log.tables
    assert table.time_channel == "scope.time"
    read = rows(table)
    assert list(read) == ["scope.time", "scope.force", "scope.signals.2_1", "scope.signals.2_2"]
    np.testing.assert_array_equal(read["scope.signals.2_2"], -T)


def test_an_array_of_structs_with_scalars_is_a_table_and_with_vectors_several(tmp_path):
    points = np.array([(float(i), 2.0 * i) for i in range(20)], dtype=[("x", object), ("y", object)])
    runs = np.empty((1, 2), dtype=[("time", object), ("force", object)])
    runs[0, 0], runs[0, 1] = (T, np.sin(T)), (T[:200], np.cos(T[:200]))
    log = opened(tmp_path, {"points": points, "runs": runs})
    tables = {table.name: rows(table) for table in log.tables}
    np.testing.assert_array_equal(tables["20 rows"]["points.y"], 2.0 * np.arange(20))
    np.testing.assert_array_equal(tables["runs.2"]["runs.2.force"], np.cos(T[:200]))


def test_complex_vectors_are_two_channels_and_what_is_no_signal_is_told(tmp_path):
    variables = {
        "t": T,
        "z": np.exp(1j * T),
        "cells": np.array([1, "a", T], dtype=object),
        "letters": np.array(["ab", "cd"]),
        "sparse": scipy.sparse.eye(5),
        "nothing": np.empty((0, 0)),
        "cube": np.ones((3, 4, 5)),
        "wide": np.ones((100, 90)),
    }
    log = opened(tmp_path, variables)
    read = rows(log.tables[0])
    np.testing.assert_allclose(read["z.imag"], np.sin(T))
    told = messages_of(log.notes)
    for part in ("'z' is complex", "cells (a cell array)", "letters (a table of letters)", "sparse (a sparse matrix)",
                 "nothing (empty)", "cube (an array of 3 x 4 x 5)", "wide (an array of 100 x 90)"):  # fmt: skip
        assert part in told


def numeric_arrays() -> st.SearchStrategy:
    kinds = st.sampled_from(["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"])
    sizes = st.integers(1, 40)
    return st.builds(lambda kind, n, seed: (np.random.default_rng(seed).random(n) * 200 - (0 if kind[0] in "u?" else 100))
                     .astype(kind), kinds, sizes, st.integers(0, 99))  # fmt: skip


@settings(max_examples=50, deadline=None)
@given(
    st.dictionaries(st.sampled_from(["a", "bb", "ccc", "dddd", "eeeee"]), numeric_arrays(), min_size=1), st.booleans()
)
def test_any_numeric_variables_read_as_scipy_reads_them(tmp_path_factory, variables, compressed):
    path = saved(tmp_path_factory.mktemp("m"), variables, do_compression=compressed, oned_as="column")
    expected = {n: np.ravel(v) for n, v in scipy.io.loadmat(path).items() if not n.startswith("__")}
    vectors = {n: v for n, v in expected.items() if v.size > 1}
    if not vectors:
        with pytest.raises(InputError, match="holds no vector"):
            READER.open(path)
        return
    log = READER.open(path)
    read = {name: values for table in log.tables for name, values in rows(table).items()}
    for name, values in vectors.items():
        if name in read:
            np.testing.assert_array_equal(read[name], values.astype(float))
        else:
            assert values.size < 8
            assert len(log.metadata[name].split()) == values.size


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty"),
        (b"MATLAB 7.3 MAT-file, Platform: PCWIN64" + bytes(600), r"HDF5 file is broken or was cut off"),
        (bytes(512) + b"\x89HDF\r\n\x1a\n", r"HDF5 file is broken or was cut off"),
        (b"# Created by Octave 6.4.0\n# name: x\n", "Octave's own format"),
        (b"time;force\n0;1\n1;2\n" * 9, "this is no MAT file: it begins with b'time;for'"),
        (bytes(range(256)) * 4, "this is no MAT file"),
        (b"MATLAB 5.0 MAT-file", "broken or was cut off"),
        (b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\x01XX", "byte order"),
        (b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\x01IM", "holds no vector of numbers"),
    ],
)
def test_what_is_no_readable_mat_file_is_refused_in_one_paragraph(tmp_path, content, words):
    path = tmp_path / "bad.mat"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        READER.open(path)
    assert "\n" not in str(caught.value)
    assert "bad.mat" in str(caught.value)


@pytest.mark.parametrize("compressed", [True, False])
def test_a_file_cut_at_any_byte_is_refused_or_whole_up_to_a_variable(tmp_path, compressed):
    names = ["t", "force", "s"]
    whole = saved(tmp_path, {"t": T[:20], "force": T[:20], "s": {"a": T[:20]}}, do_compression=compressed).read_bytes()
    path = tmp_path / "cut.mat"
    read_in_part = 0
    for end in range(0, len(whole), 3):
        path.write_bytes(whole[:end])
        try:
            log = READER.open(path)
        except InputError as error:
            message = str(error)
        else:
            read_in_part += 1
            assert set(log.details["variables"].split(", ")) < set(names)
            continue
        assert "cut.mat" in message
    assert read_in_part <= 2


def test_damaged_bytes_are_refused_or_read_but_never_crash(tmp_path):
    rng = np.random.default_rng(0)
    path = tmp_path / "damaged.mat"
    for compressed in (True, False):
        whole = saved(tmp_path, {"t": T, "s": {"a": T, "b": "x"}, "z": T + 1j}, do_compression=compressed).read_bytes()
        for _ in range(150):
            content = bytearray(whole)
            for at in rng.integers(0, len(content), rng.integers(1, 6)):
                content[at] = rng.integers(256)
            path.write_bytes(content)
            try:
                for table in READER.open(path).tables:
                    rows(table)
            except InputError as error:
                message = str(error)
                assert message.count("\n") == 0


def test_a_file_that_would_burst_memory_is_refused(tmp_path):
    inner = struct.pack("<II", 14, 3 << 30) + bytes(64)
    packed = zlib.compress(inner)
    path = tmp_path / "bomb.mat"
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(InputError, match=r"bomb\.mat.*more than 2 GiB, which is refused"):
        READER.open(path)


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        READER.open(tmp_path)


@pytest.mark.skipif(not REAL.is_dir(), reason="the logs of real machines are not here")
@pytest.mark.parametrize("name", ["ensaio.A.1.mat", "ensaio.A.3.mat"])
def test_logs_of_a_real_shaking_table(name):
    log = READER.open(REAL / name)
    (table,) = log.tables
    assert table.time_channel == "Tout"
    read = rows(table)
    expected = scipy.io.loadmat(REAL / name)
    for channel in ("Tout", "dist", "forc"):
        np.testing.assert_array_equal(read[channel], expected[channel].ravel())
    np.testing.assert_allclose(np.diff(read["Tout"]), 0.01, atol=1e-9)
    assert float(log.metadata["f"]) == 1.5
    assert float(log.metadata["Ts"]) == 0.01
    assert not log.notes
