"""Every row of the sheet's table of bad data (tire.md, 8): the fault is named, and no wrong number is told as good."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from bench_campaigns import few_logs, identified, logs, spoilt, variant, without_ring

from benchmarks.coverage.studies.tire_bench import true_of_all
from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.tire.synthetic.rig import synthesize_bench

Made = Callable[[], Sequence[Recording]]


def beside(name: str) -> Made:
    """Return sound runs and one with the fault."""
    return lambda: [*without_ring(few_logs()), *without_ring([variant(name)])]


@dataclass(frozen=True)
class Row:
    """One row of the sheet: the logs, what is said (of the run or of all), which run is left out.

    `refused` rows leave nothing to identify; `noted` ones are mended without harm.
    """

    made: Made
    words: str
    out: str = ""
    refused: bool = False
    noted: bool = False


def _both_changed(name: str, factor: float) -> Made:
    return lambda: [spoilt(log, name, lambda v: factor * v) for log in without_ring(few_logs())]


def _silent() -> Sequence[Recording]:
    """One run whose radio is mute for two turns."""
    (mute,) = synthesize_bench({"runs": ["load_2500"], "duration": 10.0, "silence": [4.0, 5.2]}, 3)
    return [*without_ring(few_logs()), *without_ring([mute])]


def _doubled() -> Sequence[Recording]:
    """One run with the passage once more, lower and half a turn later, in two of its turns."""

    def twice(codes: np.ndarray) -> np.ndarray:
        rest = np.median(codes)
        for begin in (30000, 60000):
            top = begin + int(np.argmax(codes[begin : begin + 8000]))
            again = rest + 0.7 * (codes[top - 500 : top + 500] - rest)
            codes[top + 3200 : top + 4200] = np.round(again)
        return codes

    first, *others = without_ring(few_logs())
    return [spoilt(first, "flex_code", twice), *others]


def _film_slow() -> Sequence[Recording]:
    return without_ring([*few_logs(), variant("saturated")])


def _sagging() -> Sequence[Recording]:
    return [*without_ring(few_logs()), *without_ring([variant("sag")])]


ROWS = {
    "1 lost packets": Row(beside("loss"), "of the packets lost"),
    "1 lost passages": Row(_silent, "passage"),
    "2 radio packet id of two bits": Row(beside("packet_id"), "radio packet id of 2 bits cannot count losses"),
    "3 gated transmission": Row(beside("gated"), "gated log: baseline not recorded"),
    "4 missed peaks": Row(_silent, "put between the neighbours"),
    "4 doubled peaks": Row(_doubled, "double peak", noted=True),
    "5 debonding": Row(beside("debond"), "flex sensor amplitude fell by 45% at t = 1", out="bad_debond"),
    "5 broken ink": Row(beside("broken"), "reads an end of its range from t = 12.0 s on"),
    "6 saturation": Row(_film_slow, "PVDF clipped in"),
    "7 swapped channels": Row(beside("swapped"), "channels look swapped", out="bad_swapped"),
    "8 wrong polarity": Row(beside("polarity"), "flex polarity inverted"),
    "8 sensor in the upper leg": Row(beside("divider"), "in the divider's upper leg"),
    "9 wrong direction": Row(beside("direction"), "rotation sense reversed"),
    "10 speed in km/h": Row(beside("kmh"), "km/h", out="bad_kmh"),
    "10 speed in km/h in all runs": Row(_both_changed("road_speed", 3.6), "km/h", refused=True),
    "10 rotation for speed": Row(_both_changed("road_speed", 30.0 / np.pi / 0.3171), "wheel's rpm", refused=True),
    "11 load in kg": Row(beside("kg"), "load looks like kg", out="bad_kg"),
    "11 load in N declared as kN": Row(_both_changed("vertical_load", 1e3), "no wheel carries that", refused=True),
    "12 cylinder's load, beam not tared": Row(beside("friction"), "tare the beam mass"),
    "13 pressure changed": Row(
        lambda: [*without_ring(logs()), *without_ring([variant("pressure")])], "another inflation pressure than stated"
    ),
    "14 temperature, drift of R0": Row(beside("drift"), "R0 drifts by +"),
    "15 once-per-turn artefact": Row(beside("once_per_rev"), "first harmonic of R2"),
    "15 mains": Row(beside("mains"), "mains hum of"),
    "16 speed not constant": Row(beside("speed"), "speed not constant"),
    "17 supply sag": Row(_sagging, "ratiometric reference missing"),
}  # fmt: skip


@pytest.mark.parametrize("name", ROWS)
def test_the_row_of_the_sheet_is_named_and_no_wrong_number_is_told_as_good(name: str) -> None:
    row = ROWS[name]
    made = list(row.made())
    if row.refused:
        with pytest.raises(InputError, match=row.words):
            identified(made)
        return
    found = identified(made)
    said = [*found.reasons, *(f"{q.run} {q.message}" for q in found.quality if q.level != "note" or row.noted)]
    assert any(row.words in one for one in said), said
    assert found.verdict != "ok"
    assert [run.run for run in found.runs if not run.used] == (
        [row.out] if row.out else [run.run for run in found.runs if not run.used]
    )
    _holds(found)


def _holds(found: Findings) -> None:
    """Numbers of the tire are right within three standard errors (one and a half intervals), or are not told."""
    wrong = []
    for p in found.parameters:
        true = true_of_all(p)
        if p.value is None or p.ci95 is None or p.std_error is None or true is None:
            continue
        half = 0.5 * (p.ci95[1] - p.ci95[0])
        if abs(p.value - true) > max(3.0 * p.std_error, 1.5 * half):
            wrong.append(f"{p.name} {p.at} {p.value} +- {p.std_error}, truth {true}")
    assert not wrong


def test_the_sound_runs_of_which_all_others_are_made_have_none_of_these_messages() -> None:
    found = identified(without_ring(few_logs()))
    assert not [q.message for q in found.quality if q.level == "error"]
    said = [*found.reasons, *(q.message for q in found.quality)]
    assert not [
        row.words
        for row in ROWS.values()
        for one in said
        if row.words in one and row.words not in ("passage", "repaired")
    ]
    _holds(found)
