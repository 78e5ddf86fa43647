"""How the mean position of a run moves: the parabola that every fit takes along, and what is no parabola.

What a law leaves over slowly, far above the noise of the probes, is held against a step and an exponential.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.tpjb.rotating.group import LoadGroup
from pipeline.rigs.tpjb.rotating.noise import alias

_DRIFT = 0.05
# Means over this part of a turn are slow; by how much they may exceed what the fast noise leaves in such means.
_SLOW, _EXCESS = 0.25, 4.0
# Share of the misfit (variances) that a shape must explain to be named.
_NAMED = 0.5
_STEPS, _TIMES = 120, 25


@dataclass(frozen=True)
class Movement:
    """A shape of drift: "step" or "exponential", its size (m), and where it is or how long it takes (s)."""

    shape: str
    size: float
    time: float
    explained: float


def drift_of(group: LoadGroup) -> list[QualityFinding]:
    """Say where the mean position drifts; what the fit takes along is a note, what it does not a warning."""
    found = _taken_along(group)
    if not group.comparison.passes:
        return found
    for place, turns in enumerate(group.runs):
        slow, expected = _slow_misfit(group, place)
        if slow < _EXCESS * expected:
            continue
        movement = movement_of(group, place)
        rms = float(np.sqrt((group.selected.paths[place].residual ** 2).mean()))
        text = (
            f"{group.selected.name} leaves a slow misfit of {1e6 * slow:.2g} um rms ({1e6 * rms:.2g} um in all), where the "
            f"fast noise would leave {1e6 * expected:.1g} um: the position moves in another way than by the parabola that is "
            f"fitted along{_words(movement)}. The intervals are wider for it, the coefficients may be biased; leave the moving "
            "part out or let the rig warm up."
        )
        found.append(QualityFinding("warning", text, turns.run))
    return found


def _words(movement: Movement) -> str:
    if movement.explained < _NAMED:
        return ""
    share = f"which explains {100 * movement.explained:.2g} % of it"
    if movement.shape == "step":
        return f": a step of {1e6 * movement.size:.2g} um at {movement.time:.0f} s, {share}"
    return (
        f": an exponential drift of {1e6 * movement.size:.2g} um with a time constant of {movement.time:.2g} s, {share}"
    )


def _taken_along(group: LoadGroup) -> list[QualityFinding]:
    spreads = {turns.run: float(np.hypot(*np.ptp(group.drift(turns.run), axis=1))) for turns in group.runs}
    shares = {turns.run: spreads[turns.run] / max(turns.amplitude, 1e-12) for turns in group.runs}
    drifting = [run for run, share in shares.items() if share > _DRIFT]
    if not drifting:
        return []
    told = listing(
        (f"{run} ({1e6 * spreads[run]:.2g} um, {100 * shares[run]:.2g} % of the orbit)" for run in drifting), 8
    )
    text = f"the mean position drifts in {told}; a drift of second degree is fitted along."
    return [QualityFinding("note", text, drifting[0] if len(drifting) == 1 else None)]


def _slow_misfit(group: LoadGroup, place: int) -> tuple[float, float]:
    """Return the rms of the residual's means over a quarter of a turn, and what white noise would leave there, m."""
    orbit, residual = group.runs[place].record.orbit, group.selected.paths[place].residual
    width = max(round(_SLOW / (abs(orbit.rotation.frequency) * orbit.step)), 4)
    if orbit.time.size < 4 * width:
        return 0.0, 1.0
    kernel = np.ones(width) / width
    slow = np.stack([np.convolve(row, kernel, mode="valid") for row in residual])
    # A slow line of the shaft is no drift; second differences are deaf to all that is slow.
    fast = np.sqrt((np.diff(residual, 2, axis=1) ** 2).mean() / 6.0)
    line = 0.0
    if orbit.shaft_frequency is not None and alias(orbit.shaft_frequency, orbit.step) * width * orbit.step < 2.0:
        line = float(np.sqrt((residual**2).mean()))
    return float(np.sqrt((slow**2).mean())), math.hypot(float(fast) / math.sqrt(width), line)


def movement_of(group: LoadGroup, place: int) -> Movement:
    """Return the step or exponential that explains most of what the law leaves over of a run."""
    fit = group.selected
    orbit, path = fit.orbits[place], fit.paths[place]
    slopes, _ = fit.law.slopes(fit.theta, path.displacement, orbit.force)
    level = np.stack([np.ones_like(orbit.tau), orbit.tau, orbit.tau**2], axis=1)
    own = (slopes.transpose(0, 2, 1) * fit.law.scale).reshape(2 * orbit.tau.size, -1)
    basis = np.linalg.svd(
        np.hstack([own / np.linalg.norm(own, axis=0), np.kron(np.eye(2), level)]), full_matrices=False
    )[0]
    left = path.residual.reshape(-1)
    left = left - basis @ (basis.T @ left)
    since = orbit.time - orbit.time[0]
    total = float(since[-1])
    shapes = [("step", at, (since > at).astype(float)) for at in np.linspace(0.02, 0.98, _STEPS) * total]
    shapes += [("exponential", T, -np.exp(-since / T)) for T in np.geomspace(0.01, 0.5, _TIMES) * total]
    return max(_explaining(shapes, basis, left, float(orbit.time[0])), key=lambda movement: movement.explained)


def _explaining(
    shapes: Sequence[tuple[str, float, np.ndarray]], basis: np.ndarray, left: np.ndarray, start: float
) -> list[Movement]:
    found = []
    whole = max(float(left @ left), 1e-300)
    for name, time, curve in shapes:
        X = np.kron(np.eye(2), curve[:, None])
        X = X - basis @ (basis.T @ X)
        size = np.linalg.lstsq(X, left, rcond=1e-9)[0]
        rest = left - X @ size
        at = start + time if name == "step" else time
        found.append(Movement(name, float(np.hypot(*size)), float(at), 1.0 - float(rest @ rest) / whole))
    return found
