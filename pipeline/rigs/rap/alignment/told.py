"""What is doubted of an alignment and what must be told of it, in words."""

from __future__ import annotations

import math

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.coarse import AMBIGUOUS
from pipeline.rigs.rap.alignment.result import Coarse, Track

# Told from that drift on, relative.
_DRIFT = 10e-6

COPIED = (
    "the bench's pressures are the device's, number for number: a copy tells nothing of its clock nor of its sensors; "
    "log the bench's own readings"
)
"""Why a copy has no lag."""


def stepped(time: float, size: float) -> str:
    """Return why a clock that steps by `size` (s) at `time` (s) has no one lag."""
    return (
        f"the device's clock (or the bench's) steps by about {1e3 * size:+.0f} ms, or that and whole strokes, about {time:.0f} s or later: no one lag "
        "holds. Cut both logs there and identify the parts as runs of their own"
    )


def unlike(coarse: Coarse) -> str:
    """Return why two records that share no course have no lag."""
    reason = (
        f"nothing that starts, stops or steps is seen alike by device and bench (best correlation {coarse.peak:.2f} of 1)"
        if math.isfinite(coarse.peak)
        else "the stamps of device and bench share nothing that moves"
    )
    return reason + ": check that both logs are of the same run, and include a pump start"


def ambiguous(coarse: Coarse, stroke: float | None, sure: bool) -> str:
    """Return why the lag may be another one, empty where it cannot.

    Parameters
    ----------
    coarse
        What steps tell.
    stroke
        Time of one, s; None where none is seen.
    sure
        Whether strokes were counted through the whole run.
    """
    strokes = f" by n x stroke ({stroke:.2f} s)" if stroke else ""
    if not coarse.featured:
        return f"lag ambiguous{strokes}: the run holds one speed only, and every stroke looks like the next; include a pump start"
    if coarse.margin >= AMBIGUOUS:
        return (
            f"lag ambiguous{strokes}: {coarse.lag:.2f} s and {coarse.second_lag:.2f} s fit about as well "
            f"(correlation {coarse.peak:.3f} and {coarse.second:.3f}); include a pump start"
        )
    if not sure:
        return f"lag ambiguous{strokes}: the pump stood so long that the strokes before and behind cannot be counted through"
    return ""


def told_coarse(coarse: Coarse, search: float) -> list[QualityFinding]:
    """Return what is told of the coarse lag, searched up to `search` (s)."""
    told = []
    if coarse.wide:
        told.append(
            QualityFinding(
                "warning",
                f"the stamps of device and bench lie {abs(coarse.lag):.6g} s apart, more than the {search:g} s that are usual: the clocks "
                "count from different moments. The lag was found by laying the records over each other",
            )
        )
    for name in coarse.flipped:
        told.append(
            QualityFinding(
                "warning",
                f"{name} runs against the bench's: sign flipped? It was left out of the fine alignment",
                channel=name,
            )
        )
    return told


def told_clock(clock: Clock, track: Track, doubt: str) -> list[QualityFinding]:
    """Return the doubt as a warning, and a drift that is worth a word as a note."""
    told = [QualityFinding("warning", doubt)] if doubt else []
    if (
        abs(clock.rate) > _DRIFT
        and math.isfinite(clock.covariance[1, 1])
        and abs(clock.rate) > 3.0 * math.sqrt(clock.covariance[1, 1])
        and track.time.size
    ):
        end = float(clock.lag_at(track.time[-1:])[0])
        told.append(
            QualityFinding(
                "note",
                f"rate error {1e6 * clock.rate:+.1f} ppm of the device's clock; lag at end {end:.3f} s; corrected",
            )
        )
    return told
