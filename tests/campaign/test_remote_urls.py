"""URLs are told from paths and shown without secrets; keys of an object store become files below one folder, each its own."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.campaign.remote.local_names import local_names
from pipeline.campaign.remote.urls import is_url, protocols, secrets, shown


@pytest.mark.parametrize(
    "word", ["s3://bucket/logs", "memory://x", "zip::a.zip", "zip://r.csv::s3://b/a.zip", "FILE:///x", "my-fs+x://y"]
)
def test_urls_are_told_from_paths(word: str) -> None:
    assert is_url(word)


@pytest.mark.parametrize(
    "word", ["r1.csv", "/data/r1.csv", "C:\\logs\\r1.csv", "a:b.csv", "../x", "-r.csv", "1::2.csv"]
)
def test_paths_are_no_urls(word: str) -> None:
    assert not is_url(word)


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("s3://lab-logs/a@b.csv", "s3://lab-logs/a@b.csv"),
        ("sftp://lab:secret@host:22/logs", "sftp://host:22/logs"),
        ("https://secret@host/logs", "https://host/logs"),
        ("ftp://lab:sec/ret@host/logs", "ftp://host/logs"),
        ("ftp://lab:s@cret@host/logs", "ftp://host/logs"),
        ("https://host/r1.csv?sig=secret#x", "https://host/r1.csv"),
        ("zip://r1.csv::https://lab:secret@host/a.zip?t=secret", "zip://r1.csv::https://host/a.zip"),
        ("abfs://container@account.example.org/logs", "abfs://container@account.example.org/logs"),
        ("s3://key:secret@bucket/logs", "s3://bucket/logs"),
        ("/data/it's me@home.csv", "/data/it's me@home.csv"),
    ],
)
def test_what_is_secret_is_not_shown(url: str, expected: str) -> None:
    assert shown(url) == expected
    assert bool(secrets(url)) == (url != expected)


def test_the_protocols_of_a_chain_are_named_in_order() -> None:
    assert protocols("zip::simplecache::s3://b/a.zip") == ["zip", "simplecache", "s3"]
    assert protocols("tar::/data/a.tar") == ["tar", "file"]
    assert protocols("logs/monday") == ["file"]


def test_keys_that_are_no_paths_are_written_as_in_urls() -> None:
    keys = [
        "r1.csv",
        "../r1.csv",
        "/abs.csv",
        "a//b.csv",
        "a\\..\\b.csv",
        "c.csv",
        "c.csv/d.csv",
        "x/./y.csv",
        "n\n.csv",
    ]
    assert [local_names(keys)[key] for key in keys] == [
        *("r1.csv", "%2E%2E/r1.csv", "%2Fabs.csv", "a%2F/b.csv", "a%5C..%5Cb.csv", "c.csv", "c.csv%2Fd.csv"),
        *("x/%2E/y.csv", "n%0A.csv"),
    ]


def test_names_that_only_windows_forbids_stay() -> None:
    assert local_names(["a:b?*.csv", "con.csv", "Ü 1%.csv"])["a:b?*.csv"] == "a:b?*.csv"


@given(st.sets(st.text("./\\a%2Fb", min_size=1, max_size=8).filter(lambda key: not key.endswith("/")), max_size=12))
def test_every_key_has_a_file_of_its_own_below_the_folder(keys: set[str]) -> None:
    names = local_names(sorted(keys))
    assert names.keys() == keys
    assert len(set(names.values())) == len(keys)
    folders = {str(above) for name in names.values() for above in PurePosixPath(name).parents}
    assert not folders & set(names.values())
    for name in names.values():
        assert not {"", ".", ".."} & set(name.split("/"))
        assert "\\" not in name
        inside = Path("/folder", name)
        assert inside.relative_to("/folder").as_posix() == name
    assert names == local_names(sorted(keys, reverse=True))
