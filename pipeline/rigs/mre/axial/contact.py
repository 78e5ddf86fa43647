"""Where a log of compression begins to be one: first contact, free travel, a start under load; and screw backlash."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.mre.axial.gauge import finest
from pipeline.rigs.mre.axial.motion import LEAST_STROKE, Motion, motion_of
from pipeline.rigs.mre.axial.record import Samples, UnfitError, noise_of

# Free travel before contact: at least so many steps and this share of the stroke.
_FREE_STEPS, _FREE_SHARE = 3.0, 0.04


def moved(samples: Samples) -> Motion:
    """Return the motion behind the gauge; UnfitError where there is none."""
    try:
        return motion_of(samples.gauge_time, samples.x)
    except ValueError as error:
        raise UnfitError(str(error), "displacement_axial") from error


def from_contact(samples: Samples) -> tuple[Samples, float, list[str]]:
    """Let the record begin with the first loading, at first contact; return how well that is known (m) and what was cut."""
    motion = moved(samples)
    doubts = []
    first = motion.strokes[0]
    if first.direction < 0:
        if len(motion.strokes) == 1:
            raise UnfitError(
                "the log holds a release only: loading from first contact is missing", "displacement_axial"
            )
        samples = samples.between(first.end, samples.gauge_time[-1])
        doubts.append(f"the log begins with a release; what is before {first.end:.4g} s is left out.")
        motion = moved(samples)
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
    sigma = noise_of(samples.F)
    early = x <= max(motion.step, 0.02 * length)
    base = float(np.median(F[early])) if early.any() else float(F[0])
    rise = max(min(5 * sigma, 0.03 * float(np.ptp(F))), 0.01 * float(np.ptp(F)))
    risen = rise < F - base
    # The first of those that stay risen.
    below = np.flatnonzero(~risen)
    at = int(below[-1]) + 1 if below.size else 0
    if not 3 <= at < x.size:
        return 0.0
    free = float(x[at - 1])
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


def backlash(samples: Samples, motion: Motion) -> float:
    """Return how far the displacement goes back after the turn before the force falls, m; 0 where it falls at once."""
    down = motion.strokes[1]
    x, F = samples.reading_at_force(), samples.F
    sigma = noise_of(F)
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
