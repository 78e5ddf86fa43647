"""Which sample of a block its message's stamp is: assumed, told, set by the recipe, judged where lengths differ."""

from __future__ import annotations

import numpy as np
import pytest
from mcap_logs import messages_of, open_log, rows, table, write_json

from pipeline.ingest.mapping import ChannelMap, Source
from pipeline.ingest.timebase import find_times

STEP_NS = 1_000_000


def block_log(tmp_path, lengths, stamped: str):
    messages, at = [], 0
    for n in lengths:
        first, last = at, at + n - 1
        stamp = first if stamped == "first" else last
        messages.append((10**9 + stamp * STEP_NS, {"force": [float(k) for k in range(first, first + n)]}))
        at += n
    return open_log(write_json(tmp_path / "a.mcap", {"/rig": messages}))


@pytest.mark.parametrize("lengths", [[50] * 20, [50] * 19 + [20], [50, 30, 50, 50, 40] * 4])
@pytest.mark.parametrize("stamped", ["first", "last"])
def test_stamps_of_the_sample_that_the_recipe_names_give_evenly_spaced_times(tmp_path, lengths, stamped):
    log = block_log(tmp_path, lengths, stamped)
    rig = table(log)
    find_times([Source(log, rig, "a.mcap")], ChannelMap(stamp=stamped))
    found = rows(rig)
    relative = found["log_time"] - found["log_time"][0]
    np.testing.assert_allclose(relative, found["force"] * 1e-3, atol=1e-9)


def test_the_assumption_is_told_with_what_it_would_cost_and_how_to_change_it(tmp_path):
    rig = table(block_log(tmp_path, [50] * 20, "first"))
    rows(rig)
    (note,) = rig.notes()
    assert note.level == "note"
    assert "taken as that of the first sample" in note.message
    assert "0.05 s (one block) too late" in note.message
    assert "`time: {stamp: last}`" in note.message


@pytest.mark.parametrize(("stamped", "level"), [("first", "note"), ("last", "warning")])
def test_blocks_of_different_length_betray_stamps_of_the_last_sample(tmp_path, stamped, level):
    rig = table(block_log(tmp_path, [50, 30, 50, 50, 40] * 4, stamped))
    rows(rig)
    (note,) = [note for note in rig.notes() if "under one stamp" in note.message]
    assert note.level == level
    assert ("speak for that" in messages_of([note])) == (level == "warning")
