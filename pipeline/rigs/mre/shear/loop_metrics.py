"""The numbers read from one loop, without a model of the material (mre.md 3.5)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.mre.model.loop import N_F, N_X, Loop, half_range_with_slope
from pipeline.rigs.mre.pads import Pads


def loop_metrics(
    loop: Loop,
    *,
    force_lag: float = 0.0,
    force_lag_sd: float = 0.0,
    run_scatter: float = 0.0,
    scatter_dof: float = math.inf,
    pads: Pads | None = None,
) -> list[Estimate]:
    """Return the numbers read from one loop, each `at` {"run": ...}, force set right by `force_lag`.

    `stiffness_secant` (F_max/x_max, half peak-to-peak of the fitted curves), `stiffness_storage` (N/m),
    `damping` (N s/m), `loss_factor`, with `pads` `shear_modulus_storage` and `shear_modulus_loss` (Pa),
    and `loop_area` (J), `amplitude` (m), `force_amplitude` (N).

    Parameters
    ----------
    force_lag, force_lag_sd
        How late the force is (s) and its standard error: a lag acts as damping -K' lag.
    run_scatter, scatter_dof
        Relative gain error of the force of one run (1 sigma) and its degrees of freedom; it widens the
        interval of everything that scales with the force.

    Notes
    -----
    sigma = A / (pi omega |X_1|^2) with A = pi sum h Im(F_h conj X_h), so K'' = sigma omega for a pure sine.
    """
    lag_turn = 1j * np.arange(1, N_F + 1) * loop.omega
    F = loop.F * np.exp(lag_turn * force_lag)
    dF = lag_turn * F  # per second of lag
    # A harmonic on the mains frequency may be all hum: it is as uncertain as it is large.
    sd_f = np.where(loop.kept, loop.sd_f, np.maximum(loop.sd_f, np.abs(loop.F) / math.sqrt(2)))
    X, X_1, F_1 = loop.X, loop.X[0], F[0]
    orders = np.arange(1, N_X + 1)

    x_max, x_slope = half_range_with_slope(X)
    F_max, F_slope = half_range_with_slope(F)
    storage = (F_1 / X_1).real
    loss = (F_1 / X_1).imag
    area = math.pi * float((orders * (F[:N_X] * np.conj(X)).imag).sum())
    damping = area / (math.pi * loop.omega * abs(X_1) ** 2)

    def error(slopes: tuple[np.ndarray, np.ndarray], scaled: float) -> tuple[float, float]:
        # A slope holds d/dRe + j d/dIm, so that d(value) = Re(conj(slope) d(coefficient)).
        slope_x, slope_f = slopes
        noise = float((np.abs(slope_x) ** 2 * loop.sd_x**2).sum() + (np.abs(slope_f) ** 2 * sd_f**2).sum())
        noise += float((np.conj(slope_f) * dF).real.sum() * force_lag_sd) ** 2
        scatter = (scaled * run_scatter) ** 2
        total = noise + scatter
        dof = scatter_dof * (total / scatter) ** 2 if scatter > 0 else math.inf
        return math.sqrt(total), dof

    none_x, none_f = np.zeros(N_X, dtype=complex), np.zeros(N_F, dtype=complex)
    first_x, first_f = none_x.copy(), none_f.copy()
    first_x[0], first_f[0] = 1.0, 1.0
    # d(F_1/X_1) = dF_1/X_1 - F_1/X_1^2 dX_1; the slope of Re(a dz) is conj(a), of Im(a dz) conj(-j a).
    a_f, a_x = 1 / X_1, -F_1 / X_1**2
    storage_slopes = (np.conj(a_x) * first_x, np.conj(a_f) * first_f)
    loss_slopes = (np.conj(-1j * a_x) * first_x, np.conj(-1j * a_f) * first_f)
    area_f = none_f.copy()
    area_f[:N_X] = math.pi * orders * 1j * X
    area_x = -1j * math.pi * orders * F[:N_X]
    per_area = 1 / (math.pi * loop.omega * abs(X_1) ** 2)
    damping_x = area_x * per_area - 2 * damping * X_1 / abs(X_1) ** 2 * first_x
    ratio = loss / storage
    ratio_slopes = (
        (loss_slopes[0] - ratio * storage_slopes[0]) / storage,
        (loss_slopes[1] - ratio * storage_slopes[1]) / storage,
    )
    secant = F_max / x_max
    rows = [
        ("stiffness_secant", secant, error((-secant / x_max * x_slope, F_slope / x_max), secant)),
        ("stiffness_storage", storage, error(storage_slopes, storage)),
        ("damping", damping, error((damping_x, area_f * per_area), damping)),
        ("loss_factor", ratio, error(ratio_slopes, 0.0)),
        ("loop_area", area, error((area_x, area_f), area)),
        ("amplitude", x_max, error((x_slope, none_f), 0.0)),
        ("force_amplitude", F_max, error((none_x, F_slope), F_max)),
    ]
    if pads is not None:
        g = pads.modulus_per_stiffness
        moduli = (("storage", storage, storage_slopes), ("loss", loss, loss_slopes))
        for name, value, (slope_x, slope_f) in moduli:
            rows.append((f"shear_modulus_{name}", value * g, error((g * slope_x, g * slope_f), value * g)))
    return [estimate(name, float(value), sd, dof=dof, at={"run": loop.run}) for name, value, (sd, dof) in rows]
