"""Peak torques: the maximum of the 20 Hz zero-phase low-passed torque, its bias and its error (fact sheet 5.3, 11).

A maximum picks what noise and ripple add to it: how much is found by adding the same sensor's noise of a
steady stretch to the curve many times. Not a model of the event behind the peak.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.gearbox.aligned_run import AlignedRun, Span, ZeroOffset, within
from pipeline.rigs.gearbox.torques.ripple import learn
from pipeline.signals.filtering import low_pass

CUTOFF = 20.0
# Order of one pass: steeper filters overshoot where the lock breaks (order 4 by 0.014, order 2 by 0.010 N m in 2.2).
ORDER = 2
# Without ripple a wider band is quiet enough, and rounds the kink of the breaking lock by 0.004 N m only.
UNLOCK_CUTOFF = 40.0

# The curve is carried this far beyond the span so that the filter's ends do not matter, s.
_MARGIN = 0.5
# Noise is added this often, and only this close to the peak may the maximum move, s.
_DRAWS, _REACH = 400, 0.25
# So many equal samples in a row at the maximum are a converter's end stop.
_FLAT = 3


@dataclass(frozen=True)
class Peak:
    """A peak torque.

    Attributes
    ----------
    value
        Maximum of the low-passed torque, N m, offset taken off; `time` s.
    bias
        What noise and ripple have put on top of it on average, N m; not taken off.
    std_error
        Ripple, noise and zero offset, N m; with `dof`.
    raw
        Largest raw sample, N m.
    cutoff
        Of the low-pass, Hz.
    saturated
        The raw signal is flat at its maximum: all values are lower bounds.
    """

    value: float
    time: float
    bias: float
    std_error: float
    dof: float
    raw: float
    cutoff: float
    saturated: bool

    @property
    def ci95(self) -> Span:
        """95 % interval of the peak without noise and ripple: about `value` - `bias`."""
        half = t_quantile(self.dof) * self.std_error
        return self.value - self.bias - half, self.value - self.bias + half


@dataclass(frozen=True, eq=False)
class Steady:
    """What a torque does about its mean while load and speed are steady, N m, sampled every `step` s; shape (n,)."""

    values: np.ndarray
    step: float


def steady_noise(time: np.ndarray, values: np.ndarray, spans: list[Span], cutoff: float = CUTOFF) -> Steady:
    """Return noise and ripple of steady stretches, low-passed as the peak will be.

    Parameters
    ----------
    time, values
        s and N m, shape (n,).
    spans
        Settled parts of the stages at the speed of the peak, s (`Level.span`).
    cutoff
        Of the low-pass, Hz.
    """
    step = float(np.median(np.diff(time)))
    parts = []
    for span in spans:
        part = within(time, span)
        t, x = time[part], values[part]
        kept = np.isfinite(x)
        if kept.sum() > 20:
            trend = np.polynomial.Polynomial.fit(t[kept], x[kept], 1)
            parts.append(low_pass(t[kept], x[kept] - trend(t[kept]), cutoff, ORDER))
    return Steady(np.concatenate(parts) if parts else np.zeros(0), step)


def peak(
    time: np.ndarray,
    values: np.ndarray,
    span: Span,
    noise: Steady,
    cutoff: float = CUTOFF,
    offset: ZeroOffset | None = None,
) -> Peak | None:
    """Find the peak of a torque within `span`.

    Parameters
    ----------
    time, values
        s and N m, shape (n,), offset taken off.
    span
        Where to look, s.
    noise
        From `steady_noise`, same cutoff.
    cutoff
        Of the low-pass, Hz.
    offset
        Its error counts.

    Returns
    -------
    None where there are no samples.
    """
    near = within(time, (span[0] - _MARGIN, span[1] + _MARGIN))
    t, x = time[near], values[near]
    smooth = low_pass(t, x, cutoff, ORDER)
    inside = within(t, span)
    if not np.isfinite(smooth[inside]).any():
        return None
    at = inside.start + int(np.nanargmax(smooth[inside]))
    bias, scatter = _lifted(t, smooth, at, noise)
    zero = offset or ZeroOffset()
    # Half a period of the cutoff is about one independent value of the low-passed noise.
    dof = max(noise.values.size * noise.step * cutoff / 10, 1.0)
    return Peak(
        float(smooth[at]),
        float(t[at]),
        bias,
        math.hypot(scatter, zero.std_error),
        dof,
        float(np.nanmax(x[inside])),
        cutoff,
        _flat_top(x[inside]),
    )


def unlock_peak(run: AlignedRun, span: Span, steady: Span) -> Peak | None:
    """Find the peak of T_in when the lock breaks without the shaft's ripple: what the lock carried, plus drag.

    Until it breaks both shafts turn as one, so the ripple learnt over the encoder's angle holds; the
    error falls from that of the ripple to that of the noise. The peak of the torque itself keeps its ripple.

    Parameters
    ----------
    run
        Locked up to the peak.
    span
        Where to look, s.
    steady
        Settled part of the locked stage before it, s.
    """
    calm = within(run.time, steady)
    angle = run.angle_at(run.time)
    free = run.torque_in - learn(angle[calm], run.torque_in[calm]).at(angle)
    noise = steady_noise(run.time, free, [steady], UNLOCK_CUTOFF)
    return peak(run.time, free, span, noise, UNLOCK_CUTOFF, run.offset_in)


def _lifted(t: np.ndarray, smooth: np.ndarray, at: int, noise: Steady) -> tuple[float, float]:
    """Return the mean of what noise adds to the maximum of the curve, and how that scatters, N m.

    A sharp peak scatters as the noise at one instant does, a broad one less: its maximum can choose. The curve has its
    own noise already, so the mean itself may be anything from none to twice as much.
    """
    part = within(t, (t[at] - _REACH, t[at] + _REACH))
    step = max(int(0.05 / CUTOFF / noise.step), 1)
    curve, pool = smooth[part][::step], noise.values[::step]
    if pool.size < 2 * curve.size:
        return 0.0, float(noise.values.std()) if noise.values.size else 0.0
    starts = np.linspace(0, pool.size - curve.size, _DRAWS).astype(int)
    draws = np.lib.stride_tricks.sliding_window_view(pool, curve.size)[starts]
    highest = np.nanmax(curve + draws, axis=1)
    mean = float(highest.mean() - smooth[at])
    return mean, math.hypot(float(highest.std()), mean / math.sqrt(3.0))


def _flat_top(values: np.ndarray) -> bool:
    """Tell whether the largest value is repeated in a row."""
    top = np.flatnonzero(values >= np.nanmax(values))
    run = longest = 1
    for step in np.diff(top):
        run = run + 1 if step == 1 else 1
        longest = max(longest, run)
    return longest >= _FLAT
