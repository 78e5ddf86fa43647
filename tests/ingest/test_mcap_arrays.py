"""Lists of numbers in messages: blocks of samples with their times, or vectors."""

from __future__ import annotations

import numpy as np
import pytest
from mcap_logs import EPOCH, messages_of, open_log, rows, stamped, table, write_json

MS = 1_000_000


def cut(signal: np.ndarray, length: int, name: str = "force") -> list[dict]:
    return [{name: signal[i : i + length].tolist()} for i in range(0, signal.size, length)]


def read(tmp_path, messages, step=100 * MS, **options):
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": stamped(messages, step)}, **options)))
    return rig, rows(rig)


@pytest.mark.parametrize("length", [4, 5, 7, 8, 100])
def test_a_sampled_signal_in_pieces_becomes_one_row_a_sample(tmp_path, length):
    signal = np.sin(np.arange(length * 30) * 0.05)
    _, found = read(tmp_path, cut(signal, length), step=length * MS)
    np.testing.assert_array_equal(found["force"], signal)
    np.testing.assert_allclose(found["log_time"], np.arange(signal.size) * 1e-3, rtol=0, atol=1e-9)


def test_noise_beside_a_sampled_signal_is_sampled_too(tmp_path):
    rng = np.random.default_rng(1)
    signal, noise = np.sin(np.arange(200) * 0.05), rng.standard_normal(200)
    messages = [a | b for a, b in zip(cut(signal, 5), cut(noise, 5, "noise"), strict=True)]
    _, found = read(tmp_path, messages)
    np.testing.assert_array_equal(found["noise"], noise)


def test_scalars_beside_blocks_are_repeated(tmp_path):
    messages = [{"force": list(range(10)), "current": i, "state": f"s{i}"} for i in range(3)]
    _, found = read(tmp_path, messages)
    np.testing.assert_array_equal(found["current"], np.repeat([0, 1, 2], 10))
    assert found["state"].tolist() == np.repeat(["s0", "s1", "s2"], 10).tolist()


@pytest.mark.parametrize("width", [2, 3, 4, 6, 7])
def test_short_lists_of_different_quantities_are_vectors(tmp_path, width):
    base = np.random.default_rng(width).standard_normal(width) * 10
    messages = [{"position": (base + 0.01 * np.sin(0.3 * i)).tolist(), "force": 1.0 * i} for i in range(40)]
    rig, found = read(tmp_path, messages)
    assert [c.name for c in rig.channels] == ["log_time", *(f"position.{j}" for j in range(width)), "force"]
    assert found["force"].size == 40
    np.testing.assert_array_equal(found[f"position.{width - 1}"], [m["position"][-1] for m in messages])


def test_a_covariance_and_a_length_fixed_by_the_schema_are_vectors(tmp_path):
    schema = {"properties": {"gains": {"type": "array", "minItems": 12, "maxItems": 12, "items": {"type": "number"}}}}
    messages = [{"covariance": [float(i)] * 9, "gains": list(range(12)), "force": i} for i in range(5)]
    _, found = read(tmp_path, messages, schemas={"/rig": schema})
    assert found["covariance.8"].tolist() == [0, 1, 2, 3, 4]
    assert found["gains.11"].tolist() == [11] * 5


def test_a_long_list_of_fixed_length_and_a_short_one_that_runs_on_are_samples(tmp_path):
    array = {"type": "array", "minItems": 10, "maxItems": 10, "items": {"type": "number"}}
    signal = np.sin(np.arange(400) * 0.03)
    _, found = read(tmp_path, cut(signal, 10), schemas={"/rig": {"properties": {"force": array}}})
    np.testing.assert_array_equal(found["force"], signal)
    array |= {"minItems": 100, "maxItems": 100}
    _, found = read(
        tmp_path, [{"force": [i] * 100} for i in range(3)], schemas={"/rig": {"properties": {"force": array}}}
    )
    assert found["force"].size == 300


def test_a_vector_beside_blocks_keeps_its_place(tmp_path):
    messages = [{"force": list(range(100)), "offset": [i, -i, 2 * i]} for i in range(4)]
    rig, found = read(tmp_path, messages)
    np.testing.assert_array_equal(found["offset.1"], np.repeat([0, -1, -2, -3], 100))
    log = open_log(tmp_path / "a.mcap")
    assert (
        "force: blocks of 100 samples, the first at the message's stamp; offset (3): vectors"
        in log.details["topic rig"]
    )
    assert [note.level for note in rig.notes()] == ["note"]


def test_lists_in_lists_are_vectors_of_each_sample(tmp_path):
    messages = [{"xyz": [[100 * i + k, -k, 0.5] for k in range(20)]} for i in range(4)]
    _, found = read(tmp_path, messages)
    np.testing.assert_array_equal(found["xyz.0"], [100 * i + k for i in range(4) for k in range(20)])
    assert found["xyz.2"].size == 80


def test_lists_of_objects_are_samples_of_their_members(tmp_path):
    messages = [{"samples": [{"force": 10 * i + k, "on": True} for k in range(10)]} for i in range(4)]
    _, found = read(tmp_path, messages)
    np.testing.assert_array_equal(found["samples.force"], np.arange(40))
    np.testing.assert_array_equal(found["samples.on"], np.ones(40))


def test_blocks_of_changing_length_are_timed_by_the_next_stamp(tmp_path):
    lengths = [10, 12, 8, 11, 9]
    starts = np.cumsum([0, *lengths])
    signal = np.arange(starts[-1]) * 0.5
    messages = [
        (EPOCH + int(s) * MS, {"force": signal[s : s + n].tolist()}) for s, n in zip(starts, lengths, strict=False)
    ]
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": messages}, chunk_size=10)))
    found = rows(rig)
    np.testing.assert_array_equal(found["force"], signal)
    np.testing.assert_allclose(found["log_time"], np.arange(signal.size) * 1e-3, rtol=0, atol=1e-9)


def test_a_missing_message_leaves_a_gap_and_does_not_stretch_its_neighbour(tmp_path):
    messages = stamped(cut(np.arange(1000.0), 10), 10 * MS)
    del messages[40:42]
    rig = table(open_log(write_json(tmp_path / "a.mcap", {"/rig": messages}, chunk_size=500)))
    found = rows(rig)
    np.testing.assert_allclose(found["log_time"], found["force"] * 1e-3, rtol=0, atol=1e-9)
    assert "1 block of samples followed by a gap" in messages_of(rig.notes())


def test_a_short_list_is_filled_up_with_nan_and_told(tmp_path):
    messages = [{"force": list(range(10)), "current": list(range(10))} for _ in range(30)]
    messages[3]["current"] = messages[3]["current"][:6]
    del messages[5]["current"]
    rig, found = read(tmp_path, messages)
    assert found["force"].size == 300
    assert np.flatnonzero(np.isnan(found["current"])).tolist() == [36, 37, 38, 39, *range(50, 60)]
    assert "1 list shorter than others of the same message" in messages_of(rig.notes())


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), (None, 1e3)])
def test_times_in_the_message_that_run_on_time_the_samples(tmp_path, unit, factor):
    times = np.cumsum(np.random.default_rng(0).uniform(0.8e-3, 1.2e-3, 500))
    late = np.random.default_rng(1).integers(0, 3 * MS, 50)  # messages arrive with a jitter
    messages = [
        (EPOCH + round(times[10 * i] * 1e9) + int(late[i]) * (i > 0),
         {"t": (times[10 * i : 10 * i + 10] * factor).tolist(), "force": times[10 * i : 10 * i + 10].tolist()})
        for i in range(50)
    ]  # fmt: skip
    schema = {"properties": {"t": {"type": "array", "items": {"type": "number", "unit": unit}}}} if unit else None
    path = write_json(tmp_path / "a.mcap", {"/rig": messages}, schemas={"/rig": schema}, chunk_size=700)
    found = rows(table(open_log(path)))
    np.testing.assert_allclose(found["log_time"], times - times[0], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(found["t"], times * factor)


def test_times_in_the_message_that_start_anew_count_from_its_stamp(tmp_path):
    offsets = [0.0, 1.0, 2.5, 4.0]
    rig, found = read(tmp_path, [{"time": offsets, "force": [1, 2, 3, 4]} for _ in range(5)], step=5 * MS)
    expected = [(5 * i + o) * 1e-3 for i in range(5) for o in offsets]
    np.testing.assert_allclose(found["log_time"], expected, rtol=0, atol=1e-9)
    assert "time" not in found
    np.testing.assert_array_equal(rows(rig, ["log_time"])["log_time"], found["log_time"])


def test_one_message_alone_needs_a_rate_or_times(tmp_path):
    _, found = read(tmp_path, [{"force": list(range(50)), "sample_rate": 500}])
    np.testing.assert_allclose(found["log_time"], np.arange(50) / 500)
    _, found = read(tmp_path, [{"force": list(range(50)), "time": (np.arange(50) * 0.25).tolist()}])
    np.testing.assert_allclose(found["log_time"], np.arange(50) * 0.25)
    rig, found = read(tmp_path, [{"force": list(range(50))}])
    assert rig.time_channel is None
    assert list(found) == ["force"]
    assert "nothing in it tells their rate" in messages_of(rig.notes())


def test_empty_blocks_give_no_rows(tmp_path):
    messages = [{"force": list(range(9)) if i % 2 else []} for i in range(6)]
    _, found = read(tmp_path, messages)
    assert found["force"].tolist() == list(range(9)) * 3


def test_a_bare_list_or_number_as_message_is_called_value(tmp_path):
    _, found = read(tmp_path, [1.5, 2.5, 3.5])
    assert found["value"].tolist() == [1.5, 2.5, 3.5]
    _, found = read(tmp_path, [list(range(10)), list(range(10))])
    assert found["value"].size == 20


def test_blocks_are_cut_to_a_bounded_number_of_rows(tmp_path, monkeypatch):
    monkeypatch.setattr("pipeline.ingest.mcap_log.table.BLOCK_ROWS", 128)
    signal = np.arange(1000.0)
    path = write_json(tmp_path / "a.mcap", {"/rig": stamped(cut(signal, 50), 50 * MS)}, chunk_size=600)
    blocks = list(table(open_log(path)).blocks())
    assert [len(block["force"]) for block in blocks] == [128] * 7 + [104]
    np.testing.assert_array_equal(np.concatenate([block["force"] for block in blocks]), signal)
