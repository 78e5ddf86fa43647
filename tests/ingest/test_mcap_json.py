from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_logs import EPOCH, bare, messages_of, open_log, rows, stamped, table, write_json

from pipeline.errors import InputError

LAYOUTS = {
    "chunked with summary": {},
    "no summary, no index": bare(),
    "not chunked": {"use_chunking": False},
    "not chunked, no summary": bare(use_chunking=False),
    "tiny chunks": {"chunk_size": 64},
    "no check sums": {"enable_crcs": False},
}


def samples(count: int) -> list[dict[str, float]]:
    return [{"force": 100.0 * math.sin(0.01 * i), "displacement": 1e-3 * i} for i in range(count)]


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_numbers_and_times_come_back_whatever_the_file_layout(tmp_path, compression, layout):
    messages = samples(700)
    path = write_json(tmp_path / "a.mcap", {"/rig": stamped(messages)}, compression=compression, **LAYOUTS[layout])
    log = open_log(path)
    rig = table(log, "rig")
    read = rows(rig)
    assert [c.name for c in rig.channels] == ["log_time", "force", "displacement"]
    assert rig.time_channel == "log_time"
    np.testing.assert_array_equal(read["force"], [m["force"] for m in messages])
    np.testing.assert_array_equal(read["displacement"], [m["displacement"] for m in messages])
    np.testing.assert_allclose(read["log_time"], np.arange(700) * 1e-3, rtol=0, atol=1e-12)
    assert not log.notes
    assert not rig.notes()


def test_epoch_stamps_give_the_date_and_machine_stamps_do_not(tmp_path):
    dated = write_json(tmp_path / "a.mcap", {"/rig": stamped(samples(3), start=1_700_000_000_250_000_000)})
    assert table(open_log(dated)).absolute_start == "2023-11-14T22:13:20.250000+00:00"
    undated = write_json(tmp_path / "b.mcap", {"/rig": stamped(samples(3), start=5_000)})
    rig = table(open_log(undated))
    assert rig.absolute_start is None
    assert rows(rig)["log_time"][0] == 0.0


def test_topics_are_tables_on_one_clock(tmp_path):
    path = write_json(
        tmp_path / "a.mcap",
        {
            "/bench": stamped(samples(50)),
            "/device/slow": stamped([{"t": i} for i in range(5)], 10_000_000, EPOCH + 500),
        },
        chunk_size=256,
    )
    log = open_log(path)
    assert {t.name for t in log.tables} == {"bench", "device/slow"}
    assert rows(table(log, "bench"))["log_time"][0] == 0.0
    np.testing.assert_allclose(rows(table(log, "device/slow"))["log_time"], 5e-7 + np.arange(5) * 1e-2, atol=1e-12)


def test_a_rare_topic_is_found_in_the_middle_of_a_large_log(tmp_path, monkeypatch):
    monkeypatch.setattr("pipeline.ingest.mcap_log.topics._SURVEYED_WHOLE", 0)
    monkeypatch.setattr("pipeline.ingest.mcap_log.batches._PORTION_BYTES", 1000)
    events = [(EPOCH + 777_500_000, {"code": 7})]
    for name, options in (("a", {}), ("b", bare()), ("c", bare(use_chunking=False))):
        topics = {"/rig": stamped(samples(2000)), "/events": events}
        log = open_log(write_json(tmp_path / f"{name}.mcap", topics, chunk_size=2000, **options))
        assert {t.name for t in log.tables} == {"rig", "events"}
        assert rows(table(log, "events"))["code"].tolist() == [7.0]
        assert rows(table(log, "rig"))["force"].size == 2000


def test_nested_fields_have_dotted_names_and_stamps_become_seconds(tmp_path):
    message = {
        "wrench": {"force": {"x": 1.5, "y": -2}},
        "header": {"stamp": {"sec": 12, "nanosec": 250_000_000}, "id": "a"},
    }
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped([message] * 3)})))
    read = rows(rig)
    assert set(read) == {"log_time", "wrench.force.x", "wrench.force.y", "header.stamp", "header.id"}
    assert read["wrench.force.y"].tolist() == [-2.0] * 3
    assert read["header.stamp"].tolist() == [12.25] * 3
    assert {c.name: c.unit for c in rig.channels}["header.stamp"] == "s"
    assert read["header.id"].tolist() == ["a"] * 3
    assert {c.name for c in rig.channels if c.is_text} == {"header.id"}


def test_missing_null_nan_truth_and_large_numbers(tmp_path):
    payloads = [
        b'{"a": 1, "b": true, "c": 123456789012345678901234567890}',
        b'{"a": null, "b": false}',
        b'{"b": true, "c": -9007199254740993, "a": NaN}',
        b'{"a": Infinity, "b": null, "c": 1e400}',
    ]
    read = rows(table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped(payloads)}))))
    np.testing.assert_array_equal(read["a"], [1, np.nan, np.nan, np.inf])
    np.testing.assert_array_equal(read["b"], [1, 0, 1, np.nan])
    np.testing.assert_array_equal(read["c"], [123456789012345678901234567890.0, np.nan, -9007199254740993.0, np.inf])


def test_a_field_that_changes_its_type_becomes_nan_and_is_told(tmp_path):
    messages = [{"force": float(i)} for i in range(20)]
    messages[7] = {"force": "overload"}
    messages[8] = {"force": {"x": 1.0}}
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped(messages)})))
    force = rows(rig)["force"]
    assert np.flatnonzero(np.isnan(force)).tolist() == [7, 8]
    assert "'force' is a number in most messages but not in 1 value" in messages_of(rig.notes())


def test_malformed_messages_are_left_out_and_counted(tmp_path):
    payloads: list[object] = list(samples(30))
    payloads[4], payloads[9], payloads[20] = b'{"force": 1', b"\xff\xfe\x00", b""
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped(payloads)})))
    read = rows(rig)
    assert read["force"].size == 27
    assert 0.004 not in read["log_time"]
    assert "3 of 30 messages malformed and left out, the first at 0.004 s" in messages_of(rig.notes())


def test_payloads_that_only_together_make_sense_are_not_mixed_up(tmp_path):
    payloads = [b'{"a": 1}', b'{"a": [2', b"3]}", b'{"a": 4}, {"a": 5}', b'{"a": 6}']
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped(payloads)})))
    assert rows(rig)["a"].tolist() == [1.0, 6.0]


def test_a_log_of_malformed_messages_only_is_refused(tmp_path):
    path = write_json(tmp_path / "a.mcap", {"/rig": stamped([b"{", b"}"])})
    with pytest.raises(InputError, match=r"a\.mcap.*topic 'rig'.*malformed json"):
        open_log(path)


def test_units_come_from_schema_nested_items_references_then_channel_metadata(tmp_path):
    vector = {"type": "object", "properties": {"x": {"type": "number", "unit": "kN"}, "y": {"type": "number"}}}
    schema = {
        "type": "object",
        "$defs": {"vector": vector},
        "properties": {
            "force": {"$ref": "#/$defs/vector"},
            "trace": {"type": "array", "items": {"type": "number", "unit": "mm"}},
            "current": {"type": "number"},
            "angles": {"type": "array", "unit": "deg", "minItems": 3, "maxItems": 3, "items": {"type": "number"}},
            "speed": {"anyOf": [{"type": "number", "unit": "rpm"}, {"type": "null"}]},
        },
    }
    message = {"force": {"x": 1, "y": 2}, "trace": list(range(10)), "current": 1, "angles": [1, 2, 3], "speed": 9}
    rig = table(
        open_log(
            write_json(
                tmp_path / "a.mcap",
                {"/rig": stamped([message] * 5)},
                schemas={"/rig": schema},
                channel_metadata={"/rig": {"unit.current": "mA", "unit.force.x": "lbf", "unit.force.y": "N"}},
            )
        )
    )
    units = {c.name: c.unit for c in rig.channels}
    assert units["force.x"] == "kN"
    assert units["force.y"] == "N"
    assert units["trace"] == "mm"
    assert units["current"] == "mA"
    assert units["angles.2"] == "deg"
    assert units["speed"] == "rpm"
    assert units["log_time"] == "s"


def test_a_schema_that_refers_to_itself_or_is_no_json_does_no_harm(tmp_path):
    again = {"$ref": "#"}
    schema = {
        "anyOf": [again, again],
        "properties": {"b": {"type": "number", "unit": "N"}, "a": again, "c": again, "d": {"items": again}},
    }
    path = write_json(tmp_path / "a.mcap", {"/rig": stamped([{"b": 1}] * 3)}, schemas={"/rig": schema})
    assert {c.name: c.unit for c in table(open_log(path)).channels}["b"] == "N"


def test_metadata_records_and_channel_metadata_give_conditions(tmp_path):
    path = write_json(
        tmp_path / "a.mcap",
        {"/rig": stamped(samples(3)), "/aux": stamped(samples(3))},
        records={"run": {"static_load": "52 kN", "operator": "A"}, "rig": {"operator": "B", "pads": "2"}},
        channel_metadata={
            "/rig": {"unit.force": "N", "sample": "b", "static_load": "1 kN", "calibrated": "may"},
            "/aux": {"calibrated": "june", "offered_qos_profiles": "- history: 3"},
        },
        attachment=b"xyz",
    )
    log = open_log(path)
    assert log.metadata == {"static_load": "52 kN", "pads": "2", "sample": "b"}
    told = messages_of(log.notes)
    assert "several values for 'operator'" in told
    assert "several values for 'calibrated'" in told
    assert log.details["metadata records"] == "run, rig"
    assert log.details["attachments"] == "1, not read"


def test_only_asked_channels_are_decoded(tmp_path):
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped(samples(10))})))
    assert list(rows(rig, ["displacement"])) == ["displacement"]
    assert list(rows(rig, ["log_time"])) == ["log_time"]
    assert rows(rig, ["displacement", "log_time"])["displacement"].tolist() == rows(rig)["displacement"].tolist()


def test_messages_out_of_order_keep_the_order_of_the_file_and_are_told(tmp_path):
    messages = stamped(samples(10))
    messages[3], messages[6] = messages[6], messages[3]
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": messages})))
    read = rows(rig)
    assert read["log_time"][3] == pytest.approx(0.006)
    assert read["displacement"][3] == pytest.approx(0.006)
    assert "logged after a later one" in messages_of(rig.notes())


def test_stamps_that_are_all_the_same_are_no_time(tmp_path):
    rig = table(
        open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped([{"t": i * 0.1, "f": 1} for i in range(9)], 0)}))
    )
    assert rig.time_channel is None
    assert "t" in rows(rig)
    assert "same time stamp" in messages_of(rig.notes())


def test_a_field_called_log_time_does_not_clash_with_the_stamp(tmp_path):
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped([{"log_time": 5.0}] * 4)})))
    read = rows(rig)
    assert read["log_time"].tolist() == [5.0] * 4
    assert rig.time_channel != "log_time"
    assert read[rig.time_channel][1] == pytest.approx(1e-3)


def test_a_field_that_turns_up_late_in_a_large_log_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("pipeline.ingest.mcap_log.topics._SURVEYED_WHOLE", 0)
    messages = samples(1000)
    messages[600]["fault"] = 3
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped(messages)})))
    assert "fault" not in rows(rig)
    assert "'fault' turned up" in messages_of(rig.notes())


def test_keys_that_are_data_are_refused(tmp_path):
    path = write_json(
        tmp_path / "a.mcap", {"/rig": stamped([{f"id{i}{j}": j for j in range(100)} for i in range(100)])}
    )
    with pytest.raises(InputError, match="thousands of different fields"):
        open_log(path)


def test_unsupported_encodings_are_named(tmp_path):
    from mcap.writer import Writer

    def write(name: str, with_json: bool):
        with (tmp_path / name).open("wb") as file:
            writer = Writer(file)
            writer.start()
            cbor = writer.register_channel("/cbor", "cbor", 0)
            writer.add_message(cbor, EPOCH, b"\xa1\x61\x61\x01", EPOCH)
            if with_json:
                writer.add_message(writer.register_channel("/rig", "json", 0), EPOCH, b'{"a": 1}', EPOCH)
            writer.finish()
        return tmp_path / name

    with pytest.raises(InputError, match=r"all\.mcap.*'cbor' is not supported.*json, cdr .*protobuf"):
        open_log(write("all.mcap", with_json=False))
    log = open_log(write("some.mcap", with_json=True))
    assert [t.name for t in log.tables] == ["rig"]
    assert "topic 'cbor' was left out: its message encoding 'cbor' is not supported" in messages_of(log.notes)


numbers = st.one_of(st.floats(allow_nan=False), st.integers(-(2**70), 2**70), st.booleans(), st.none())
keys = st.sampled_from(["a", "b", "c c", "d.e", "é"])
flat = st.dictionaries(keys, st.one_of(numbers, st.text(max_size=5)), max_size=4)
nested = st.dictionaries(keys, st.one_of(numbers, flat), max_size=4)


def flattened(message: dict, prefix: tuple[str, ...] = ()) -> dict[tuple[str, ...], object]:
    found: dict[tuple[str, ...], object] = {}
    for key, value in message.items():
        found |= flattened(value, (*prefix, key)) if isinstance(value, dict) else {(*prefix, key): value}
    return found


@settings(max_examples=60, deadline=None)
@given(messages=st.lists(nested, min_size=1, max_size=12))
def test_any_json_messages_read_as_the_official_reader_and_json_read_them(tmp_path_factory, messages):
    path = write_json(tmp_path_factory.mktemp("h") / "a.mcap", {"/rig": stamped(messages)}, chunk_size=100)
    with path.open("rb") as file:
        plain = [flattened(json.loads(m.data)) for _, _, m in make_reader(file).iter_messages(log_time_order=False)]
    rig = table(open_log(path))
    read = rows(rig)
    assert all(column.size == len(messages) for column in read.values())
    fields = {c.name: c for c in rig.channels}
    for path_, name in {(p, ".".join(p)) for message in plain for p in message}:
        values = [message.get(path_) for message in plain]
        if sum(".".join(p) == name for p in {p for message in plain for p in message}) > 1:
            continue  # two paths of one dotted name: the first is kept, told elsewhere
        if all(value is None for value in values):
            continue
        if fields[name].is_text:
            expected = [value if isinstance(value, str) else None for value in values]
            got = [word if isinstance(value, str) else None for word, value in zip(read[name], values, strict=True)]
            assert got == expected
        else:
            expected = [float(v) if isinstance(v, int | float) else math.nan for v in values]
            known = {"Infinity": math.inf, "-Infinity": -math.inf, "inf": math.inf, "-inf": -math.inf}
            expected = [known.get(v, e) if isinstance(v, str) else e for v, e in zip(values, expected, strict=True)]
            np.testing.assert_array_equal(read[name], expected)
