"""How the noise on both signals of a loop reaches its force harmonics: whitening of each run's rows.

An error of a displacement harmonic moves the *modelled* force: every harmonic of it, through w. First an
effective variance without any model, then, around a fit, the exact covariance to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.rigs.mre.model.loop import N_X, Loop

# Step of a displacement harmonic for the differences, relative to the loop's first one.
_STEP = 1e-3


def effective_sd(loop: Loop) -> np.ndarray:
    """Return the standard deviation of each force harmonic, noise on x included (effective variance), (N_F,).

    An error of X_h acts on F_h through the stiffness, about |F_1/X_1|.
    """
    sd = loop.sd_f.copy()
    sd[:N_X] = np.hypot(sd[:N_X], abs(loop.F[0] / loop.X[0]) * loop.sd_x)
    return sd


def level_variance(loop: Loop) -> np.ndarray:
    """Return the relative variance of the square of `effective_sd`: noise levels are estimates, (N_F,)."""
    force, motion = loop.sd_f**2, np.zeros(loop.sd_f.size)
    motion[:N_X] = (abs(loop.F[0] / loop.X[0]) * loop.sd_x) ** 2
    moved = np.zeros(motion.size)
    moved[:N_X] = motion[:N_X] * loop.level_u_x
    total = np.maximum(force + motion, 1e-300)
    return np.asarray(((force * loop.level_u_f) ** 2 + moved**2) / total**2)


def independent(loops: Sequence[Loop]) -> tuple[np.ndarray, ...]:
    """Return the whitening matrix of each run for independent rows of `effective_sd`.

    The rows of a run are the real parts of its kept harmonics, then the imaginary ones.
    """
    return tuple(np.diag(np.tile(1 / effective_sd(loop)[loop.kept], 2)) for loop in loops)


def correlated(loops: Sequence[Loop], force: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return the whitening matrices with the noise of x carried through the model (errors in variables).

    ``force(X) -> F`` gives the modelled harmonics (runs, N_F) for displacement harmonics (runs, N_X).
    """
    X = np.array([loop.X for loop in loops])
    base = force(X)
    slopes = []
    noisy = [k for k in range(N_X) if any(loop.sd_x[k] > 0 for loop in loops)]
    for k in noisy:
        for direction in (1.0, 1j):
            step = np.zeros_like(X)
            step[:, k] = direction * _STEP * np.abs(X[:, 0])
            slopes.append((force(X + step) - base) / (_STEP * np.abs(X[:, :1])))
    blocks = []
    for i, loop in enumerate(loops):
        noise = np.diag(np.tile(loop.sd_f[loop.kept] ** 2, 2))
        for slope, sd in zip(slopes, np.repeat(loop.sd_x[noisy], 2), strict=True):
            moved = sd * slope[i][loop.kept]
            rows = np.concatenate([moved.real, moved.imag])
            noise += np.outer(rows, rows)
        blocks.append(np.linalg.inv(np.linalg.cholesky(noise)))
    return tuple(blocks)
