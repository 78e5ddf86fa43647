"""Truncated, damaged and hostile MCAP files: what can be read is read, what is lost is told."""

from __future__ import annotations

import re
import struct

import numpy as np
import pytest
from mcap_logs import EPOCH, bare, messages_of, open_log, rows, stamped, table, write_json

from pipeline.errors import InputError
from pipeline.ingest.mcap_log.layout import survey_layout
from pipeline.ingest.mcap_log.reader import READER

COUNT = 4000
FORCE = np.round(100 * np.sin(0.01 * np.arange(COUNT)), 6)
MAGIC = b"\x89MCAP0\r\n"


@pytest.fixture
def log_bytes(tmp_path):
    def build(**options) -> bytes:
        messages = stamped([{"force": float(f)} for f in FORCE])
        return write_json(tmp_path / "whole.mcap", {"/rig": messages}, **{"chunk_size": 20_000, **options}).read_bytes()

    return build


def opened(tmp_path, content: bytes):
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    return open_log(path)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("layout", [{}, bare(), {"use_chunking": False}])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.77])
def test_a_truncated_log_is_read_up_to_the_damage_and_the_loss_is_told(tmp_path, log_bytes, compression, layout, share):
    whole = log_bytes(compression=compression, **layout)
    log = opened(tmp_path, whole[: int(share * len(whole))])
    force = rows(table(log))["force"]
    # Something beyond the last whole chunk must not be lost more than a chunk's worth (20 kB, some 370 messages).
    assert force.size > (0.9 * share - 0.05) * COUNT - 400
    np.testing.assert_array_equal(force, FORCE[: force.size])
    told = messages_of(log.notes)
    assert "warning" in told
    assert f"of {int(share * len(whole))}" in told
    until = float(re.search(r"can be read up to ([\d.e-]+) s", told)[1])
    assert until == pytest.approx((force.size - 1) * 1e-3, abs=1e-4)


def test_the_front_of_a_cut_chunk_is_read(tmp_path, log_bytes):
    for compression in ("zstd", "lz4", "none"):
        whole = log_bytes(compression=compression, chunk_size=1 << 20)
        chunk = survey_layout(tmp_path / "whole.mcap").segments[0]
        log = opened(tmp_path, whole[: chunk.offset + int(0.9 * chunk.length)])
        force = rows(table(log))["force"]
        assert 1000 < force.size < COUNT
        np.testing.assert_array_equal(force, FORCE[: force.size])
        told = messages_of(log.notes)
        packed = chunk.length - int(0.9 * chunk.length)
        assert f"had {chunk.length} bytes, {packed} of them (10 %) are not in the file" in told
        assert "could be had, the front part, unchecked" in told
        assert f"once reached to 3.999 s at least: at least {(COUNT - force.size) / 1000:.4g} s are lost" in told


def test_of_a_log_cut_outside_chunks_no_small_loss_is_claimed(tmp_path, log_bytes):
    whole = log_bytes(use_chunking=False)
    told = messages_of(opened(tmp_path, whole[: len(whole) // 2]).notes)
    assert "is lost, and nothing in the file tells how much it was" in told
    assert "%" not in told


def test_the_front_of_a_chunk_that_a_power_cut_filled_with_zeros_is_read(tmp_path, log_bytes):
    for compression in ("zstd", "lz4", "none"):
        whole = log_bytes(compression=compression, chunk_size=1 << 20)
        chunk = survey_layout(tmp_path / "whole.mcap").segments[0]
        written = int(0.8 * chunk.length)
        damaged = whole[: chunk.offset + written] + bytes(chunk.length - written) + whole[chunk.offset + chunk.length :]
        log = opened(tmp_path, damaged)
        force = rows(table(log))["force"]
        assert 1000 < force.size < COUNT
        np.testing.assert_array_equal(force, FORCE[: force.size])
        assert f"the last {chunk.length - written} of its {chunk.length} bytes are zeros" in messages_of(log.notes)


def test_a_log_of_one_chunk_cut_in_its_first_block_is_refused_with_what_was_in_it(tmp_path, log_bytes):
    whole = log_bytes(chunk_size=1 << 20)
    chunk = survey_layout(tmp_path / "whole.mcap").segments[0]
    with pytest.raises(InputError, match=r"which held 3.999 s, .* unpack as a whole or not at all.* 50 of the chunk's"):
        opened(tmp_path, whole[: chunk.offset + 50])


def test_cut_at_any_byte_the_log_is_read_in_part_or_refused_in_words(tmp_path):
    messages = stamped([{"force": float(i)} for i in range(30)])
    for options in ({"chunk_size": 300}, bare(chunk_size=300, compression="none"), bare(use_chunking=False)):
        whole = write_json(tmp_path / "whole.mcap", {"/rig": messages}, **options).read_bytes()
        footer = len(whole) - len(MAGIC)
        seen = 0
        for end in [*range(0, len(whole), 7), *range(footer - 30, len(whole))]:
            log, refused = opened_or_refused(tmp_path, whole[:end])
            if log is None:
                assert "damaged.mcap" in refused
                assert seen == 0
                continue
            force = rows(table(log))["force"]
            assert seen <= force.size
            assert force.tolist() == list(range(force.size))
            assert bool(log.notes) == (end < footer)
            seen = force.size
        assert seen == 30


def opened_or_refused(tmp_path, content: bytes):
    try:
        return opened(tmp_path, content), ""
    except InputError as error:
        return None, str(error)


def test_damage_in_the_index_loses_nothing_and_is_a_note(tmp_path, log_bytes):
    whole = log_bytes()
    log = opened(tmp_path, whole[: survey_layout(tmp_path / "whole.mcap").data_end + 30])
    assert rows(table(log))["force"].size == COUNT
    assert [note.level for note in log.notes] == ["note"]
    assert "all messages stand before it" in log.notes[0].message


def test_a_log_that_was_not_closed_is_told_as_such(tmp_path, log_bytes):
    whole = log_bytes(use_chunking=False, **bare())
    end = survey_layout(tmp_path / "whole.mcap").segments[-1]
    log = opened(tmp_path, whole[: end.offset + end.length])
    assert rows(table(log))["force"].size == COUNT
    assert "without its closing records" in messages_of(log.notes)


def test_zeros_after_a_power_cut_are_damage(tmp_path, log_bytes):
    whole = log_bytes()
    log = opened(tmp_path, whole[: len(whole) // 2] + bytes(5000))
    assert 1000 < rows(table(log))["force"].size < COUNT
    assert "cut off or damaged" in messages_of(log.notes)


def test_a_chunk_with_a_wrong_check_sum_is_left_out_and_told_with_its_time(tmp_path, log_bytes):
    whole = bytearray(log_bytes(compression="none"))
    chunk = survey_layout(tmp_path / "whole.mcap").segments[3]
    where = whole.index(b'"force"', chunk.offset + chunk.length // 2)
    whole[where + 1 : where + 6] = b"FORCE"
    log = opened(tmp_path, bytes(whole))
    found = rows(table(log))
    lost = COUNT - found["force"].size
    assert 300 < lost < 500
    note = next(n for n in log.notes if "check sum (CRC) is wrong" in n.message)
    assert note.level == "warning"
    assert note.span[1] - note.span[0] == pytest.approx((lost - 1) * 1e-3, abs=1e-9)
    assert not ((found["log_time"] >= note.span[0]) & (found["log_time"] <= note.span[1])).any()


def test_damaged_chunks_met_only_while_reading_are_told_then(tmp_path, log_bytes, monkeypatch):
    monkeypatch.setattr("pipeline.ingest.mcap_log.topics._SURVEYED_WHOLE", 0)
    monkeypatch.setattr("pipeline.ingest.mcap_log.topics._SURVEYED_PORTIONS", 2)
    monkeypatch.setattr("pipeline.ingest.mcap_log.batches._PORTION_BYTES", 1)
    whole = bytearray(log_bytes())
    chunk = survey_layout(tmp_path / "whole.mcap").segments[3]
    whole[chunk.offset + 100] ^= 0xFF
    log = opened(tmp_path, bytes(whole))
    assert not log.notes
    rig = table(log)
    assert rows(rig)["force"].size < COUNT
    assert "a chunk at byte" in messages_of(rig.notes())


def test_after_damage_in_the_middle_the_index_leads_on(tmp_path, log_bytes):
    whole = bytearray(log_bytes())
    segments = survey_layout(tmp_path / "whole.mcap").segments
    at = segments[3].offset - segments[3].chunk.data_offset - 8
    assert struct.unpack_from("<Q", whole, at)[0] == segments[3].length + segments[3].chunk.data_offset
    struct.pack_into("<Q", whole, at, 2**60)
    log = opened(tmp_path, bytes(whole))
    force = rows(table(log))["force"]
    lost = COUNT - force.size
    assert 300 < lost < 500
    np.testing.assert_array_equal(force[-100:], FORCE[-100:])
    told = messages_of(log.notes)
    assert "a record says that it has 1152921504606846976 bytes" in told
    assert "Reading went on behind them" in told


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty"),
        (MAGIC[:5], "ends after 5 bytes"),
        (b"time,force\n0,1\n", "this is no MCAP file: it begins with b'time,for'"),
        (bytes(100), "this is no MCAP file"),
        (MAGIC.replace(b"0", b"1") + bytes(50), "MCAP of version b'1'"),
        (MAGIC, "holds no messages"),
        (MAGIC + b"\x01" + struct.pack("<Q", 2**62) + b"abc", "nothing could be read.*only 3 are left"),
        (MAGIC + b"\x06" + struct.pack("<Q", 10) + bytes(10), "nothing could be read.*chunk's head is malformed"),
    ],
)
def test_files_of_which_nothing_can_be_read_are_refused(tmp_path, content, words):
    with pytest.raises(InputError, match=words) as caught:
        opened(tmp_path, content)
    assert "\n" not in str(caught.value)
    assert "damaged.mcap" in str(caught.value)


def test_a_folder_or_a_missing_file_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / "missing.mcap"):
        with pytest.raises(InputError, match="cannot be read"):
            READER.open(path)


def test_a_log_without_messages_is_refused(tmp_path):
    path = write_json(tmp_path / "a.mcap", {"/rig": []}, records={"run": {"a": "b"}})
    with pytest.raises(InputError, match="holds no messages"):
        open_log(path)


def test_a_declared_topic_without_messages_is_told(tmp_path):
    log = open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped([{"a": 1}] * 3), "/idle": []}))
    assert [t.name for t in log.tables] == ["rig"]
    assert "note: topic 'idle' has no messages" in messages_of(log.notes)


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(word: str) -> bytes:
    return struct.pack("<I", len(word)) + word.encode()


def chunk(data: bytes, size: int, compression: str, crc: int = 0) -> bytes:
    return record(
        6, struct.pack("<QQQI", EPOCH, EPOCH, size, crc) + text(compression) + struct.pack("<Q", len(data)) + data
    )


def messages(count: int = 3) -> bytes:
    content = record(4, struct.pack("<HH", 1, 0) + text("/rig") + text("json") + struct.pack("<I", 0))
    for i in range(count):
        content += record(5, struct.pack("<HIQQ", 1, i, EPOCH + i * 1000, EPOCH) + b'{"a": 1}')
    return content


def hostile(tmp_path, *chunks: bytes):
    return opened(tmp_path, MAGIC + record(1, text("") + text("")) + b"".join(chunks) + record(15, bytes(4)))


def test_chunks_that_would_burst_memory_are_refused(tmp_path):
    import zstandard

    def frame(size: int) -> bytes:
        compressor = zstandard.ZstdCompressor().compressobj()
        piece = bytes(1 << 20)
        return b"".join([compressor.compress(piece) for _ in range(size >> 20)] + [compressor.flush()])

    lying_frame = frame(300 << 20)
    for bomb, words in (
        (chunk(b"x" * 100, 1 << 40, "zstd"), "1099511627776 bytes; more than 268435456 are refused"),
        (chunk(frame(64 << 20), 64 << 20, "zstd"), "more than 1000 times as many"),
        (chunk(lying_frame, 1000, "zstd"), "it says that it unpacks to 1000 bytes, but more came out"),
    ):
        with pytest.raises(InputError, match=words):
            hostile(tmp_path, bomb)
        log = hostile(tmp_path, chunk(messages(), len(messages()), ""), bomb)
        assert rows(table(log))["a"].size == 3
        assert re.search(words, messages_of(log.notes))


def test_an_unknown_compression_is_named(tmp_path):
    with pytest.raises(InputError, match="compressed with 'snappy'; known are zstd, lz4, bz2, none"):
        hostile(tmp_path, chunk(b"abc", 10, "snappy"))


def test_a_chunk_whose_content_ends_within_a_record_is_read_in_part(tmp_path):
    content = messages()[:-4]
    log = hostile(tmp_path, chunk(content, len(content), ""), chunk(messages(2), len(messages(2)), ""))
    assert rows(table(log))["a"].size == 4
    assert "was read in part: its content ends within a record" in messages_of(log.notes)


def test_messages_of_an_undefined_channel_are_refused(tmp_path):
    content = record(5, struct.pack("<HIQQ", 9, 0, EPOCH, EPOCH) + b"{}")
    with pytest.raises(InputError, match="1 message, but of no channel that the file defines"):
        hostile(tmp_path, chunk(content, len(content), ""))


def test_unknown_records_are_skipped(tmp_path):
    log = hostile(tmp_path, record(0x80, b"private"), chunk(messages(), len(messages()), ""), record(0xFF, b""))
    assert rows(table(log))["a"].size == 3
