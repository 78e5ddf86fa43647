"""Captions of the gearbox's report answer from the tables that they stand under, also where these are bad or empty."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.findings import Parameter
from pipeline.findings.figures import Value
from pipeline.rigs.gearbox.outcome import captions


def slope(value: float | None, half: float = 0.01) -> Parameter:
    limits = None if value is None else (value - half, value + half)
    return Parameter(
        name="torque_transfer_slope", symbol="a", value=value, std_error=None if value is None else half / 1.96, ci95=limits,
        unit="1", description="no rise was seen",
    )  # fmt: skip


def test_a_slope_below_one_says_what_does_not_come_out() -> None:
    assert captions.transferred(slope(0.545)).endswith("0.545 N m (95 %: 0.535 to 0.555 N m) come out, not all of it.")
    assert captions.transferred(slope(0.995)).endswith("come out: all of it, within the error.")
    assert captions.transferred(slope(None)) == "It is not told: no rise was seen"


def test_runs_without_a_stage_and_events_not_seen_are_told() -> None:
    runs = pd.DataFrame({"run": ["g1", "g2", "g3"], "complete": [True, False, True]})
    assert captions.complete(runs, ["g1", "g3"]) == "Yes, all 2."
    assert captions.complete(runs, ["g1", "g2", "g3"]) == "No, stages are missing in g2."
    events = pd.DataFrame({"event": ["unlock", "relock", "unlock"]})
    assert captions.seen(events, 2, ["unlock", "relock"]) == "3 of 4 events are found."
    assert captions.seen(events.head(2), 1, ["unlock", "relock"]).startswith("All 2 events")


def test_values_beside_the_paper_skip_what_is_not_printed_or_not_found() -> None:
    assert captions.beside_paper([(Value(1.1), 1.0), (Value(2.0), None), (Value(None), 1.0)]) == (
        "From the paper's they differ by 10.0 % at most."
    )
    assert captions.beside_paper([(Value(2.0), None)]) == "No run has a speed of the paper's."


def test_mesh_lines_in_fos_are_told() -> None:
    stages = pd.DataFrame({"run": "g1", "stage": ["fos", "sos"], "start": [0.0, 10.0], "end": [10.0, 20.0]})
    ridge = pd.DataFrame({"run": "g1", "time": np.arange(10.05, 20.0, 0.1), "slip": 1.0})
    assert captions.slips(stages, ridge) == "Mesh lines stand in 100 % of SOS, 0 % of FOS."
    slipping = ridge.assign(time=ridge["time"] - 5.0)
    assert captions.slips(stages, slipping) == "Mesh lines stand in 50 % of SOS, 50 % of FOS."
    assert captions.slips(stages.head(0), ridge) == "Neither FOS nor SOS is there."


def test_a_model_that_misses_the_torque_is_not_called_an_explanation() -> None:
    measured = np.sin(np.linspace(0, 9, 50))
    table = pd.DataFrame({"measured": measured, "predicted": measured + 0.01})
    assert captions.explained(table).startswith("Yes")
    assert captions.explained(table.assign(predicted=0.0)).startswith("No")


def test_clocks_that_were_shifted_are_counted() -> None:
    boards = pd.DataFrame({"applied": [True, False, True]})
    assert captions.clocks(boards) == "2 of 3 shifts are significant and applied."
    assert captions.clocks(boards[1:2]).startswith("None of 1")
