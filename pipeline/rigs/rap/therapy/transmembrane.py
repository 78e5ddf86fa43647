"""Transmembrane pressure of a run in means over a minute, from zeroed channels, with what their zeros leave open (eq. 1)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.hydraulics import transmembrane as eq_1
from pipeline.rigs.rap.tables import Signal

# What a sensor may be off by where no rest shows its zero (Pa, 1 sigma), and its gain where no bench is beside it.
_UNZEROED = 60.0
_UNCHECKED_GAIN = 0.01
# Share of each channel in eq. 1.
_SHARES = {"prefilter": 0.5, "return": 0.5, "uf": -1.0}


@dataclass(frozen=True, eq=False)
class Transmembrane:
    """Means of eq. 1.

    Attributes
    ----------
    time, tmp, scatter
        Middle of each mean (s), mean (Pa), standard error of it from the samples' scatter (Pa), shape (n,).
    zeros
        What each tap reads at rest, Pa; None where no rest shows it.
    offset_u, gain_u
        What zeros (Pa) and gains (relative) leave uncertain in all means alike (type B).
    bin
        Length of a mean, s.
    """

    time: np.ndarray
    tmp: np.ndarray
    scatter: np.ndarray
    zeros: Mapping[str, float | None]
    offset_u: float
    gain_u: float
    bin: float
    problems: tuple[QualityFinding, ...]


def transmembrane(
    prefilter: Signal,
    return_: Signal,
    uf: Signal,
    *,
    zero_spans: Sequence[tuple[float, float]] = (),
    gains: Mapping[str, float] | None = None,
    heads: Mapping[str, float] | None = None,
    gain_u: float | None = None,
    bin: float = 60.0,
) -> Transmembrane:
    """Return the transmembrane pressure over a run.

    Parameters
    ----------
    prefilter, return_, uf
        Pressures of one reader on one clock, Pa.
    zero_spans
        Spans (s) in which all pumps stand still: what is read there is offset and head, and is taken off.
    gains
        Gain of each tap over the bench's, where known.
    heads
        What each tap reads at rest for its height, Pa; taken off where no rest shows the zero.
    gain_u
        Relative standard uncertainty of the gains (type B); by default 1 % where `gains` are not known, else none.

    Raises
    ------
    InputError
        If the three channels do not overlap for a few minutes.
    """
    problems: list[QualityFinding] = []
    taps = {"prefilter": prefilter, "return": return_, "uf": uf}
    first, last = max(s.time[0] for s in taps.values()), min(s.time[-1] for s in taps.values())
    count = int((last - first) // bin)
    if count < 3:
        raise InputError(
            f"the three pressures of the transmembrane pressure share {max(last - first, 0.0):.0f} s; three minutes are the least."
        )
    edges = first + bin * np.arange(count + 1)
    zeros: dict[str, float | None] = {}
    variance = 0.0
    means, errors = {}, np.zeros(count)
    for tap, share in _SHARES.items():
        signal = taps[tap]
        zero, doubt = _zero(signal, zero_spans)
        zeros[tap] = zero
        variance += (share * doubt) ** 2
        off = zero if zero is not None else (heads or {}).get(tap, 0.0)
        mean, error = _binned(signal, edges)
        gain = (gains or {}).get(tap, 1.0)
        means[tap] = (mean - off) / gain
        errors = np.hypot(errors, share * error)
    lost = [tap for tap, zero in zeros.items() if zero is None]
    if lost:
        text = (
            f"no rest of all pumps shows the zero of {', '.join(lost)}; {_UNZEROED:.0f} Pa each are taken for their offset, which is "
            f"{math.sqrt(variance):.0f} Pa of transmembrane pressure. Let the log begin 20 s before the pumps do."
        )
        problems.append(QualityFinding("warning", text, channel=f"pressure_{lost[0]}_rap"))
    if gain_u is None:
        gain_u = 0.0 if gains else _UNCHECKED_GAIN
    tmp = eq_1(means["prefilter"], means["return"], means["uf"])
    whole = np.isfinite(tmp)
    if whole.sum() < 3:
        raise InputError("the pressures of the transmembrane pressure have gaps in every minute; look at the log.")
    middle = 0.5 * (edges[1:] + edges[:-1])
    return Transmembrane(
        middle[whole], np.asarray(tmp[whole]), errors[whole], zeros, math.sqrt(variance), gain_u, bin, tuple(problems)
    )


def _zero(signal: Signal, spans: Sequence[tuple[float, float]]) -> tuple[float | None, float]:
    """Return what a channel reads at rest (Pa; None without a rest), and the standard uncertainty of its zero."""
    pieces = [signal.values[(signal.time >= a + 1.0) & (signal.time <= b - 1.0)] for a, b in spans if b - a > 4.0]
    kept = np.concatenate(pieces) if pieces else np.zeros(0)
    if kept.size < 5:
        return None, _UNZEROED
    return float(kept.mean()), float(kept.std(ddof=1)) / math.sqrt(kept.size)


def _binned(signal: Signal, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return means over the bins (NaN where more than half of the samples miss) and their standard errors."""
    inside = slice(*np.searchsorted(signal.time, [edges[0], edges[-1]]))
    starts = np.searchsorted(signal.time[inside], edges)
    count = np.diff(starts)
    total = np.concatenate([[0.0], np.cumsum(signal.values[inside])])
    square = np.concatenate([[0.0], np.cumsum(signal.values[inside] ** 2)])
    enough = count > 0.5 * np.median(count[count > 0]) if np.any(count > 0) else count > 0
    n = np.where(enough, count, 1)
    mean = np.where(enough, np.diff(total[starts]) / n, np.nan)
    spread = np.maximum(np.diff(square[starts]) / n - mean**2, 0.0)
    return mean, np.sqrt(spread / n)
