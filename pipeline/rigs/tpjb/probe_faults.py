"""Which probes are inverted, dead or have a wrong gain, told from their covariance alone.

Covariances add up over blocks, so that long logs need not be held. A probe is judged by the others
along its axis, and by the force where they cannot decide.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding

# Correlation above which two probes see the same motion.
_AGREE = 0.7
# Share of the others' motion below which a probe is dead.
_DEAD = 0.1


@dataclass(frozen=True)
class ProbeFaults:
    """What was found, and which probes are better left out."""

    findings: tuple[QualityFinding, ...]
    excluded: tuple[str, ...]


def covariance_of(gaps: np.ndarray) -> np.ndarray:
    """Return the covariance of gaps, shape (k, k), m^2, from samples of shape (k, n).

    Rows with a missing sample are left out; a channel that misses more than half of its samples has
    no variance.
    """
    finite = np.isfinite(gaps)
    alive = finite.mean(axis=1) > 0.5
    out = np.zeros((gaps.shape[0], gaps.shape[0]))
    rows = finite[alive].all(axis=0)
    if alive.any() and rows.sum() > 2:
        out[np.ix_(alive, alive)] = np.atleast_2d(np.cov(gaps[alive][:, rows]))
    return out


def probe_faults(
    names: tuple[str, ...],
    covariance: np.ndarray,
    *,
    with_force: np.ndarray | None = None,
    gain_tolerance: float = 0.05,
    run: str | None = None,
) -> ProbeFaults:
    """Name the probes that are inverted, dead, do not follow, or have a wrong gain.

    The gaps of an opposed pair add up to a constant; the two planes move nearly alike.

    Parameters
    ----------
    names
        k gap channels (``gap_up1``, ...).
    covariance
        Of their samples, shape (k, k), m^2.
    with_force
        Covariance of each gap with the force along its own axis, shape (k,): a stator on springs
        moves with the force. It decides where the probes contradict one another one to one.
    gain_tolerance
        Relative difference of the amplitudes of a pair that is still taken for calibration.
    """
    sign = np.array([1.0 if name[5] == "p" else -1.0 for name in names])
    S = covariance * np.outer(sign, sign)
    pull = None if with_force is None else with_force * sign
    sd = np.sqrt(np.clip(np.diag(S), 0.0, None))
    typical = float(np.median(sd[sd > 0])) if (sd > 0).any() else 0.0
    findings: list[QualityFinding] = []
    excluded: list[str] = []
    for axis in "uv":
        members = [i for i, name in enumerate(names) if name[4] == axis]
        if members and typical > 0:
            _Axis(axis, names, members, S, sd, pull, typical, gain_tolerance, run).judge(findings, excluded)
    return ProbeFaults(tuple(findings), tuple(excluded))


@dataclass(frozen=True, eq=False)
class _Axis:
    """The probes along one axis, signed alike."""

    axis: str
    names: tuple[str, ...]
    members: list[int]
    S: np.ndarray
    sd: np.ndarray
    pull: np.ndarray | None
    typical: float
    tolerance: float
    run: str | None

    def judge(self, findings: list[QualityFinding], excluded: list[str]) -> None:
        sound = self._agreeing()
        if sound is None:
            text = (
                f"{listing(self.names[i] for i in self.members)} contradict one another and nothing tells which is "
                f"right: the motion along {self.axis} is not trustworthy. Check the sign of each probe."
            )
            findings.append(QualityFinding("error", text, self.run))
            return
        for i in self.members:
            if i not in sound:
                findings.append(QualityFinding("warning", self._verdict(i, sound), self.run, self.names[i]))
                excluded.append(self.names[i])
        self._compare_gains(sound, findings, excluded)

    def _correlation(self, i: int, j: int) -> float:
        size = self.sd[i] * self.sd[j]
        return float(self.S[i, j] / size) if size > 0 else 0.0

    def _agreeing(self) -> list[int] | None:
        """Return the largest set of probes that see the same motion; None where there is a tie."""
        moving = [i for i in self.members if self.sd[i] >= _DEAD * self.typical]
        moving = moving or [i for i in self.members if self.sd[i] > 0]
        for size in range(len(moving), 0, -1):
            sets = [
                list(group)
                for group in combinations(moving, size)
                if all(self._correlation(i, j) > _AGREE for i, j in combinations(group, 2))
            ]
            if len(sets) > 1 and self.pull is not None:
                along = [float(np.mean(self.pull[group])) for group in sets]
                sets = [group for group, pull in zip(sets, along, strict=True) if pull > 0] if min(along) < 0 else sets
            if len(sets) == 1:
                return sets[0]
            if sets:
                return None
        return None

    def _verdict(self, i: int, sound: list[int]) -> str:
        name = self.names[i]
        reference = self.S[np.ix_(sound, sound)].mean()
        r = float(self.S[i, sound].mean() / np.sqrt(self.S[i, i] * reference)) if self.S[i, i] > 0 else 0.0
        if r < -_AGREE:
            what = f"moves against the other probes along {self.axis} (correlation {r:.2f}): its sign is inverted"
        elif self.sd[i] < _DEAD * np.sqrt(reference):
            what = f"does not move while the other probes along {self.axis} do: it is dead or not connected"
        else:
            what = f"does not follow the other probes along {self.axis} (correlation {r:.2f}): loose or disturbed"
        return f"{name} {what}; it is left out. A pair with its opposite probe is then missing: zeros may differ."

    def _compare_gains(self, sound: list[int], findings: list[QualityFinding], excluded: list[str]) -> None:
        for plane in "12":
            pair = [i for i in sound if self.names[i][6] == plane]
            if len(pair) < 2:
                continue
            ratio = self.sd[pair[0]] / self.sd[pair[1]]
            if abs(np.log(ratio)) < np.log1p(self.tolerance):
                continue
            others = [self.sd[i] for i in sound if i not in pair]
            text = (
                f"{self.names[pair[0]]} and {self.names[pair[1]]} do not add up to a constant: their amplitudes are "
                f"{self.sd[pair[0]] * 1e6:.3g} and {self.sd[pair[1]] * 1e6:.3g} um rms"
            )
            off = [abs(np.log(self.sd[i] / np.median(others))) for i in pair] if others else [0.0, 0.0]
            if max(off) > 3 * min(off) and max(off) > np.log1p(self.tolerance):
                worse = pair[int(np.argmax(off))]
                text += f"; by the other plane the gain of {self.names[worse]} is wrong, and it is left out."
                findings.append(QualityFinding("warning", text, self.run, self.names[worse]))
                excluded.append(self.names[worse])
            else:
                text += "; which of the two gains is wrong the data do not tell: both stay in. Calibrate them."
                findings.append(QualityFinding("warning", text, self.run, self.names[pair[0]]))
