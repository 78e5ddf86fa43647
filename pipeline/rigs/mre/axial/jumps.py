"""Jumps that no pad makes: of the gauge alone, of the force beside the displacement, and of the force at every turn.

A jump of the gauge is taken off its readings; one of the force becomes a column of the fit. Each is said.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.mre.axial.gauge import finest, step_of
from pipeline.rigs.mre.axial.loop import along_strokes
from pipeline.rigs.mre.axial.loop_data import LoopFit
from pipeline.rigs.mre.axial.loop_fit import fit_loop
from pipeline.rigs.mre.axial.record import Samples, noise_of

# A jump of the gauge: beyond so many steps or times its usual way from sample to sample, with less than this share
# of the force that the pad would answer with.
_STEPS, _WAYS, _ANSWERED = 1.5, 6.0, 0.4
_STAYS = 0.6  # share of a jump that the readings after it keep
_MOST = 3
# Chi-square by which a jump of the force must improve the fit; it is sought at every sample.
_SEEN = 35.0
_SHARE = 2e-3
# Jumps this close to a turn (share of the log) or to the ends are not told from the turn.
_CLEAR = 0.02
_SHARP = 0.3  # of 1/rho, what a sample may cover


def without_gauge_jumps(samples: Samples) -> tuple[Samples, list[str]]:
    """Take off what the gauge jumps by while the force stays; return what was found."""
    x, t = samples.x, samples.gauge_time
    way = np.diff(x)
    step = step_of(x)
    moved = np.abs(x[5:] - x[:-5]) / 5
    usual = float(np.median(moved[moved > 0])) if np.any(moved > 0) else 0.0
    noise = 0.0 if step else 8 * float(np.median(np.abs(np.diff(x, 2)))) / 0.6745 / math.sqrt(6)
    least = (_STEPS * step if step else max(3 * finest(x), _WAYS * usual, noise)) + usual
    F = np.interp(t, samples.time, samples.F)
    near = np.diff(t) < 3 * float(np.median(np.diff(t)))
    at = np.flatnonzero((np.abs(way) > least) & near)
    stiffness = float(np.ptp(F)) / max(float(np.ptp(x)), 1e-12)
    told = []
    for i in at.tolist():
        before, after = F[max(i - 3, 0) : i + 1], F[i + 1 : i + 5]
        answer = float(after.mean() - before.mean()) / stiffness
        stays = float(np.median(x[i + 1 : i + 6]) - np.median(x[max(i - 4, 0) : i + 1])) / float(way[i]) > _STAYS
        silent = answer * np.sign(way[i]) < _ANSWERED * abs(way[i])
        if 3 <= i < x.size - 4 and stays and silent and stiffness * abs(way[i]) > 4 * noise_of(samples.F):
            told.append(i)
    if not 0 < len(told) <= _MOST:
        return samples, []
    mended = x.copy()
    doubts = []
    for i in told:
        jump = float(way[i]) - (0.0 if step else math.copysign(usual, way[i]))
        mended[i + 1 :] -= jump
        doubts.append(
            f"the gauge jumps by {1e3 * jump:+.3g} mm at {t[i]:.4g} s while the force does not follow: slipped, or set anew. The jump was taken off; half a step of the gauge may remain."
        )
    return replace(samples, x=mended), doubts


def with_force_jumps(fit: LoopFit) -> tuple[LoopFit, list[str]]:
    """Add a step of the force at each turn, or at one moment, where the loop asks for it; return what was found."""
    doubts = []
    for _ in range(2):
        column, moment, gain = _best(fit)
        name = "turned" if moment is None else "jumped"
        if gain < _SEEN or name in fit.data.extra_names:
            break
        data = fit.data
        extra = np.column_stack([data.extra, column])
        tried = fit_loop(replace(data, extra=extra, extra_names=(*data.extra_names, name)))
        size = float(tried.z[1 + len(tried.standing) + 4 + data.extra.shape[1]])
        ratio = float(fit.residual @ fit.residual) / max(float(tried.residual @ tried.residual), 1e-300)
        small = abs(size) < _SHARE * float(np.ptp(data.force))
        # A moment that leaves more than noise behind is not the fault of the log.
        other = moment is not None and tried.sigma > 1.3 * noise_of(data.force)
        if small or other or tried.effective * math.log(max(ratio, 1.0)) < _SEEN:
            break
        fit = tried
        play = 1e6 * abs(size) / max(fit.model.k, 1e-12)
        doubts.append(
            f"the force jumps by {size:+.3g} N at {moment:.4g} s with no motion to match: the load cell or its zero, {play:.2g} um of the gauge, or a slip. The jump was fitted along and taken off."
            if moment is not None
            else f"the force steps by {2 * abs(size):.3g} N at every turn of the motion: dry friction of the press, or {2 * play:.2g} um of play between gauge and pad. It was fitted along and is "
            "in neither alpha nor loss; if the pad itself does this, both are larger."
        )
    return fit, doubts


def _best(fit: LoopFit) -> tuple[np.ndarray, float | None, float]:
    """Return the column that improves the fit most, its moment (s; None at every turn) and its chi-square.

    The linear unknowns and rho are refitted to first order; a coloured residual counts as fewer samples.
    """
    path, time = fit.path, fit.data.time
    turns, rho = path.turns.tolist(), fit.model.rho
    w, more, less = (along_strokes(path.d, path.stroke, turns, f * rho) for f in (1.0, 1.01, 0.99))
    A = np.column_stack([path.d, path.d**3, w, (more - less) / 0.02, np.ones(time.size), fit.data.extra])
    Q, _ = np.linalg.qr(A / np.maximum(np.linalg.norm(A, axis=0), 1e-300))
    left = fit.residual - Q @ (Q.T @ fit.residual)

    directions = np.array([s.direction for s in fit.data.motion.strokes])
    turned = directions[np.clip(path.stroke, 0, directions.size - 1)]
    stands = "relaxed" in fit.data.extra_names
    found: list[tuple[np.ndarray, float | None, float]] = []
    # Hysteresis that builds up within a sample or two is itself a step at every turn.
    sharp = rho * float(np.abs(np.diff(path.turns)).max()) * len(turns) / time.size > _SHARP
    if np.ptp(turned) > 0 and not stands and not sharp:
        found.append((turned, None, _gain(turned, Q, left)))
    # A step is 1 after its sample: sums from the end give every step's products at once.
    after = np.cumsum(left[::-1])[::-1]
    shares = np.cumsum(Q[::-1], axis=0)[::-1]
    count = np.arange(time.size, 0, -1.0)
    norm = count - np.sum(shares**2, axis=1)
    margin = _CLEAR * float(np.ptp(time))
    ends = np.r_[time[0], [s.end for s in fit.data.motion.strokes], time[-1]]
    clear = np.min(np.abs(time[:, None] - ends[None, :]), axis=1) > margin
    score = np.where(clear & (norm > 1e-6 * time.size), after**2 / np.maximum(norm, 1e-12), 0.0)
    i = int(np.argmax(score))
    step = (np.arange(time.size) >= i).astype(float)
    found.append((step, float(time[i]), _gain(step, Q, left)))
    return max(found, key=lambda each: each[2])


def _gain(column: np.ndarray, Q: np.ndarray, left: np.ndarray) -> float:
    column = column - Q @ (Q.T @ column)
    norm = float(column @ column)
    if norm < 1e-6 * left.size:
        return 0.0
    size = float(column @ left) / norm
    after = left - size * column
    sigma2 = max(float(after @ after) / left.size, 1e-300)
    correlated = float(np.clip(effective_size(after, Q.shape[1] + 1) / left.size, 0.1, 1.0))
    return size**2 * norm / sigma2 * correlated
