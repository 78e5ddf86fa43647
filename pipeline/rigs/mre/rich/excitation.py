"""How far a record reaches: amplitudes and frequencies of its strokes, and what it lacks (mre.md design rules)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.model.time_fit import TimeFit
from pipeline.rigs.mre.shear.sorted_runs import UsableRun
from pipeline.signals.filtering import low_pass

_ENDS = (0.05, 0.95)
_NARROW = 1.5


@dataclass(frozen=True)
class Reach:
    """Amplitudes (m) and frequencies (Hz) between which nine strokes in ten lie."""

    amplitudes: tuple[float, float]
    frequencies: tuple[float, float]

    @property
    def is_one_loop(self) -> bool:
        """Tell whether the record is one loop over and over."""
        (small, large), (slow, fast) = self.amplitudes, self.frequencies
        return large < _NARROW * small and fast < _NARROW * slow


def reach_of(usable: UsableRun, cutoff: float) -> Reach | None:
    """Return how far a record reaches, seen through a low-pass (Hz); None where there are hardly any strokes."""
    series = usable.series
    x = low_pass(series.time, series.x, cutoff)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(x))) != 0) + 1
    strokes = np.abs(np.diff(x[turns]))
    times = np.diff(series.time[turns])
    real = strokes > 0.02 * float(np.ptp(x))
    if real.sum() < 4:
        return None
    low, high = np.quantile(strokes[real] / 2, _ENDS).tolist()
    slow, fast = np.quantile(0.5 / times[real], _ENDS).tolist()
    return Reach((low, high), (slow, fast))


def advice_for(batch: TimeFit, reach: Reach | None) -> list[str]:
    """Return what the next record should hold so that what is open is determined."""
    if reach is None or not batch.undetermined:
        return []
    (small, large), (slow, fast) = reach.amplitudes, reach.frequencies
    values = dict(zip(batch.names, batch.values.tolist(), strict=True))
    advice = []
    known = {"rho", "tau"} - set(batch.undetermined)
    rho = values["rho"] if "rho" in known else None
    if large < _NARROW * small:
        advice.append(
            f"Let the amplitude swing: it stays between {1e3 * small:.2g} and {1e3 * large:.2g} mm, and one amplitude separates "
            "neither k2 from a_BW rho nor C from n."
        )
    if rho is not None and large * rho < 1.5:
        advice.append(
            f"Go to amplitudes above {1.5e3 / rho:.2g} mm (1.5/rho); the largest here are {1e3 * large:.2g} mm."
        )
    elif rho is not None and small * rho > 1:
        advice.append(f"Add amplitudes below {1e3 / rho:.2g} mm (1/rho); the smallest here are {1e3 * small:.2g} mm.")
    elif rho is None and large >= _NARROW * small:
        advice.append(
            f"Go to larger amplitudes than {1e3 * large:.2g} mm: the loops do not show where the force yields."
        )
    if fast < _NARROW * slow:
        advice.append(
            f"Sweep the frequency: it stays between {slow:.2g} and {fast:.2g} Hz, and one frequency does not separate k1 from k2."
        )
    elif "tau" in known:
        corner = 1 / (2 * math.pi * values["tau"])
        if slow > corner:
            advice.append(f"Begin the sweep below 1/(2 pi tau) = {corner:.2g} Hz.")
        if fast < corner:
            advice.append(f"Let the sweep go beyond 1/(2 pi tau) = {corner:.2g} Hz.")
    return advice or ["Record longer, with amplitudes and frequencies that are further apart."]
