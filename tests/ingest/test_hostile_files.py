"""Logs of other formats that lie: small files that unpack to gigabytes, tables without end, text that is none."""

from __future__ import annotations

import os
import sqlite3
import struct
import subprocess
import sys
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.fuzz import mutations
from benchmarks.fuzz.targets import TARGETS, run_quietly
from pipeline.errors import InputError
from pipeline.ingest import ahead
from pipeline.ingest.ingest import ingest_run
from pipeline.ingest.scan import scan_log

GIGABYTE = 1 << 30
TIME = np.arange(400) / 100.0


@pytest.fixture
def most() -> Iterator[Callable[[], float]]:
    """Tell the peak of memory (MB) that Python has taken since the test began."""
    tracemalloc.start()
    yield lambda: tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()


def mat_bomb(path: Path) -> None:
    packed = zlib.compress(struct.pack("<II", 14, GIGABYTE) + bytes(1 << 20))
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\x01IM" + struct.pack("<II", 15, len(packed)) + packed)


def hdf5_never_written(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.create_dataset("time", shape=(10**12,), dtype="f8", chunks=(1000,))


def hdf5_gzip(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    packed = zlib.compress(bytes(1 << 24), 1)
    with h5py.File(path, "w") as file:
        data = file.create_dataset("force", shape=(40 << 21,), dtype="f8", chunks=(1 << 21,), compression="gzip")
        for k in range(40):
            data.id.write_direct_chunk((k << 21,), packed)


def hdf5_one_chunk(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["time"] = TIME
        file.create_dataset("force", shape=(1 << 28,), dtype="f8", chunks=(1 << 28,), compression="gzip")


def mat_73(path: Path) -> None:
    hdf5_never_written(path)


def parquet_rows(path: Path) -> None:
    with pq.ParquetWriter(path, pa.schema([("x", pa.float64())]), compression="zstd") as writer:
        batch = pa.table({"x": np.zeros(1 << 20)})
        for _ in range(40):
            writer.write_table(batch)


BOMBS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "MAT: a variable of a gigabyte in a megabyte": ("log.mat", mat_bomb),
    "MAT 7.3: a vector that was never written": ("log.mat", mat_73),
    "HDF5: a vector that was never written": ("log.h5", hdf5_never_written),
    "HDF5: zeros in gzip": ("log.h5", hdf5_gzip),
    "HDF5: one chunk of two gigabytes": ("log.h5", hdf5_one_chunk),
    "Parquet: more rows than bytes": ("log.parquet", parquet_rows),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_small_file_of_gigabytes_is_refused_before_it_is_unpacked(
    tmp_path: Path, name: str, most: Callable[[], float]
) -> None:
    path = tmp_path / BOMBS[name][0]
    BOMBS[name][1](path)
    with pytest.raises(InputError, match=r"refused") as refusal:
        scan_log(path)
    assert most() < 200
    assert path.name in str(refusal.value)


def test_feather_whose_texts_lie_elsewhere_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.feather"
    feather.write_feather(pa.table({"t": TIME, "word": ["run"] * TIME.size}), path, compression="uncompressed")
    content = path.read_bytes()
    places = np.arange(TIME.size + 1, dtype="<i4") * 3
    at = content.index(places.tobytes())
    for wrong in (-1, 1 << 30):
        path.write_bytes(content[: at + 40] + struct.pack("<i", wrong) + content[at + 44 :])
        with pytest.raises(InputError, match="broken"):
            scan_log(path)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be split here")
def test_what_ends_or_hangs_a_library_is_told_and_what_raises_is_left_to_the_reader(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ahead, "_MOST_SECONDS", 1)

    def endless() -> None:
        while True:
            pass

    monkeypatch.setattr(ahead.threading, "active_count", lambda: 1)
    assert ahead.fatal(endless) == "does not come to an end"
    assert ahead.fatal(lambda: os.kill(os.getpid(), 9)) == "is ended by signal 9"
    assert ahead.fatal(lambda: bytearray(3 * GIGABYTE)) == "asks for more than 1 GB"
    assert ahead.fatal(lambda: bytearray(GIGABYTE // 64)) is None
    assert ahead.fatal(lambda: None) is None


def test_a_parquet_column_without_rows_to_its_footer_is_refused_before_its_library_ends_rigfit(tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    pa = pytest.importorskip("pyarrow")
    path = tmp_path / "lies.parquet"
    pq.write_table(pa.table({"time": TIME, "name": ["a"] * TIME.size}), path)
    whole = path.read_bytes()
    place = whole.rindex(b"\x25\x02\x18\x04name")  # OPTIONAL turned into REQUIRED, its statistics left as they were
    path.write_bytes(whole[:place] + b"\x25\x00\x18\x04name" + whole[place + 8 :])
    # Where tests run side by side, a process has threads and does not try files ahead.
    told = subprocess.run(
        [sys.executable, "-m", "pipeline.cli", "check", path], capture_output=True, text=True, check=False
    )
    assert told.returncode == 2
    assert "lies.parquet: this Parquet file is broken" in told.stderr


def test_parquet_columns_of_one_name_are_left_out_and_the_others_read(tmp_path: Path) -> None:
    feather = pytest.importorskip("pyarrow.feather")
    pa = pytest.importorskip("pyarrow")
    path = tmp_path / "twice.feather"
    table = pa.table([TIME, np.sin(TIME), np.cos(TIME)], names=["time", "x", "x"])
    feather.write_feather(table, path)
    told = scan_log(path)
    assert any("'x' (2 columns have this name) is left out" in q.message for q in told.quality), told


def rows_of(form: str) -> str:
    return "".join(form.format(t, np.sin(t), np.cos(t)) for t in TIME)


PLAIN = "time [s],x [mm],F [N]\n" + rows_of("{:.3f},{:.6f},{:.6f}\n")
TEXTS = {
    "a million columns": b"a," * 1_000_000 + b"\n" + (b"1," * 1_000_000 + b"\n") * 2,
    "twenty thousand columns": (b"1," * 20_000 + b"\n") * 30,
    "a line of 5 MB": PLAIN.encode() + b"1" * 5_000_000,
    "a million quotes": PLAIN.encode() + b'"' * 1_000_000 + b"\n",
    "nothing but quotes": b'"' * 1_000_000,
    "a quote in each line": PLAIN.replace("\n", '"\n').encode(),
    "commas and line ends": b",,,,\n" * 20_000,
    "UTF-32": PLAIN.encode("utf-32"),
    "UTF-16 of half a pair": b"\xff\xfe" + PLAIN.encode("utf-16-le")[:-3] + b"\x00\xd8",
    "surrogates in UTF-8": PLAIN.encode() + b"\xed\xa0\x80,\xed\xbf\xbf,1\n",
    "three byte-order marks": b"\xef\xbb\xbf" * 3 + PLAIN.encode(),
    "NUL bytes in the middle": PLAIN.encode()[:3000] + b"\0" * 50 + PLAIN.encode()[3000:],
    "numbers of 5000 digits": PLAIN.encode() + b"1" * 5000 + b",2,3\n",
    "numbers beyond all": PLAIN.encode() + b"1e400,-1e400,1e-999999999999\n",
    "comments only": b"# " * 500_000,
    "a header of 5000 keys": b"".join(b"# k%d: 1\n" % k for k in range(5_000)) + PLAIN.encode(),
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_that_is_no_table_is_refused_in_one_line_or_read(tmp_path: Path, name: str) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(TEXTS[name])
    refusal = ""
    try:
        assert sum(table.summary.n for table in scan_log(path).tables) >= 390
    except InputError as error:
        refusal = str(error)
    assert "\n" not in refusal.strip()
    assert len(refusal) < 2000


@pytest.mark.thorough
def test_a_line_of_hundreds_of_megabytes_is_not_read(tmp_path: Path, most: Callable[[], float]) -> None:
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        file.write(PLAIN.encode())
        file.write(b"1")
        for _ in range(300):
            file.write(b"2" * (1 << 20))
    with pytest.raises(InputError, match="has no end within"):
        scan_log(path)
    assert most() < 200


def computed(path: Path, messages: str) -> None:
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("INSERT INTO topics VALUES (1, '/rig', 'std_msgs/msg/Float64', 'cdr')")
        base.executescript(messages)
    base.close()


@pytest.mark.parametrize(
    "messages",
    [
        "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
        "SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n;",
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB GENERATED ALWAYS AS (zeroblob(1000000000))); INSERT INTO messages VALUES (1, 1, 1);",
    ],
    ids=["endless view", "computed column"],
)
def test_an_sqlite_bag_that_computes_its_messages_is_refused(tmp_path: Path, messages: str) -> None:
    path = tmp_path / "bag.db3"
    computed(path, messages)
    with pytest.raises(InputError, match=r"another program"):
        scan_log(path)


@pytest.mark.parametrize(
    "run", ["../x", "/etc/x", "..", ".", "C:\\x", "a\0b", "a\nb", "x" * 300, "", " x", ".hidden", "a/b"]
)
def test_a_run_whose_name_leads_elsewhere_is_refused(tmp_path: Path, run: str) -> None:
    log = tmp_path / "log.csv"
    log.write_text(PLAIN)
    out = tmp_path / "deep" / "out"
    with pytest.raises(InputError, match="cannot be the name of a run"):
        ingest_run(run, [("", log)], (), {}, {}, {}, out)
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


FUZZED = ("csv", "mcap", "mat", "bag", "db3", "hdf5", "columnar", "recipe", "runs", "params", "recording")


@pytest.mark.parametrize("name", FUZZED)
@settings(max_examples=int(os.environ.get("RIGFIT_FUZZ", "4")), deadline=None, derandomize=True, database=None,
          suppress_health_check=list(HealthCheck))  # fmt: skip
@given(random=st.randoms(use_true_random=False))
def test_spoilt_input_is_refused_in_words_or_read(tmp_path_factory: pytest.TempPathFactory, name: str, random) -> None:
    if name in ("bag", "db3"):
        pytest.importorskip("rosbags")
    if name in ("mat", "hdf5"):
        pytest.importorskip("h5py")
    target = TARGETS[name]
    seeds = SEEDS.setdefault(name, list(target.seeds()))
    data = mutations.mutated(random.choice(seeds), seeds, target.words, target.as_json, random)
    assert run_quietly(target, data, tmp_path_factory.mktemp("case")) in ("read", "refused")


SEEDS: dict[str, list[bytes]] = {}
