"""Green, amber or red: each question of section 7 with its answer, run by run and tap by tap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.estimation.estimate import Estimate
from pipeline.findings.figures import Mood
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures.declaration import MMHG, PressuresSettings
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers


@dataclass(frozen=True)
class Judged:
    """A question put to one run: what was asked, the answer with its number, the word and mood of the verdict."""

    run: str
    tap: str
    question: str
    answer: str
    word: str
    mood: Mood


def within(found: Estimate, middle: float, tolerance: float) -> tuple[str, Mood]:
    """Return whether an interval lies within a tolerance, beyond it, or across its edge."""
    if found.value is None or found.ci95 is None:
        return "not told", "unsaid"
    low, high = found.ci95[0] - middle, found.ci95[1] - middle
    if -tolerance <= low and high <= tolerance:
        return "within", "ok"
    if low > tolerance or high < -tolerance:
        return "outside", "rejected"
    return "undecided", "warning"


def judged(runs: Sequence[RunNumbers], settings: PressuresSettings) -> list[Judged]:
    """Return all answers."""
    return [answer for run in runs for answer in (*_clock(run), *_sensors(run, settings))]


def _clock(run: RunNumbers) -> list[Judged]:
    question = "alignment unambiguous"
    if run.alignment is None:
        return [Judged(run.name, "", question, run.no_alignment, "not told", "unsaid")]
    coarse = run.alignment.coarse
    if run.alignment.lag.value is None:
        return [Judged(run.name, "", question, run.alignment.lag.reason, "ambiguous", "rejected")]
    answer = f"second peak of the correlation {coarse.margin:.2f} of the first (limit 0.9)"
    return [Judged(run.name, "", question, answer, "unambiguous", "ok")]


def _sensors(run: RunNumbers, settings: PressuresSettings) -> list[Judged]:
    found = []
    for tap, numbers in run.taps.items():
        name = TAP_NAMES[tap]
        gain, offset = numbers.deming.gain, numbers.deming.offset
        if gain.value is not None and gain.ci95 is not None:
            word, mood = within(gain, 1.0, settings.gain_tolerance)
            half = 0.5 * (gain.ci95[1] - gain.ci95[0])
            answer = f"{gain.value:.4f} ± {half:.4f}"
            found.append(
                Judged(run.name, name, f"gain within {100 * settings.gain_tolerance:g} % of 1", answer, word, mood)
            )
        if offset.value is not None and offset.ci95 is not None:
            word, mood = within(offset, 0.0, settings.offset_tolerance)
            half = 0.5 * (offset.ci95[1] - offset.ci95[0])
            answer = f"{offset.value:+.1f} ± {half:.1f} Pa ({offset.value / MMHG:+.3f} ± {half / MMHG:.3f} mmHg)"
            limit = f"offset within {settings.offset_tolerance / MMHG:.3g} mmHg"
            found.append(Judged(run.name, name, limit, answer, word, mood))
    return found
