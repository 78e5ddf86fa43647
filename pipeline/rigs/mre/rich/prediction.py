"""What the identified model says of a harmonic test that was not made: Fig. 17's secant stiffness at a force amplitude."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.mre.model.time_fit import TimeFit

_POINTS = 1024


def secant_stiffness(fit: TimeFit, force: float, frequency: float) -> float | None:
    """Return F_max/x_max (N/m) of the steady loop of a pure sine with F_max = `force` (N) at `frequency` (Hz).

    None where a parameter that it needs is not determined, or the device is far from such a force.
    """
    from scipy.optimize import brentq

    values = dict(zip(fit.names, fit.values.tolist(), strict=True))
    if {"k1", "k2", "alpha_bw", "rho", "tau"} & set(fit.undetermined):
        return None

    def half_range(amplitude: float) -> float:
        return 0.5 * float(np.ptp(_loop(values, amplitude, frequency)))

    least, most = 1e-3 / values["rho"], 1e3 / values["rho"]
    if not half_range(least) < force < half_range(most):
        return None
    amplitude = float(brentq(lambda X: half_range(X) - force, least, most, xtol=1e-12))
    return force / amplitude


def _loop(values: dict[str, float], amplitude: float, frequency: float) -> np.ndarray:
    """Return the force along one steady cycle, shape (1024,), N."""
    from pipeline.rigs.mre.model.bouc_wen import closed_paths, steady_states

    phase = 2 * np.pi * np.arange(_POINTS) / _POINTS
    x = amplitude * np.cos(phase)
    omega = 2 * np.pi * frequency
    turn = 1j * omega * values["tau"]
    stiffness = values["k2"] + values["k1"] * turn / (1 + turn) + 1j * omega * values.get("s_mr", 0.0)
    w = steady_states(closed_paths(x[None]), values["rho"], values["c_bw"], values["n_bw"])[0, :, 0]
    return np.asarray((stiffness * amplitude * np.exp(1j * phase)).real + values["alpha_bw"] * w)
