"""First-order lags of the measured current, exact for a current that is straight between its samples (mre.md 3.4).

Plain functions on a uniform grid; nothing is fitted here.
"""

from __future__ import annotations

import math

import numpy as np

_TINY = 1e-6  # tau over the step of the grid below which there is no lag


def lag(u: np.ndarray, tau: float, dt: float) -> np.ndarray:
    """Return y with tau y' + y = u, y(0) = u(0), at the samples of u, shape (n,).

    Examples
    --------
    >>> t = np.arange(0, 1, 1e-3)
    >>> ramp = lag(t, 0.1, 1e-3)
    >>> bool(np.allclose(ramp, t - 0.1 * (1 - np.exp(-t / 0.1))))
    True
    """
    from scipy.signal import lfilter

    if tau < _TINY * dt:
        return np.asarray(u, dtype=float)
    e = math.exp(-dt / tau)
    share = tau / dt * -math.expm1(-dt / tau)
    b0, b1 = 1 - share, share - e
    y, _ = lfilter([b0, b1], [1.0, -e], u, zi=np.array([(b1 + e) * u[0]]))
    return np.asarray(y)


def response(u: np.ndarray, taus: tuple[float, ...], dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the current through one or two lags, its rate, and its derivatives with each ln(tau).

    Returns
    -------
    y, y', each of shape (n,), and dy/d ln(tau), shape (len(taus), n).
    """
    stages = [np.asarray(u, dtype=float)]
    for tau in taus:
        stages.append(lag(stages[-1], tau, dt))
    slopes = []
    for number in range(len(taus)):
        # d/d ln(tau) of a lag is minus the lag of tau y', that is of its input less its output.
        change = -lag(stages[number] - stages[number + 1], taus[number], dt)
        for later in taus[number + 1 :]:
            change = lag(change, later, dt)
        slopes.append(change)
    rate = (stages[-2] - stages[-1]) / max(taus[-1], _TINY * dt)
    return stages[-1], rate, np.array(slopes)


def passes(time: np.ndarray, share: np.ndarray, level: float) -> float:
    """Return the first time at which a rising `share` passes `level`, straight between samples; NaN where it does not."""
    above = np.flatnonzero(share >= level)
    if not above.size:
        return math.nan
    k = int(above[0])
    if k == 0:
        return float(time[0])
    a, b = float(share[k - 1]), float(share[k])
    return float(time[k - 1] + (level - a) / (b - a) * (time[k] - time[k - 1]))
