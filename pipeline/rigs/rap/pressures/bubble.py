"""Air at a transducer: its pulsation drops and comes late against the other reader's, from the start or from a moment on (rap.md, 8)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.result import Alignment, Ratios
from pipeline.rigs.rap.conditions import TAP_NAMES, pressure

# A pole that is that many times, and that much (s), larger than those of the other taps is not the sensor's.
_TIMES, _SLOWER = 2.0, 0.015
# A step of the pulsation by that share, that many standard errors clear, with that many windows on either side.
_STEP, _SIGMAS, _FEWEST = 0.06, 8.0, 4
# Pulsation and means tell gains that agree within that share, and that many standard errors (section 5.8).
_GAINS_APART, _CLEAR = 0.05, 5.0
_ADVICE = "air or something soft at the transducer: compliance changed; E2 invalid. Flush the line to the sensor"


def bubble_faults(run: str, alignment: Alignment, gains: dict[str, tuple[float, float]]) -> list[QualityFinding]:
    """Return what the device's pulsation against the bench's says of air.

    Parameters
    ----------
    gains
        Gain from the means (Deming) and its standard error by tap: a pulsation that is smaller by more is damped.
    """
    if alignment.ratios is None:
        return []
    found = [*_slow_poles(run, alignment), *_steps(run, alignment.ratios)]
    told = {finding.channel for finding in found}
    return found + [one for one in _amplitudes(run, alignment, gains) if one.channel not in told]


def _slow_poles(run: str, alignment: Alignment) -> list[QualityFinding]:
    poles = alignment.pole_by_name
    found = []
    for tap, pole in poles.items():
        others = [value for name, value in poles.items() if name != tap]
        usual = float(np.median(others)) if others else math.nan
        if pole > max(_TIMES * usual, usual + _SLOWER):
            text = (
                f"the device's {TAP_NAMES.get(tap, tap)} channel answers with {1e3 * pole:.3g} ms, where the other taps' do with {1e3 * usual:.3g} ms: its "
                f"pulsation is lower and later; {_ADVICE}"
            )
            found.append(QualityFinding("warning", text, run, pressure(tap, "rap")))
    return found


def _steps(run: str, ratios: Ratios) -> list[QualityFinding]:
    """Tell taps whose pulsation changes at some moment against the bench's."""
    found = []
    for tap in dict.fromkeys(ratios.name.tolist()):
        rows = np.flatnonzero((ratios.name == tap) & (ratios.order == 1))
        rows = rows[np.argsort(ratios.time[rows], kind="stable")]
        split = _best_split(np.abs(ratios.ratio[rows] / ratios.model[rows]))
        if split is None:
            continue
        at, before, after = split
        moment = 0.5 * float(ratios.time[rows[at - 1]] + ratios.time[rows[at]])
        phase = np.angle(ratios.ratio[rows] / ratios.model[rows]) / (2.0 * np.pi * ratios.frequency[rows])
        later = float(np.median(phase[:at]) - np.median(phase[at:]))
        text = (
            f"the pulsation of the device's {TAP_NAMES.get(tap, tap)} channel changes by {100 * (after / before - 1.0):+.0f} % against the bench's near {moment:.0f} s "
            f"(bench's clock) and its delay by {1e3 * later:+.1f} ms; {_ADVICE}"
        )
        found.append(QualityFinding("warning", text, run, pressure(tap, "rap"), (moment, moment)))
    return found


def _best_split(values: np.ndarray) -> tuple[int, float, float] | None:
    """Return where a course steps, and its means on both sides; None where it does not."""
    best: tuple[float, int] = (0.0, 0)
    for at in range(_FEWEST, values.size - _FEWEST + 1):
        before, after = values[:at], values[at:]
        error = math.hypot(before.std() / math.sqrt(before.size), after.std() / math.sqrt(after.size))
        score = abs(before.mean() - after.mean()) / max(error, 1e-6)
        best = max(best, (score, at))
    at = best[1]
    if not at:
        return None
    first, second = float(values[:at].mean()), float(values[at:].mean())
    return (at, first, second) if abs(second / first - 1.0) > _STEP and best[0] > _SIGMAS else None


def _amplitudes(run: str, alignment: Alignment, gains: dict[str, tuple[float, float]]) -> list[QualityFinding]:
    """Hold the gain that the pulsation tells against the one of the means."""
    found = []
    for one in alignment.gains:
        tap = str(one.at["channel"])
        if one.value is None or one.std_error is None or tap not in gains:
            continue
        mean, error = gains[tap]
        apart = one.value / mean - 1.0
        if abs(apart) > max(_GAINS_APART, _CLEAR * math.hypot(one.std_error, error)):
            text = (
                f"the device's {TAP_NAMES.get(tap, tap)} pulsation is {one.value:.3f} times the bench's, its means {mean:.3f} times: the gain depends on amplitude or "
                f"frequency; {_ADVICE}"
            )
            found.append(QualityFinding("warning", text, run, pressure(tap, "rap")))
    return found
