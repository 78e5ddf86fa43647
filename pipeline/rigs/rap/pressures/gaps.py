"""Steps of time that are not the usual one: lost samples and what is done about them (rap.md, section 8)."""

from __future__ import annotations

import numpy as np

from pipeline.errors import counted
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.pressures.record import Record, Source

# A step that is that share longer than the usual one loses samples; shorter ones than that share are told together.
_OFF = 0.2
_LOSES = 1.5
_AROUND = 4


def gap_notes(record: Record) -> list[QualityFinding]:
    """Return a note for each source whose steps are uneven: what of it is left out."""
    return [finding for source in record.sources.values() if (finding := _of(record, source)) is not None]


def _of(record: Record, source: Source) -> QualityFinding | None:
    one = max(source.taps.values(), key=lambda signal: signal.time.size)
    if one.time.size < 3:
        return None
    steps = np.diff(one.time)
    usual = float(np.median(steps))
    lost = np.array(
        [k for k in np.flatnonzero(steps > _LOSES * usual) if _missing(one.time, int(k), usual) > 0.6], dtype=int
    )
    uneven = float(np.mean(np.abs(steps / usual - 1.0) > _OFF))
    if lost.size:
        n = int(np.sum(np.round(steps[lost] / usual) - 1))
        longest = int(lost[np.argmax(steps[lost])])
        start, end = float(one.time[longest]), float(one.time[longest + 1])
        text = (
            f"gap of {counted(n, 'sample')} in the {_of_whom(source)} pressures ({counted(int(lost.size), 'gap')}, the longest from {start:.5g} to "
            f"{end:.5g} s): windows that hold one are excluded, nothing is interpolated across"
        )
        return QualityFinding("note", text, record.run, one.name, (start, end))
    if uneven > 0.05:
        text = (
            f"time step of the {_of_whom(source)} pressures is not {usual:.4g} s ± 20 % in {100 * uneven:.2g} % of the steps: stamps of arrival, or a busy "
            "logger; lag and pole carry that jitter"
        )
        return QualityFinding("note", text, record.run, one.name)
    return None


def _missing(time: np.ndarray, at: int, usual: float) -> float:
    """Return how many samples are missing about a long step: a late stamp is made up for by the steps around it."""
    first, last = max(at - _AROUND, 0), min(at + 1 + _AROUND, time.size - 1)
    return float((time[last] - time[first]) / usual - (last - first))


def _of_whom(source: Source) -> str:
    return {"rap": "device's", "bench": "bench's", "prot": "protective unit's"}[source.reader]
