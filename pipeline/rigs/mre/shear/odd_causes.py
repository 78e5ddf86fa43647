"""What would turn the force that the other runs predict into that of an odd run, each by one number at most.

A gain, a lag, an added stiffness, another coil current (mre.md section 8). Where several explain it as
well as the noise lets tell, all are said.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.loop import Loop

# An explanation holds that leaves less than this share of the misfit.
_EXPLAINED = 0.3
# Beside the best one those are said that leave this many times as much or less, or no more than so many
# times the noise, or this share of the force (what scatters from run to run is as large).
_AS_GOOD, _NOISE, _SLIGHT = 2.0, 2.0, 3e-3
_ANOTHER_LEVEL = 0.25  # A


@dataclass(frozen=True)
class Cause:
    """An explanation in words, and the misfit that it leaves as a share of the force (rms)."""

    text: str
    left: float


def causes_of(loop: Loop, fit: DynamicFit) -> list[Cause]:
    """Return what explains most of a run's misfit to a fit of others, the best first; none may."""
    kept = loop.kept
    F, expected = loop.F[kept], fit.predicted(loop)[kept]
    angular = loop.omega * (np.flatnonzero(kept) + 1)
    size = float(np.linalg.norm(F))

    def missed(force: np.ndarray) -> float:
        return float(np.linalg.norm(F - force)) / size

    def share(column: np.ndarray, of: np.ndarray) -> float:
        return float(np.vdot(column, of).real / np.vdot(column, column).real)

    gain = share(expected, F)
    late = -cmath.phase(np.vdot(expected[:1], F[:1])) / float(angular[0])
    X = loop.X[kept]
    stiffer = share(X, F - expected)
    tried = [
        Cause(
            f"its force is {100 * (gain - 1):+.1f} % off (gain of the load cell or of the displacement's sensor)",
            missed(gain * expected),
        ),
        Cause(
            f"its force comes {1e6 * abs(late):.0f} us {'later' if late > 0 else 'earlier'} than theirs",
            missed(expected * np.exp(-1j * angular * late)),
        ),
        Cause(
            f"its stiffness is {stiffer / 1e3:+.3g} kN/m off at the same loss (another preload)",
            missed(expected + stiffer * X),
        ),
    ]
    for level in fit.levels if loop.current is not None else ():
        if abs(level - (loop.current or 0.0)) > _ANOTHER_LEVEL:
            tried.append(
                Cause(
                    f"it goes with the runs at {level:.3g} A but is labelled {loop.current:.3g} A",
                    missed(fit.force(loop.X, loop.frequency, level)[kept]),
                )
            )
    whole = missed(expected)
    holding = sorted((cause for cause in tried if cause.left < _EXPLAINED * whole), key=lambda cause: cause.left)
    if not holding:
        return []
    noise = float(np.sqrt(2 * (loop.sd_f[kept] ** 2).sum())) / size
    limit = max(_AS_GOOD * holding[0].left, _NOISE * noise, min(_SLIGHT, 0.5 * _EXPLAINED * whole))
    return [cause for cause in holding if cause.left <= limit]


def told_causes(loop: Loop, fit: DynamicFit) -> str:
    """Tell what explains a run's misfit to a fit of the others, as part of a sentence."""
    if loop.current is not None and abs(fit.levels[fit.level_of(loop.current)] - loop.current) > _ANOTHER_LEVEL:
        return f"no other run is at {loop.current:g} A to tell why"
    causes = causes_of(loop, fit)
    if not causes:
        kept = loop.kept
        whole = np.linalg.norm((loop.F - fit.predicted(loop))[kept]) / np.linalg.norm(loop.F[kept])
        return (
            f"{100 * float(whole):.2g} % of its force (rms) is not as they predict, and no gain, lag, added stiffness or "
            "other current explains it"
        )
    if len(causes) == 1:
        return causes[0].text
    return f"{', or '.join(cause.text for cause in causes)} (these runs do not tell which)"
