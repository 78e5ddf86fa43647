"""A log's reader is found by its content; what cannot be read is named with what to do."""

from __future__ import annotations

import gzip
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from memory_log import log_of

from pipeline.errors import InputError
from pipeline.ingest import registry
from pipeline.ingest.reader import RawLog, Reader


class Toy(Reader):
    name = "toy"
    suffixes = (".toy",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        return head.startswith(b"TOY!") or suffix == ".toy"

    def open(self, path: Path) -> RawLog:
        return log_of(path=str(path))


class Bag(Toy):
    name = "bag"
    suffixes = (".bag",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        return head.startswith(b"#ROSBAG")


class AnyText(Toy):
    name = "any text"
    suffixes = (".csv",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        return b"\0" not in head or suffix == ".csv"


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "readers", lambda: (AnyText(), Bag(), Toy()))


def file(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def test_content_counts_before_the_ending(tmp_path: Path, only: None) -> None:
    assert registry.reader_for(file(tmp_path, "log.csv", b"TOY!\0\1")).name == "toy"
    assert registry.reader_for(file(tmp_path, "log.toy", b"a,b\n1,2\n")).name == "any text"
    assert registry.reader_for(file(tmp_path, "bare.toy", b"\0\0\0\0")).name == "toy"
    assert registry.reader_for(file(tmp_path, "LOG.CSV", b"\0garbage")).name == "any text"


def test_the_formats_of_this_package_are_found_without_being_listed_anywhere() -> None:
    names = {suffix for reader in registry.readers() for suffix in reader.suffixes}
    assert {".mcap", ".mat", ".csv", ".tdms", ".mf4", ".h5", ".parquet", ".feather"} <= names


@pytest.mark.parametrize(
    ("name", "content", "kind", "advice"),
    [
        ("bag_0.db3.zstd", b"\x28\xb5\x2f\xfd\0", "zstd", "zstd -d bag_0.db3.zstd"),
        ("report.pdf", b"%PDF-1.7\n", "PDF", "the log itself"),
        ("log.csv", b"\x89PNG\r\n\x1a\n", "picture", "the log itself"),
        ("old.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Office", "CSV"),
        ("page.csv", b"<!DOCTYPE html><html>404", "HTML", "fetch the log again"),
        ("x.zst", b"\x28\xb5\x2f\xfd\0", "zstd", "unpack"),
    ],
)
def test_a_known_format_that_is_not_read_is_named(
    tmp_path: Path, only: None, name: str, content: bytes, kind: str, advice: str
) -> None:
    with pytest.raises(InputError) as caught:
        registry.reader_for(file(tmp_path, name, content))
    assert kind in str(caught.value)
    assert advice in str(caught.value)
    assert name in str(caught.value)


def test_packed_logs_are_to_be_unpacked(tmp_path: Path, only: None) -> None:
    with gzip.open(tmp_path / "log.csv.gz", "wb") as packed:
        packed.write(b"time,force\n0,1\n")
    with zipfile.ZipFile(tmp_path / "book.xlsx", "w") as book:
        book.writestr("xl/workbook.xml", "<x/>")
    with pytest.raises(InputError, match=r"gzip.*gunzip"):
        registry.reader_for(tmp_path / "log.csv.gz")
    with pytest.raises(InputError, match=r"xlsx.*save the workbook as CSV"):
        registry.reader_for(tmp_path / "book.xlsx")


def test_a_reader_for_a_format_that_is_not_read_here_takes_it(tmp_path: Path, only: None) -> None:
    assert registry.reader_for(file(tmp_path, "a.bag", b"#ROSBAG V2.0\n")).name == "bag"


def test_what_is_no_log_at_all_is_answered_plainly(tmp_path: Path, only: None) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        registry.reader_for(tmp_path / "absent.csv")
    with pytest.raises(InputError, match="is a folder"):
        registry.reader_for(tmp_path)
    with pytest.raises(InputError, match=r"is empty \(0 bytes\)"):
        registry.reader_for(file(tmp_path, "empty.csv", b""))
    with pytest.raises(InputError) as caught:
        registry.reader_for(file(tmp_path, "blob.bin", b"\0\1\2\3garbage"))
    assert "no log of a known kind" in str(caught.value)
    assert "toy (.toy)" in str(caught.value)


def test_a_broken_plug_in_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    class Entry:
        name, value, dist = "acme", "acme_logs:READER", None

        def load(self) -> Reader:
            raise ImportError("No module named 'nptdms'")

    monkeypatch.setattr(registry, "entry_points", lambda group: [Entry()])
    registry.readers.cache_clear()
    with pytest.raises(InputError, match=r"log reader 'acme'.*nptdms"):
        registry.readers()
    registry.readers.cache_clear()


def test_a_plug_in_becomes_a_reader(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    class Entry:
        name, value, dist = "toy", "toy_logs:READER", None

        def load(self) -> Reader:
            return Toy()

    monkeypatch.setattr(registry, "entry_points", lambda group: [Entry()])
    registry.readers.cache_clear()
    assert registry.open_log(file(tmp_path, "x.toy", b"TOY!\0")).format == "memory"
    registry.readers.cache_clear()


def test_looking_for_readers_imports_nothing_heavy() -> None:
    code = (
        "import sys; from pipeline.ingest.registry import readers; readers(); "
        "print(*[m for m in ('scipy', 'pandas', 'matplotlib', 'numba', 'lmfit', 'pint') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
