"""One run: its samples, the fit, and what of the run is to be doubted."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.estimation.uncertainty import effective_size, t_quantile
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.axial.contact import backlash, from_contact, moved
from pipeline.rigs.mre.axial.jumps import with_force_jumps, without_gauge_jumps
from pipeline.rigs.mre.axial.loop import LoopModel, along_strokes
from pipeline.rigs.mre.axial.loop_data import LoopData, LoopFit
from pipeline.rigs.mre.axial.loop_fit import fit_loop
from pipeline.rigs.mre.axial.motion import Motion, as_read, rates, read_finely
from pipeline.rigs.mre.axial.numbers import Numbers, d_max_of, numbers_of
from pipeline.rigs.mre.axial.record import Samples, UnfitError, noise_of, pads_of, samples_of
from pipeline.rigs.mre.axial.standstill import fitted_data, thinned

# A drift must improve the misfit by this (chi-square of one unknown, 1 in 10^6) and be this share of the force.
_DRIFT_SEEN, _DRIFT_SHARE = 24.0, 3e-3
_OFFSET_SHARE = 0.05
_SMALL_FORCE = 3.0  # N
_MISFIT, _MISFIT_REJECTED = 0.02, 0.08
_FEW = 40
_BETTER = 0.9
# Readings are taken as they are where their noise in terms of force is below this share of the force's own, at a
# constant rate and at any other.
_FINE, _FINE_VARYING = 0.5, 3.0
_ENERGY_SHARE = 5e-3


@dataclass(eq=False)
class RunFit:
    """A fitted run: its numbers, what is doubted (a warning each), and what rejects it."""

    recording: Recording
    samples: Samples
    fit: LoopFit
    numbers: Numbers
    doubts: list[str] = field(default_factory=list)
    rejected: list[str] = field(default_factory=list)
    said: list[QualityFinding] = field(default_factory=list)

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.recording.run

    @property
    def d_max(self) -> float:
        """Displacement at the turn, m."""
        return d_max_of(self.fit)

    @property
    def nrmse(self) -> float:
        """Residual (rms) over the rms of the force about its mean."""
        return self.fit.sigma / max(float(np.std(self.fit.data.force)), 1e-300)

    @property
    def rate(self) -> float:
        """Rate of the first stroke, m/s."""
        return rates(self.fit.data.motion)[0]


def fit_run(recording: Recording) -> RunFit:
    """Fit one run.

    Raises
    ------
    UnfitError
        If the run cannot be used.
    """
    said: list[QualityFinding] = []
    doubts: list[str] = []
    samples = samples_of(recording, said.append)
    doubts += [finding.message for finding in said if finding.level == "warning"]
    samples, jumped = without_gauge_jumps(samples)
    doubts += jumped
    samples, spread, cut = from_contact(samples)
    doubts += cut
    motion = moved(samples)
    release = ""
    if len(motion.strokes) > 1:
        lost = backlash(samples, motion)
        if lost > 0:
            release = f"the release begins with {1e3 * lost:.2g} mm of displacement without any change of force (screw backlash)"
            doubts.append(f"{release}: displacement was not measured at the pad. Only the loading branch is used.")
            end = motion.strokes[0].end
            samples = samples.between(samples.time[0], end)
            motion = moved(samples)
    data, relaxed = fitted_data(thinned(samples, len(motion.strokes)), motion)
    data = replace(data, start_spread=spread)
    doubts += relaxed
    try:
        fine = _fine(data)
        fit = fit_loop(fine or data)
        if motion.step == 0 and fine is None and not (_constant(motion) and not _systematic(fit)):
            fit = _or_as_read(fit)
    except ValueError as error:
        raise UnfitError(str(error)) from error
    fit, jumped = with_force_jumps(fit)
    doubts += jumped
    fit, drifting = _with_drift(fit)
    doubts += drifting
    numbers = numbers_of(fit, release=release)
    found = RunFit(recording, samples, fit, numbers, [*doubts, *(r for r in numbers.remarks if r != release)], [], said)
    _judge(found)
    return found


def _fine(data: LoopData) -> LoopData | None:
    """Return the data with the readings as they are where their noise is small beside that of the force, else None.

    A polynomial in time would be no better there, and at its ends, where hysteresis builds up, worse.
    """
    motion = data.motion
    if motion.step or data.d_read is None:
        return None
    spread = max(s.marks.spread for s in motion.strokes)
    share = float(np.ptp(data.force)) / float(np.ptp(data.d_read)) * spread / max(noise_of(data.force), 1e-12)
    if share > (_FINE if _constant(motion) else _FINE_VARYING):
        return None
    return replace(data, motion=read_finely(motion, data.time, data.d_read))


def _constant(motion: Motion) -> bool:
    return all(stroke.degree == 1 for stroke in motion.strokes)


def _or_as_read(fit: LoopFit) -> LoopFit:
    """Take fine readings as they are where that fits the force better than a motion that is smooth in time.

    So it is where somebody read the force at marks of the gauge, at moments of no regularity.
    """
    assert fit.data.d_read is not None
    tried = fit_loop(replace(fit.data, motion=as_read(fit.data.motion, fit.data.d_read)))
    return tried if tried.sigma < _BETTER * fit.sigma else fit


def _with_drift(fit: LoopFit) -> tuple[LoopFit, list[str]]:
    """Add a drift of the force in time where the loop asks for it."""
    data = fit.data
    if len(data.motion.strokes) < 2:
        return fit, []
    t = (data.time - data.time[0]) / max(float(np.ptp(data.time)), 1e-12)
    w = along_strokes(fit.path.d, fit.path.stroke, fit.path.turns.tolist(), fit.model.rho)
    A = np.column_stack([fit.path.d, fit.path.d**3, w, np.ones(t.size), data.extra])
    if not _improves(_left(A, data.force), _left(np.column_stack([A, t]), data.force)):
        return fit, []
    tried = fit_loop(replace(data, extra=np.column_stack([data.extra, t]), extra_names=(*data.extra_names, "drift")))
    drift = float(tried.z[1 + len(tried.standing) + 4 + data.extra.shape[1]])
    if not _improves(fit.residual, tried.residual) or abs(drift) < _DRIFT_SHARE * float(np.ptp(data.force)):
        return fit, []
    minutes = float(np.ptp(data.time)) / 60
    return tried, [
        f"the force drifts by {drift:+.3g} N over the run ({drift / minutes:+.2g} N a minute): a drifting sensor or relaxation. A straight line in time was "
        "fitted along and taken off; a drift that is not straight leaves errors in loss and drop."
    ]


def _improves(before: np.ndarray, after: np.ndarray) -> bool:
    """Tell whether one more column improves the misfit beyond chance, the rest's correlation allowed for."""
    ratio = float(before @ before) / max(float(after @ after), 1e-300)
    return effective_size(after, 6) * math.log(max(ratio, 1.0)) > _DRIFT_SEEN


def _left(A: np.ndarray, F: np.ndarray) -> np.ndarray:
    scaled = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    c, *_ = np.linalg.lstsq(scaled, F, rcond=None)
    return np.asarray(F - scaled @ c)


def _judge(found: RunFit) -> None:
    """Doubt or reject by what the fit shows."""
    fit, numbers = found.fit, found.numbers.estimates
    span = float(np.ptp(fit.data.force))
    if not fit.data.motion.smooth and fit.data.motion.step:
        found.doubts.append(
            "the press moved neither at a constant nor at a smoothly changing rate: of a coarse gauge only the passages from step to step are used."
        )
    stiffness = numbers["stiffness"]
    below = _release_below(fit)
    if below < -max(_ENERGY_SHARE * span, 4 * noise_of(fit.data.force) / math.sqrt(max(fit.n / 4, 1))):
        found.rejected.append(
            f"the release lies above the loading, by {-below:.3g} N on average: the pad would give energy. Force late, channels exchanged, or samples in the wrong order."
        )
    if stiffness.value is not None and stiffness.value <= 0:
        found.rejected.append(
            f"the stiffness comes out as {stiffness.value:.3g} N/m: the loop is none of an elastic pad."
        )
    if span < _SMALL_FORCE:
        text = f"the force changes by {span:.3g} N only: it looks like kN taken as N, by which all stiffnesses would be off. Check the unit of force_axial; for a pad that is so soft, give its size"
        if pads_of(found.recording) is None:
            found.rejected.append(f"{text}.")
        else:
            found.doubts.append(
                f"the force changes by {span:.3g} N only: is it kN taken as N? All stiffnesses would be off by that factor."
            )
    if abs(fit.offset) > _OFFSET_SHARE * span:
        found.doubts.append(
            f"the force at zero displacement is {fit.offset:.3g} N, {100 * abs(fit.offset) / span:.0f} % of its range: the load cell's zero, or a pad that was loaded "
            "before. It is taken off; if it is a preload, secant stiffness and cubic term are those from that state, and the memory of the loop did not start at zero."
        )
    misfit = _misfit(fit)
    if misfit > _MISFIT_REJECTED:
        found.rejected.append(
            f"the loop model misses the force by {100 * misfit:.2g} % (rms): it does not describe this loop."
        )
    elif misfit > _MISFIT:
        found.doubts.append(
            f"the loop model misses the force by {100 * misfit:.2g} % (rms), more than sensors do: its numbers may be off by more than their intervals."
        )
    elif fit.effective < 0.3 * fit.n and _systematic(fit):
        found.doubts.append(
            f"the residual is no noise ({fit.n} samples count as {fit.effective:.0f}): the loop differs from the model by {fit.sigma:.2g} N (rms), so that its numbers may be off by more than their intervals."
        )
    if fit.n < _FEW:
        found.doubts.append(f"only {fit.n} samples: intervals are wide.")


def _release_below(fit: LoopFit) -> float:
    """Return by how much the first release lies below the loading before it, on average over both, N; 0 without one."""
    up, down = (fit.path.stroke == i for i in (0, 1))
    if up.sum() < 4 or down.sum() < 4:
        return 0.0
    d, F = fit.path.d, fit.data.force
    grid = np.linspace(max(d[up].min(), d[down].min()), min(d[up].max(), d[down].max()), 200)
    loading, release = (np.interp(grid, d[part][order], F[part][order]) for part in (up, down) for order in [np.argsort(d[part], kind="stable")])  # fmt: skip
    return float(np.mean(loading - release))


def _misfit(fit: LoopFit) -> float:
    """Return the residual beyond the noise from sample to sample, over the rms of the force about its mean."""
    beyond = math.sqrt(max(fit.sigma**2 - (1.2 * noise_of(fit.data.force)) ** 2, 0.0))
    return beyond / max(float(np.std(fit.data.force)), 1e-300)


def _systematic(fit: LoopFit) -> bool:
    """Tell whether the residual is larger than the noise from sample to sample."""
    return fit.sigma > 1.3 * noise_of(fit.data.force)


def curves_of(found: RunFit, points: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return displacement (m), force of the model without offset (N), its 95 % half width, stroke; along the loop."""
    fit = found.fit
    turns = fit.path.turns
    d = np.concatenate([np.linspace(turns[i], turns[i + 1], points) for i in range(turns.size - 1)])
    stroke = np.repeat(np.arange(turns.size - 1), points)
    model: LoopModel = fit.model
    F = model.force(d, along_strokes(d, stroke, turns.tolist(), model.rho))
    half = np.full(d.size, t_quantile(fit.covariance.dof) * fit.sigma / math.sqrt(fit.effective))
    return d, F, half, stroke
