"""Chunks too large to be held in memory: those that are not packed are walked over, others are refused unread."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from mcap_logs import messages_of, open_log, rows, stamped, table, write_json

from pipeline.errors import InputError
from pipeline.ingest.mcap_log import batches, layout
from pipeline.ingest.mcap_log import table as topic_table

COUNT = 5000
FORCE = np.round(100 * np.sin(0.01 * np.arange(COUNT)), 6)


@pytest.fixture
def little_memory(monkeypatch):
    for module in (layout, batches):
        monkeypatch.setattr(module, "LARGEST_CHUNK", 50_000)
    monkeypatch.setattr(layout, "_RUN_BYTES", 20_000)


def written(path: Path, **options) -> Path:
    return write_json(path, {"/rig": stamped([{"force": float(f)} for f in FORCE])}, chunk_size=1 << 24, **options)


def test_a_large_chunk_that_is_not_packed_is_read_whole(tmp_path, little_memory):
    log = open_log(written(tmp_path / "a.mcap", compression="none"))
    np.testing.assert_array_equal(rows(table(log))["force"], FORCE)
    assert not messages_of(log.notes)
    segments = layout.survey_layout(tmp_path / "a.mcap").segments
    assert len(segments) > 5
    assert max(segment.size for segment in segments) < 25_000


def test_of_a_large_chunk_that_is_cut_off_the_front_is_read(tmp_path, little_memory):
    whole = written(tmp_path / "a.mcap", compression="none").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 2])
    log = open_log(cut)
    force = rows(table(log))["force"]
    assert force.size > 0.4 * COUNT
    np.testing.assert_array_equal(force, FORCE[: force.size])
    assert re.search("cut off or damaged", messages_of(log.notes))


def test_a_large_packed_chunk_is_refused_and_what_to_do_is_said(tmp_path, little_memory):
    path = written(tmp_path / "a.mcap", compression="zstd")
    with pytest.raises(InputError, match=r"more than 50000 are refused\. Write the log anew with chunks of a few MB"):
        open_log(path)


def test_messages_of_a_chunk_are_the_same_however_many_are_decoded_at_once(tmp_path, monkeypatch):
    path = written(tmp_path / "a.mcap", compression="zstd")
    at_once = rows(table(open_log(path)))
    monkeypatch.setattr(topic_table, "_DECODED_BYTES", 1000)
    in_parts = rows(table(open_log(path)))
    for name, values in at_once.items():
        np.testing.assert_array_equal(in_parts[name], values)


@pytest.mark.parametrize("size", [3_000, 20_000, 1 << 20])
def test_messages_outside_chunks_are_the_same_in_windows_of_any_size(tmp_path, monkeypatch, size):
    path = write_json(tmp_path / "a.mcap", {"/rig": stamped([{"force": float(f)} for f in FORCE])}, use_chunking=False)
    monkeypatch.setattr(layout, "_RUN_BYTES", size)
    np.testing.assert_array_equal(rows(table(open_log(path)))["force"], FORCE)
