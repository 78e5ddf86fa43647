"""What of a log is fitted: standstills in which the force relaxes are left out, with a step of the force in their place."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.rigs.mre.axial.loop_data import LoopData
from pipeline.rigs.mre.axial.motion import Motion, rates
from pipeline.rigs.mre.axial.record import Samples

# A change of the force during a standstill that counts, in standard errors and as a share of its range.
_RELAXED_SIGMA, _RELAXED_SHARE = 4.0, 2e-3
# A force that changes at this share of its rate in motion means that the pad moves, whatever the gauge shows.
_AS_IF_MOVING = 0.5


_MOST = 3000  # samples of the force, beyond which they are averaged, and a fifth as many for each stroke


def thinned(samples: Samples, strokes: int) -> Samples:
    """Return the samples with the force averaged over stretches too short to bend."""
    size = samples.time.size // max(_MOST, _MOST // 5 * strokes)
    if size < 2:
        return samples
    n = samples.time.size // size * size
    time, F = (values[:n].reshape(-1, size).mean(axis=1) for values in (samples.time, samples.F))
    return replace(samples, time=time, F=F)


def fitted_data(samples: Samples, motion: Motion) -> tuple[LoopData, list[str]]:
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
        if before is None or abs(change) < max(_RELAXED_SIGMA * sd, _RELAXED_SHARE * float(np.ptp(F))):
            continue
        kept &= ~rest
        columns.append((time > end).astype(float))
        names.append("relaxed")
        stiffness = float(np.ptp(F)) / max(float(np.ptp(samples.x)), 1e-12)
        if abs(float(line[0])) > _AS_IF_MOVING * stiffness * speeds[i]:
            doubts.append(
                f"the gauge stood still for {end - begin:.3g} s at the turn while the force went on by {abs(change):.3g} N as fast as when it moves: play of up to "
                f"{1e6 * speeds[i] * (end - begin):.2g} um in the gauge or the screw. It was fitted as a step, and drop and loss hold what it leaves."
            )
            continue
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
