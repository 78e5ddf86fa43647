"""What the numbers of the joint filter are worth: has it converged, does it still move, has it diverged.

Its own standard deviations do not say so: they are too small where it is most wrong (mre.md section 5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.rich.joint_filter import R_END, R_FADES
from pipeline.rigs.mre.rich.joint_state import PARAMETERS, STATES
from pipeline.rigs.mre.rich.online import Online

CONVERGED, MOVING, DIVERGED, ABSENT = "converged", "not converged", "diverged", "no filter"
# Innovations beyond this many times the noise (by third differences of the force, or what the batch fit leaves) are
# none of a filter that follows; a parameter has settled that changes by less than this over the last quarter.
_FOLLOWS, _SETTLED = 1.5, 0.05
_WATCHED = ("k1", "tau", "k2", "alpha_bw", "rho", "c_bw", "n_bw")


@dataclass(frozen=True)
class OnlineVerdict:
    """The `word`, why in one sentence, and the numbers: rms innovation (N) of the second half over the `noise` (N)."""

    word: str
    reason: str
    innovation: float = math.nan
    noise: float = math.nan

    @property
    def converged(self) -> bool:
        """Tell whether the filter's numbers may be used."""
        return self.word == CONVERGED


def judge_online(online: Online, left_by_batch: float | None = None) -> OnlineVerdict:
    """Judge a filter by what it has seen so far.

    `left_by_batch` is the rms residual of the batch fit, N: a model that misses more than noise gives larger
    innovations, and is no divergence.
    """
    if online.refused:
        return OnlineVerdict(ABSENT, f"the filter did not start: {online.refused}")
    if online.filter is None:
        return OnlineVerdict(ABSENT, "the filter waits for motion to start from")
    if online.failed is not None:
        return OnlineVerdict(DIVERGED, f"the covariance broke down at {online.failed:.3g} s")
    history = online.history
    time, innovation = history.step_time, history.innovation
    if time.size < 10:
        return OnlineVerdict(MOVING, "hardly begun")
    late = innovation[time > 0.5 * (time[0] + time[-1])]
    late = late[np.isfinite(late)]
    rms = float(np.sqrt(np.mean(late**2))) if late.size else math.nan
    noise = max(online.sigma, left_by_batch or 0.0)

    def verdict(word: str, reason: str) -> OnlineVerdict:
        return OnlineVerdict(word, reason, rms, noise)

    annealing = online.filter.added * math.exp(-online.filter.time / R_FADES)
    if annealing > R_END * online.sigma**2:
        share = math.sqrt(1 + annealing / (R_END * online.sigma**2))
        return verdict(
            MOVING,
            f"the annealing has not faded after {online.filter.time:.3g} s: it still trusts the force {share:.2g} times less than in the end",
        )
    if not rms < _FOLLOWS * noise:
        against = "the noise of the force" if noise == online.sigma else "what the batch fit leaves"
        return verdict(
            DIVERGED,
            f"innovations of {rms:.3g} N (rms, second half) are {rms / noise:.2g} times {against}: the filter, or its "
            "model, does not follow the record",
        )
    names = STATES[PARAMETERS]
    if online.filter.held.any():
        stuck = ", ".join(name for name, held in zip(names, online.filter.held, strict=True) if held)
        return verdict(DIVERGED, f"{stuck} ran to the edge of what is allowed, a factor of 100 from the start")
    values, kept = history.band(), history.time
    quarter = kept > kept[-1] - 0.25 * (kept[-1] - kept[0])
    moved = {name: float(np.ptp(values[name][quarter]) / abs(values[name][-1])) for name in _WATCHED}
    worst = max(moved, key=lambda name: moved[name])
    if moved[worst] > _SETTLED:
        return verdict(MOVING, f"{worst} still moves, by {100 * moved[worst]:.2g} % in the last quarter of the record")
    return verdict(
        CONVERGED,
        f"innovations of {rms:.3g} N (rms, second half) are {rms / noise:.2g} times the noise, and no parameter moves by more than "
        f"{100 * moved[worst]:.2g} % in the last quarter ({worst})",
    )
