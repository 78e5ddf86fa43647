"""What kind of mismatch it is and when it began: a step or a drift. A unit that stands still is `frozen`'s."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.rap.alarms.results import Kind, Mismatch

# What lies this far behind the detection says what kind it is, and so far before it the onset is looked for, s.
_BEHIND = 60.0
_BEFORE = 600.0


def described(
    tap: str,
    index: int,
    detected: tuple[float | None, float | None],
    within: tuple[float, float],
    end: float | None,
    time: np.ndarray,
    residual: np.ndarray,
) -> Mismatch:
    """Return a mismatch whose detections (by threshold, by cumulative sum) are known.

    Parameters
    ----------
    within
        Where its onset may lie and where it ends at the latest, s.
    time, residual
        Stamps (s) and residual without skew (Pa), shape (n,).
    """
    by_threshold, by_cusum = detected
    first = min(t for t in detected if t is not None)
    step = float(np.median(np.diff(time)))
    error = step / np.sqrt(12.0) if first == by_threshold else 1.0 / np.sqrt(12.0)
    near = (time >= max(within[0], first - _BEFORE)) & (time <= min(within[1], first + _BEHIND)) & np.isfinite(residual)
    t, r = time[near], residual[near]
    if t.size < 3:
        return Mismatch(
            tap, index, first, error, first, "step", float(np.max(np.abs(r), initial=0.0)), by_threshold, by_cusum, end
        )
    onset, kind, size = _onset(t, r, first)
    return Mismatch(tap, index, first, error, min(onset, first), kind, size, by_threshold, by_cusum, end)


def _onset(t: np.ndarray, r: np.ndarray, first: float) -> tuple[float, Kind, float]:
    """Return onset (s), kind and size: the step or the ramp from somewhere on that leaves the smallest residual."""
    every = max(t.size // 4000, 1)
    n = t.size // every
    tb = t[: n * every].reshape(n, every).mean(axis=1) - t[0]
    rb = r[: n * every].reshape(n, every).mean(axis=1)
    tails = [np.cumsum(v[::-1])[::-1] for v in (np.ones(n), tb, tb * tb, rb, rb * tb)]
    count, st, stt, sr, srt = tails
    gain_step = sr**2 / count
    # Ramp b (t - tau) from tau = t_k: sums over t >= t_k of the squares.
    square = np.maximum(stt - 2.0 * tb * st + tb * tb * count, 1e-12)
    product = srt - tb * sr
    gain_ramp = product**2 / square
    allowed = tb <= first - t[0] + 1e-9
    step_at = int(np.argmax(np.where(allowed, gain_step, -np.inf)))
    ramp_at = int(np.argmax(np.where(allowed & (count >= 3), gain_ramp, -np.inf)))
    if gain_ramp[ramp_at] > gain_step[step_at]:
        return float(t[0] + tb[ramp_at]), "drift", float(product[ramp_at] / square[ramp_at])
    return float(t[step_at * every]), "step", float(sr[step_at] / count[step_at])
