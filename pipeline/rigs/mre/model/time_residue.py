"""What of the residual of a fit in time hangs together with the motion or drifts: noise of any colour does neither.

How large and how sure it is, not what it comes from: `time_evidence` asks after causes one by one. Nothing is judged here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.separable import SeparableFit
from pipeline.rigs.mre.model.time_model import TimeModel

_STRETCHES = 60  # of the record, whose scatter is that of the noise: it is coloured
_POWERS = ((2, 0), (0, 2), (1, 1), (3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (5, 0))  # of displacement and velocity
_SLOW = 6  # degree of the polynomial in time
_SAME = 1e-8  # of a column's power: what is left of it where the model holds it already


@dataclass(frozen=True)
class Residue:
    """The part of a residual that a set of columns explains.

    Attributes
    ----------
    rms
        Its size without what noise would leave in as many columns, N.
    p_value
        Chance that noise of the same scatter from stretch to stretch explains as much.
    """

    rms: float
    p_value: float


def of_motion(model: TimeModel, fit: SeparableFit) -> Residue:
    """Return what follows the displacement, the velocity or the states of the branches, or a gain of theirs that wanders."""
    time = _placed(np.concatenate([part.time for part in model.segments])[model.usable])
    u, x, w = (_placed(fit.jacobian[:, model.n_shape + i]) for i in range(3))
    v = _placed(np.concatenate([part.velocity for part in model.segments])[model.usable])
    columns = [x**i * v**j for i, j in _POWERS]
    columns += [w**2, w**3, w * x, w * v, u**2, u**3]
    columns += [gain * motion for gain in (time, 1.5 * time**2 - 0.5) for motion in (x, v, w)]
    return residue(np.column_stack(columns), fit)


def of_drift(model: TimeModel, fit: SeparableFit) -> Residue:
    """Return what wanders with time alone."""
    time = _placed(np.concatenate([part.time for part in model.segments])[model.usable])
    return residue(np.polynomial.legendre.legvander(time, _SLOW)[:, 1:], fit)


def residue(columns: np.ndarray, fit: SeparableFit) -> Residue:
    """Return what columns, shape (rows, k), explain of the residual beyond the model's own (rows, p).

    Hotelling's T^2 of the scores of stretches of the record, which may be coloured within and differ in power between.
    """
    from scipy.special import fdtrc

    basis = np.linalg.qr(fit.jacobian)[0]
    rest = columns / np.linalg.norm(columns, axis=0)
    for _ in range(2):
        rest = rest - basis @ (basis.T @ rest)
    U, size, _ = np.linalg.svd(rest, full_matrices=False)
    U = U[:, size**2 > _SAME]
    rows, k = U.shape
    if k == 0 or rows < _STRETCHES * 2 or k >= _STRETCHES - 1:
        return Residue(0.0, 1.0)
    scores = np.add.reduceat(U * fit.residual[:, None], np.arange(_STRETCHES) * rows // _STRETCHES)
    total = scores.sum(axis=0)
    centred = scores - scores.mean(axis=0)
    noise = centred.T @ centred * _STRETCHES / (_STRETCHES - 1)
    squared = float(total @ np.linalg.solve(noise, total))
    ratio = squared * (_STRETCHES - k) / (k * (_STRETCHES - 1))
    power = float(total @ total) - float(np.trace(noise))
    return Residue(math.sqrt(max(power, 0.0) / rows), float(fdtrc(k, _STRETCHES - k, ratio)))


def _placed(values: np.ndarray) -> np.ndarray:
    """Return values moved and scaled to -1..1."""
    low, high = float(values.min()), float(values.max())
    return (values - 0.5 * (low + high)) / max(0.5 * (high - low), 1e-300)
