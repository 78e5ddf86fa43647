"""One run: where contact begins and the press stands still, the fit, and what of the run is to be doubted."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.estimation.uncertainty import effective_size, t_quantile
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.axial.gauge import finest
from pipeline.rigs.mre.axial.loop import LoopModel, along_strokes
from pipeline.rigs.mre.axial.loop_fit import LoopData, LoopFit, fit_loop
from pipeline.rigs.mre.axial.motion import LEAST_STROKE, Motion, motion_of, rates
from pipeline.rigs.mre.axial.numbers import Numbers, d_max_of, numbers_of
from pipeline.rigs.mre.axial.record import Samples, UnfitError, samples_of

# Free travel before contact: at least so many steps and this share of the stroke.
_FREE_STEPS, _FREE_SHARE = 3.0, 0.04
# A drift must improve the misfit by this (chi-square of one unknown, 1 in 10^6) and be this share of the force.
_DRIFT_SEEN, _DRIFT_SHARE = 24.0, 3e-3
_OFFSET_SHARE = 0.05
_SMALL_FORCE = 3.0  # N
_MISFIT, _MISFIT_REJECTED = 0.02, 0.08
_RELAXED_SIGMA = 4.0
_FEW = 40
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
    samples, spread, cut = _from_contact(samples)
    doubts += cut
    motion = _motion(samples)
    release = ""
    if len(motion.strokes) > 1:
        lost = _backlash(samples, motion)
        if lost > 0:
            release = f"the release begins with {1e3 * lost:.2g} mm of displacement without any change of force (screw backlash)"
            doubts.append(f"{release}: displacement was not measured at the pad. Only the loading branch is used.")
            end = motion.strokes[0].end
            samples = samples.between(samples.time[0], end)
            motion = _motion(samples)
    data, relaxed = _data(samples, motion)
    data = replace(data, start_spread=spread)
    doubts += relaxed
    try:
        fit = fit_loop(data)
    except ValueError as error:
        raise UnfitError(str(error)) from error
    fit, drifting = _with_drift(fit)
    doubts += drifting
    numbers = numbers_of(fit, release=release)
    found = RunFit(recording, samples, fit, numbers, [*doubts, *(r for r in numbers.remarks if r != release)], [], said)
    _judge(found)
    return found


def _motion(samples: Samples) -> Motion:
    try:
        return motion_of(samples.gauge_time, samples.x)
    except ValueError as error:
        raise UnfitError(str(error), "displacement_axial") from error


def _from_contact(samples: Samples) -> tuple[Samples, float, list[str]]:
    """Let the record begin with the first loading, at first contact; return how well that is known (m) and what was cut."""
    motion = _motion(samples)
    doubts = []
    first = motion.strokes[0]
    if first.direction < 0:
        if len(motion.strokes) == 1:
            raise UnfitError(
                "the log holds a release only: loading from first contact is missing", "displacement_axial"
            )
        samples = samples.between(first.end, samples.gauge_time[-1])
        doubts.append(f"the log begins with a release; what is before {first.end:.4g} s is left out.")
        motion = _motion(samples)
        first = motion.strokes[0]
    start = samples.x[0]
    _refuse_loaded_start(samples, motion)
    contact, spread = _free_travel(samples, motion), 0.0
    if contact > 0:
        spread = max(motion.step, 0.01 * float(np.ptp(samples.x)))
        place = start + contact
        doubts.append(
            f"the force stays level over the first {1e3 * contact:.3g} mm: the pad is met only there. Displacement counts from this first contact."
        )
        at = float(np.interp(place, first.marks.d, first.marks.time))
        end = samples.gauge_time[-1]
        last = motion.strokes[-1]
        if last.direction < 0 and last.marks.d.min() < place:
            order = np.argsort(last.marks.d)
            end = float(np.interp(place, last.marks.d[order], last.marks.time[order]))
        samples = samples.between(at, end)
    elif abs(start) > 1.6 * max(motion.step, finest(samples.x)) + 0.01 * float(np.ptp(samples.x)):
        doubts.append(
            f"the gauge stands at {1e3 * start:.4g} mm at the start, not at zero: displacement counts from there. If the pad was already compressed, "
            "secant stiffness and cubic term are those from that state."
        )
    return samples, spread, doubts


def _refuse_loaded_start(samples: Samples, motion: Motion) -> None:
    """Refuse a log that begins in the middle of a loading: first contact, where w is 0, is not in it."""
    start, length = float(samples.x[0]), float(np.ptp(samples.x))
    level = float(np.median(samples.F[:5]))
    reached = float(samples.x.max()) - start
    slope = (float(samples.F.max()) - level) / max(reached, 1e-12)
    # Where the release comes back below the start, the force there tells the zero; else the load cell's own does.
    zero = float(samples.F.min()) if samples.x.min() < start - 0.1 * length else 0.0
    if start > 0.1 * reached + 2 * motion.step and 0.4 < (level - zero) / max(slope * start, 1e-12) < 2.5:
        raise UnfitError(
            f"the log begins at {1e3 * start:.3g} mm under {level:.4g} N, in the middle of a loading: loading from first contact is missing",
            "displacement_axial",
        )


def _free_travel(samples: Samples, motion: Motion) -> float:
    """Return how far the press goes before the force rises, m; 0 where it rises at once."""
    s = motion.strokes[0]
    here = (samples.time >= s.start) & (samples.time <= s.end)
    x, F = samples.reading_at_force()[here], samples.F[here]
    x = x - samples.x[0]
    length = float(x.max())
    if F.size < 12:
        return 0.0
    sigma = _noise(samples.F)
    early = x <= max(motion.step, 0.02 * length)
    base = float(np.median(F[early])) if early.any() else float(F[0])
    rise = max(5 * sigma, 0.01 * float(np.ptp(F)))
    risen = rise < F - base
    # The first of those that stay risen.
    below = np.flatnonzero(~risen)
    at = int(below[-1]) + 1 if below.size else 0
    if at >= x.size:
        return 0.0
    free = float(x[at])
    # A force that rises from the start in proportion is this high there already.
    proportional = rise / (float(np.ptp(F)) / length)
    if free < max(_FREE_STEPS * motion.step, _FREE_SHARE * length) or free < 4 * proportional:
        return 0.0
    # First contact: where a line through the first rise meets the level before.
    rise_part = (x >= free) & (x <= free + 0.06 * length)
    if rise_part.sum() < 5:
        return free - proportional
    slope, level = np.polyfit(x[rise_part], F[rise_part], 1)
    meets = (base - level) / slope if slope > 0 else free
    return float(np.clip(meets, free - 3 * proportional - motion.step, free))


def _backlash(samples: Samples, motion: Motion) -> float:
    """Return how far the displacement goes back after the turn before the force falls, m; 0 where it falls at once."""
    down = motion.strokes[1]
    x, F = samples.reading_at_force(), samples.F
    sigma = _noise(F)
    near = x.max() - 0.5 * motion.step - 1e-12
    loaded = (samples.time <= down.start) & (x >= near)
    back = (samples.time >= down.start) & (samples.time <= down.end)
    if loaded.sum() < 1 or back.sum() < 8:
        return 0.0
    stiffness = float(np.ptp(F)) / float(np.ptp(x))
    top = float(np.median(F[loaded][-3:]))
    fall = max(5 * sigma, 0.02 * float(np.ptp(F)))
    still = np.flatnonzero(F[back] > top - fall)
    if not still.size:
        return 0.0
    gone = float(x.max() - x[back][still[-1]])
    expected = fall / stiffness
    return gone if gone > 2.5 * expected + 2 * motion.step and gone > LEAST_STROKE / 2 * float(np.ptp(x)) else 0.0


def _data(samples: Samples, motion: Motion) -> tuple[LoopData, list[str]]:
    """Return what is fitted: standstills in which the force relaxes leave their samples out and a step in."""
    time, F = samples.time, samples.F
    kept = np.ones(time.size, dtype=bool)
    columns: list[np.ndarray] = []
    names: list[str] = []
    doubts: list[str] = []
    speeds = [abs(rate) for rate in rates(motion)]
    usual = float(np.median(np.diff(time)))
    for i in range(len(motion.strokes) + 1):
        before = motion.strokes[i - 1] if i else None
        after = motion.strokes[i] if i < len(motion.strokes) else None
        begin = before.marks.time[-1] + motion.step / speeds[i - 1] if before else time[0]
        end = after.marks.time[0] - motion.step / speeds[i] if after else time[-1]
        rest = (time > begin) & (time < end)
        if motion.step == 0 or end - begin < 3 * usual or rest.sum() < 4:
            continue
        if after is None:
            kept &= ~rest
            continue
        t, f = time[rest], F[rest]
        line = np.polyfit(t - t.mean(), f, 1)
        noise = float(np.std(f - np.polyval(line, t - t.mean())))
        change = float(line[0]) * float(np.ptp(t))
        sd = noise / math.sqrt(t.size / 12)
        if before is None or abs(change) < max(_RELAXED_SIGMA * sd, 2e-3 * float(np.ptp(F))):
            continue
        kept &= ~rest
        columns.append((time > end).astype(float))
        names.append("relaxed")
        doubts.append(
            f"the press stood still for {end - begin:.3g} s at the turn and the force {'relaxed' if change < 0 else 'changed'} by {abs(change):.3g} N: the loop "
            "model has no such relaxation; it was fitted as a step, and drop and loss hold what it leaves."
        )
    extra = np.column_stack(columns)[kept] if columns else np.zeros((int(kept.sum()), 0))
    moving = LoopData(time[kept], F[kept], motion, extra, tuple(names), samples.reading_at_force()[kept])
    return (moving if motion.smooth else _at_marks(moving)), doubts


def _at_marks(data: LoopData) -> LoopData:
    """Keep the motion where it is known: at the gauge's marks, with the force between the samples beside them."""
    motion = data.motion
    if motion.step == 0:
        return data
    t = np.concatenate([s.marks.time for s in motion.strokes])
    d = np.concatenate([s.marks.d for s in motion.strokes])
    extra = [np.interp(t, data.time, column) for column in data.extra.T]
    return LoopData(
        t, np.interp(t, data.time, data.force), motion, np.column_stack(extra) if extra else np.zeros((t.size, 0)),
        data.extra_names, d,
    )  # fmt: skip


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
    if not fit.data.motion.smooth:
        found.doubts.append(
            "the press moved neither at a constant nor at a smoothly changing rate: of a coarse gauge only the passages from step to step are used."
            if fit.data.motion.step
            else "the press did not move smoothly: readings are used as they are."
        )
    stiffness = numbers["stiffness"]
    below = _release_below(fit)
    if below < -max(_ENERGY_SHARE * span, 4 * _noise(fit.data.force) / math.sqrt(max(fit.n / 4, 1))):
        found.rejected.append(
            f"the release lies above the loading, by {-below:.3g} N on average: the pad would give energy. Force late, channels exchanged, or samples in the wrong order."
        )
    if stiffness.value is not None and stiffness.value <= 0:
        found.rejected.append(
            f"the stiffness comes out as {stiffness.value:.3g} N/m: the loop is none of an elastic pad."
        )
    if span < _SMALL_FORCE:
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


def _noise(F: np.ndarray) -> float:
    """Return the noise of a slow force from sample to sample, N."""
    return float(np.median(np.abs(np.diff(F, 2)))) / 0.6745 / math.sqrt(6)


def _misfit(fit: LoopFit) -> float:
    """Return the residual beyond the noise from sample to sample, over the rms of the force about its mean."""
    beyond = math.sqrt(max(fit.sigma**2 - (1.2 * _noise(fit.data.force)) ** 2, 0.0))
    return beyond / max(float(np.std(fit.data.force)), 1e-300)


def _systematic(fit: LoopFit) -> bool:
    """Tell whether the residual is larger than the noise from sample to sample."""
    return fit.sigma > 1.3 * _noise(fit.data.force)


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
