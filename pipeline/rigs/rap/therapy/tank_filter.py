"""Volume in the ultrafiltrate tank and gain of its pump by a Kalman filter on the level (rap.md, eq. 9 and 5.6).

Filtered values use the past only, as the device could; smoothed ones back-fill the blind start for the report.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.tank import Tank
from pipeline.rigs.rap.therapy.command import Command
from pipeline.rigs.rap.therapy.consistency import Consistency, consistency
from pipeline.rigs.rap.therapy.drains import Emptying
from pipeline.rigs.rap.therapy.fillings import Segment, causes, first_volume, not_empty, segment, without_wild_start
from pipeline.rigs.rap.therapy.level_colour import by_minutes, colour_of
from pipeline.rigs.rap.therapy.levels import Levels
from pipeline.rigs.rap.therapy.tank_kalman import EMPTY_SD, GATE, LITRE, NOISE, PATIENCE, Course, TankFilter

# How well eq. 9's guesses of the noise are believed, standard deviation of the logarithm of the variance.
_FREE, _HELD = 5.0, 1.4


@dataclass(frozen=True, eq=False)
class TankCourse:
    """Volume in the tank over a run; arrays (m,), SI.

    Attributes
    ----------
    volume, volume_sd, gain, gain_sd
        Filtered (past only), with standard errors that hold what the test of consistency asks for.
    smoothed_volume, smoothed_sd, smoothed_gain, smoothed_gain_sd
        With the later levels used as well.
    measured_volume
        Area times level, m^3; NaN without a usable level.
    innovation, innovation_sd, gated
        Level less prediction (m), its standard deviation, and whether it was passed over.
    common_sd
        What the air's temperature leaves uncertain, the same for neighbours, m^3.
    echo_variance, driving
        Variance of one level as used, m^6, (m,); variances that drive volume (litre^2/s) and gain (1/s) as used, (2,).
    total, total_sd
        Removed over all segments, m^3.
    """

    time: np.ndarray
    volume: np.ndarray
    volume_sd: np.ndarray
    gain: np.ndarray
    gain_sd: np.ndarray
    smoothed_volume: np.ndarray
    smoothed_sd: np.ndarray
    smoothed_gain: np.ndarray
    smoothed_gain_sd: np.ndarray
    measured_volume: np.ndarray
    innovation: np.ndarray
    innovation_sd: np.ndarray
    gated: np.ndarray
    common_sd: np.ndarray
    echo_variance: np.ndarray
    driving: np.ndarray
    segments: tuple[Segment, ...]
    first_echo: float | None
    last_echo: float | None
    final: Estimate
    total: float
    total_sd: float
    consistency: Consistency
    problems: tuple[QualityFinding, ...]

    @property
    def nis(self) -> np.ndarray:
        """Normalised innovation squared, (m,); NaN without a level."""
        return np.asarray((self.innovation / self.innovation_sd) ** 2)


def track_volume(
    levels: Levels,
    tank: Tank,
    command: Command,
    *,
    emptied: Sequence[Emptying] = (),
    empty_at_start: bool = False,
    gate: float = GATE,
    compiled: bool = True,
) -> TankCourse:
    """Follow the volume in the tank.

    Parameters
    ----------
    levels
        From `level_course`.
    emptied
        From `drains.emptied`: each closes a segment.
    empty_at_start
        Whether a drain event tells that the tank was empty at the start; else the first levels tell the volume, and
        what ran in before them is filled in backwards.
    gate
        Innovation^2/S beyond which a level is passed over.
    compiled
        False: by filterpy itself, step by step.
    """
    time = levels.time
    steps = np.diff(time, prepend=time[:1])
    asked = np.diff(command.volume(time), prepend=command.volume(time[:1])) / LITRE
    starts = [0, *(int(np.searchsorted(time, e.time)) for e in emptied)]
    ends = [*starts[1:], time.size]
    known = [empty_at_start, *(e.announced for e in emptied)]
    height = levels.level.copy()
    for e in emptied:
        height[(time > e.span[0]) & (time < e.span[1])] = np.nan
    spans, left = [], []
    for a, b, key in zip(starts, ends, known, strict=True):
        if b > a:
            rest = not_empty(height[a:b], asked[a:b], tank.area) if key else None
            spans.append((a, b, key and rest is None))
            left += [(float(time[a]), rest)] if rest is not None else []

    def filtered(
        noise_factor: float, driving: np.ndarray, minutes: tuple[np.ndarray, np.ndarray] | None = None
    ) -> list[tuple[TankFilter, Course]]:
        out = []
        for a, b, is_empty in spans:
            level = without_wild_start(height[a:b], asked[a:b], tank.area)
            volume, sd = (0.0, EMPTY_SD) if is_empty else first_volume(level, tank, after_fall=a > 0)
            one = TankFilter(volume, sd, tank.area, noise=driving, compiled=compiled)
            local = steps[a:b].copy()
            local[0] = 0.0
            variance = levels.variance[a:b] * noise_factor
            if minutes is not None:
                level, variance = minutes[0][a:b], minutes[1][a:b]
            out.append((one, one.advance(local, asked[a:b], level, variance, gate)))
        return out

    factor, driving, courses = 1.0, NOISE, filtered(1.0, NOISE)
    told = consistency(*_innovations(courses))
    for _ in range(8):
        if not told.tested or told.band[0] <= told.mean_nis <= told.band[1]:
            break
        factor = max(factor * told.rescale, 0.01)
        courses = filtered(factor, driving)
        told = consistency(*_innovations(courses), noise_factor=factor)
    singly, colour, minutes = courses, 1.0, None
    if told.tested and compiled:
        colour, minutes = _coloured(time, height, asked, levels.variance * factor, tank.area, courses)
        driving = _likeliest(lambda noise: filtered(factor, noise, minutes), gate)
        courses = filtered(factor, driving, minutes)
        singly = courses if minutes is None else filtered(factor, driving)
        told = consistency(*_innovations(courses), noise_factor=factor)
    smooth = [one.smoothed(steps[a:b], asked[a:b], made) for (one, made), (a, b, _) in zip(courses, spans, strict=True)]
    states = np.concatenate([made.states for _, made in courses])
    covariances = np.concatenate([made.covariances for _, made in courses])
    later = np.concatenate([x for x, _ in smooth])
    later_P = np.concatenate([P for _, P in smooth])
    widening = told.widening
    common = levels.common_sd * tank.area
    # Levels that were too wild even to start from have no innovation.
    gated = np.concatenate([made.gated | np.isnan(made.innovation) for _, made in singly]) & np.isfinite(height)
    used = np.isfinite(height) & ~gated
    echoes = np.flatnonzero(used)
    segments = []
    for (_, made), (a, b, is_empty), cause in zip(courses, spans, causes(emptied, len(spans)), strict=True):
        anew = [a + int(i) for i in np.flatnonzero(made.extra > 0.0)]
        for begin, end in itertools.pairwise([a, *anew, b]):
            told_by = cause if end == b else "taken up anew"
            known_empty = is_empty and begin == a
            volumes = later[begin:end, 0] * LITRE
            segments.append(
                segment(time, begin, end, volumes, later_P[begin:end], widening, used[begin:end], told_by, known_empty)
            )
    final_sd = math.hypot(widening * LITRE * math.sqrt(max(covariances[-1, 0, 0], 0.0)), common[-1])
    total = sum(s.gained for s in segments)
    total_sd = math.sqrt(sum(s.gained_sd**2 for s in segments))
    return TankCourse(
        time=time,
        volume=states[:, 0] * LITRE,
        volume_sd=widening * np.sqrt(covariances[:, 0, 0]) * LITRE,
        gain=states[:, 1],
        gain_sd=widening * np.sqrt(covariances[:, 1, 1]),
        smoothed_volume=later[:, 0] * LITRE,
        smoothed_sd=widening * np.sqrt(np.maximum(later_P[:, 0, 0], 0.0)) * LITRE,
        smoothed_gain=later[:, 1],
        smoothed_gain_sd=widening * np.sqrt(np.maximum(later_P[:, 1, 1], 0.0)),
        measured_volume=height * tank.area,
        innovation=np.concatenate([made.innovation for _, made in singly]),
        innovation_sd=np.concatenate([made.spread for _, made in singly]),
        gated=gated,
        common_sd=common,
        echo_variance=levels.variance * factor * colour * tank.area**2,
        driving=driving,
        segments=tuple(segments),
        first_echo=float(time[echoes[0]]) if echoes.size else None,
        last_echo=float(time[echoes[-1]]) if echoes.size else None,
        final=estimate("uf_volume_final", float(states[-1, 0]) * LITRE, final_sd),
        total=float(total),
        total_sd=total_sd,
        consistency=told,
        problems=(*_left(left), *_problems(time, courses, gated, told, echoes.size)),
    )


def _coloured(
    time: np.ndarray,
    height: np.ndarray,
    asked: np.ndarray,
    variance: np.ndarray,
    area: float,
    courses: Sequence[tuple[TankFilter, Course]],
) -> tuple[float, tuple[np.ndarray, np.ndarray] | None]:
    """Return how much echoes hang together, and means over minutes with their variances where they do."""
    if any((made.extra > 0.0).any() for _, made in courses):
        return 1.0, None
    passed = np.concatenate([made.gated | np.isnan(made.innovation) for _, made in courses])
    level, moved = np.where(passed, np.nan, height), np.cumsum(asked) * LITRE / area
    colour = colour_of(time, level, moved, variance)
    return colour, by_minutes(time, level, moved, variance, colour) if colour > 1.0 else None


def _innovations(courses: Sequence[tuple[TankFilter, Course]]) -> tuple[np.ndarray, np.ndarray]:
    """Return innovations over their standard deviation, and which were passed over, where there was a level."""
    y = np.concatenate([made.innovation / made.spread for _, made in courses])
    gated = np.concatenate([made.gated for _, made in courses])
    known = np.isfinite(y)
    return y[known], gated[known]


def _likeliest(filtered: Callable[[np.ndarray], Sequence[tuple[TankFilter, Course]]], gate: float) -> np.ndarray:
    """Return the noise that drives V and s under which the innovations are likeliest.

    Eq. 9's 0.05 mL/s^0.5 and 0.02/h^0.5 are guesses; with noise too large the errors are, too. The gain wanders so slowly
    that a run tells little of it: its guess counts, to a factor of 2 in the standard deviation.
    """
    from scipy.optimize import minimize

    def deviance(log_factors: np.ndarray) -> float:
        total = (float(log_factors[0]) / _FREE) ** 2 + (float(log_factors[1]) / _HELD) ** 2
        for _, made in filtered(NOISE * np.exp(log_factors)):
            known = np.isfinite(made.innovation)
            spread = made.spread[known]
            total += float((2.0 * np.log(spread) + np.minimum((made.innovation[known] / spread) ** 2, gate)).sum())
        return total

    simplex = np.array([[-1.0, -0.5], [1.5, -0.5], [-1.0, 1.0]])
    found = minimize(
        deviance,
        simplex[0],
        method="Nelder-Mead",
        options={"xatol": 0.1, "fatol": 0.05, "initial_simplex": simplex},
    )
    return np.asarray(NOISE * np.exp(np.clip(found.x, -10.0, 10.0)))


def _left(found: Sequence[tuple[float, float]]) -> list[QualityFinding]:
    """Tell of keys pressed on a tank that was not emptied: (s, m^3 left)."""
    return [
        QualityFinding(
            "warning",
            f"drain_pressed says that the tank is empty at {moment:.0f} s, and the level shows {1e6 * rest:.0f} mL in it: the level is "
            "believed. Was it emptied in part, or the key pressed too early?",
            channel="drain_pressed",
            span=(moment, moment),
        )
        for moment, rest in found
    ]


def _problems(
    time: np.ndarray,
    courses: Sequence[tuple[TankFilter, Course]],
    gated: np.ndarray,
    told: Consistency,
    echoes: int,
) -> tuple[QualityFinding, ...]:
    """Return what the filter saw."""
    channel = "uf_level_distance"
    out = []
    extra = np.concatenate([made.extra for _, made in courses])
    for i in np.flatnonzero(extra > 0.0)[:5]:
        text = (
            f"{PATIENCE} echoes in a row lie beyond 3 standard deviations; the volume is taken up anew from the echoes "
            f"({1e6 * math.sqrt(extra[i]) * LITRE:.0f} mL off). Look for a drain without the key, foam, or an echo from the lid."
        )
        out.append(
            QualityFinding("warning", text, channel=channel, span=(float(time[max(i - PATIENCE, 0)]), float(time[i])))
        )
    if echoes:
        share = float(gated.sum()) / (echoes + float(gated.sum()))
        if share > 0.1:
            text = f"{100 * share:.0f} % of the echoes are wild and were passed over; 2 % are usual. Look at the sensor, foam, condensation."
            out.append(QualityFinding("warning", text, channel=channel))
    if told.tested and not told.passed:
        out.append(QualityFinding("warning", told.verdict + ".", channel=channel))
    return tuple(out)
