"""Faults that only a fit shows (tpjb.md, section 8): drift, delay, friction, the shaft's line, a load that explains itself.

Each is named with its size; what is dealt with is a note, what is not a warning.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.group import LoadGroup
from pipeline.rigs.tpjb.rotating.linear_limit import MARGINAL
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit
from pipeline.rigs.tpjb.rotating.noise import alias_line
from pipeline.rigs.tpjb.rotating.orbit import Orbit
from pipeline.rigs.tpjb.rotating.turns import Turns

_DRIFT = 0.05
# Runout of a shaft, m, beyond which a line at its alias cannot be what averaging left of it.
_MOST_RUNOUT = 60e-6
# Standard errors, and angle of the load (rad) or share of it, from which a delay or friction is told.
_SURE, _ANGLE, _FRICTION = 5.0, 0.01, 0.01


@dataclass(frozen=True)
class Delay:
    """How late the forces are against the motion, s, and friction, N, each with its standard error."""

    delay: float
    delay_sd: float
    friction: float
    friction_sd: float


def faults_of_fit(group: LoadGroup) -> list[QualityFinding]:
    """Return what the fits of a group show of its runs."""
    found = [*group.findings, *_drift(group), *_shaft_line(group)]
    for turns in group.runs:
        found += _load_harmonics(group, turns)
    return found


def _drift(group: LoadGroup) -> list[QualityFinding]:
    """Say where the mean position drifts; what the fit takes along is a note."""
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


def _shaft_line(group: LoadGroup) -> list[QualityFinding]:
    """Say how large the shaft's line is, and doubt that one-second values are means where it is too large."""
    found, seen = [], []
    for turns in group.runs:
        orbit = turns.record.orbit
        residual = group.selected.paths[group.index[turns.run]].residual
        line = alias_line(orbit, residual)
        if line is None or orbit.shaft_frequency is None:
            continue
        amplitude, at = line
        if turns.record.notched is not None:
            amplitude = turns.record.notched
        left = abs(float(np.sinc(orbit.shaft_frequency * orbit.step)))
        if amplitude < 0.5 * float(np.sqrt((residual**2).mean())) or not left > 0:
            continue
        if amplitude / left > _MOST_RUNOUT and turns.record.averaged == 1:
            text = (
                f"a line of {1e6 * amplitude:.2g} um stands at {at:.3g} Hz, where sampling folds the shaft frequency: as what "
                f"averaging over {orbit.step:.3g} s leaves, the shaft's runout would be {1e6 * amplitude / left:.3g} um. Are "
                "the values samples, and not means? The line is left out of the noise of the coefficients."
            )
            found.append(QualityFinding("warning", text, turns.run))
        else:
            seen.append((turns.run, amplitude, at, amplitude / left))
    if seen:
        _, amplitude, at, runout = max(seen, key=lambda entry: entry[1])
        text = (
            f"{listing((run for run, *_ in seen), 8)}: a line of up to {1e6 * amplitude:.2g} um at {at:.3g} Hz is what is left "
            f"of the shaft's own {1e6 * runout:.2g} um once a turn; it does not count as noise of the coefficients."
        )
        found.append(QualityFinding("note", text, seen[0][0] if len(seen) == 1 else None))
    return found


def _load_harmonics(group: LoadGroup, turns: Turns) -> list[QualityFinding]:
    distortion = group.distortions.get(turns.run)
    if distortion is None or distortion.load < distortion.value / 3.0 or distortion.value < 3.0 * distortion.std_error:
        return []
    nonlinear = distortion.value > MARGINAL
    text = (
        f"the load itself has harmonics of {100 * distortion.load:.2g} %, more than a third of the THD of "
        f"{100 * distortion.value:.2g} %; what they explain is taken out"
        + (": the nonlinear verdict is weak." if nonlinear else ".")
    )
    return [QualityFinding("warning" if nonlinear else "note", text, turns.run, "force_u")]


def delay_of(fit: ModelFit, place: int) -> Delay | None:
    """Return delay of the forces and friction that one run shows beside the law; None where it cannot tell.

    Both turn the orbit of a steady load as cross coupling does; only ramps and unrest of the load tell
    them. The residual is regressed on J^-1 df/dt and J^-1 v/|v| with the law's own freedom projected out.

    Parameters
    ----------
    fit, place
        A fitted model and which of its runs.
    """
    orbit, path = fit.orbits[place], fit.paths[place]
    d, f = path.displacement, orbit.force
    if not np.isfinite(d).all():
        return None
    slopes, _ = fit.model.slopes(fit.theta, d, f)
    compliance = law.compliance(fit.p, d)
    velocity = np.einsum("ijn,jn->in", compliance, np.gradient(f, orbit.time, axis=1))
    direction = _direction(velocity, orbit)
    tau = orbit.tau
    level = np.stack([np.ones_like(tau), tau, tau**2])
    n, k = tau.size, slopes.shape[1]
    A = np.zeros((2, n, k + 8))
    A[:, :, :k] = slopes.transpose(0, 2, 1) * fit.model.scale
    A[0, :, k : k + 3] = A[1, :, k + 3 : k + 6] = level.T
    A[:, :, -2] = velocity
    A[:, :, -1] = -np.einsum("ijn,jn->in", compliance, direction)
    A = A.reshape(2 * n, -1)
    norms = np.sqrt((A**2).sum(axis=0))
    norms[norms == 0] = 1.0
    solution, _, rank, _ = np.linalg.lstsq(A / norms, path.residual.reshape(-1), rcond=1e-9)
    if rank < A.shape[1]:
        return None
    error = (
        float(np.sqrt((path.residual**2).mean())) * np.sqrt(np.diag(np.linalg.inv((A / norms).T @ (A / norms)))) / norms
    )
    value = solution / norms
    return Delay(float(value[-2]), float(error[-2]), float(value[-1]), float(error[-1]))


def _direction(velocity: np.ndarray, orbit: Orbit) -> np.ndarray:
    """Return where the stator moves, unit vectors of shape (2, n), zero where it stands: means over a 25th of a turn."""
    width = max(round(1.0 / (25.0 * abs(orbit.rotation.frequency) * orbit.step)), 1)
    padded = np.pad(velocity, ((0, 0), (width // 2, width - 1 - width // 2)), mode="edge")
    smooth = np.stack([np.convolve(row, np.ones(width) / width, mode="valid") for row in padded])
    speed = np.hypot(*smooth)
    return np.asarray(smooth / np.hypot(speed, 0.1 * float(np.median(speed[orbit.rotation.steady]))))


def late_forces(group: LoadGroup) -> tuple[float, float]:
    """Return by how much the forces of a group are late, s, and its standard error; 0 where that is neither sure nor large."""
    known = [delay for turns in group.runs if (delay := delay_of(group.selected, group.index[turns.run])) is not None]
    if not known:
        return 0.0, math.inf
    weight = np.array([1.0 / delay.delay_sd**2 for delay in known])
    late = float(np.array([delay.delay for delay in known]) @ weight / weight.sum())
    sd = float(1.0 / math.sqrt(weight.sum()))
    matters = abs(late) * _turning(group) > _ANGLE
    return (late, sd) if matters and abs(late) > _SURE * sd else (0.0, sd)


def told_delay(group: LoadGroup, late: float, sd: float) -> QualityFinding:
    """Say a delay that was mended."""
    word = "late" if late > 0 else "early"
    text = (
        f"{group.label}: the forces are {abs(late):.2g} ± {1.96 * sd:.1g} s {word} against the motion (clock slip or delay), "
        f"told from ramps and unrest of the load; as cross coupling it would count {100 * abs(late) * _turning(group):.2g} % "
        "of the stiffness. They were shifted by it."
    )
    return QualityFinding("warning", text, None, "force_u")


def _turning(group: LoadGroup) -> float:
    return 2.0 * math.pi * abs(group.highest.record.rotation.frequency)


def rubbing(group: LoadGroup) -> dict[str, Delay]:
    """Return the runs in which a force against the motion is sure and large: the load cells carry it, the film does not."""
    found = {}
    for turns in group.runs:
        delay = delay_of(group.selected, group.index[turns.run])
        size = turns.record.rotation.size
        if delay is not None and abs(delay.friction) > max(_SURE * delay.friction_sd, _FRICTION * size):
            found[turns.run] = delay
    return found


def friction_force(group: LoadGroup, run: str, friction: float) -> np.ndarray:
    """Return a force of constant size (N) along the motion of a run, shape (2, n): what friction adds to the cells."""
    place = group.index[run]
    fit = group.selected
    orbit, d = fit.orbits[place], fit.paths[place].displacement
    compliance = law.compliance(fit.p, d)
    velocity = np.einsum("ijn,jn->in", compliance, np.gradient(orbit.force, orbit.time, axis=1))
    return np.asarray(friction * _direction(velocity, orbit))


def told_friction(run: str, friction: float, sd: float, size: float) -> QualityFinding:
    """Say a friction that was taken off."""
    against = "against" if friction > 0 else "along"
    text = (
        f"a force of {abs(friction):.2g} ± {1.96 * sd:.1g} N stands {against} the motion, {100 * abs(friction) / size:.2g} % of "
        "the load: friction of stabilisers, hoses or actuators? It was told from ramps and unrest of the load and taken off "
        "the load cells; left in, it would count as cross coupling (kxy - kyx)."
    )
    return QualityFinding("warning", text, run, "force_u")
