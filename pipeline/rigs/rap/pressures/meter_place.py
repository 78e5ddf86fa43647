"""What the flow meter does when ultrafiltration comes on: on the return line it reads less by it (rap.md, section 8)."""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.rap.pressures.agreement import jackknifed
from pipeline.rigs.rap.pressures.level_means import LevelMeans

_FEWEST, _FEWEST_LEVELS = 8, 3
# Half of the ultrafiltration parts one place from the other; so many standard errors off it the place is sure.
_HALF, _SURE = -0.5, 4.0


def metered_share(means: LevelMeans, uf: np.ndarray) -> tuple[float, float] | None:
    """Return the change of the metered flow at equal strokes when ultrafiltration comes on, over it, and its standard error.

    About -1 for a meter on the return line, about 0 on the access line (less what the pump slips by a changed pressure); None
    where the run does not tell. `uf` (m^3/s) is that of each window, shape (w,).
    """
    if "flow" not in means.mean:
        return None
    used = means.turning & np.isfinite(means.mean["flow"]) & np.isfinite(means.frequency) & np.isfinite(uf)
    f, q, drawn = means.frequency[used], means.mean["flow"][used], uf[used]
    groups = np.unique(means.level[used], return_inverse=True)[1]
    if used.sum() < _FEWEST or float(np.ptp(drawn)) < 1e-9 or np.unique(groups).size < _FEWEST_LEVELS:
        return None
    # Volume of a stroke falls with the speed by back-pressure: constant and slope beside the step.
    columns = [f, drawn]
    if float(np.ptp(f)) > 0.1 * float(f.mean()):
        columns.insert(1, f * (f - f.mean()))
    if np.unique(groups).size <= len(columns):
        return None
    return last_coefficient(np.stack(columns, axis=-1), q, groups)


def contradicted(location: str | None, share: tuple[float, float] | None) -> bool:
    """Tell whether the meter surely does not sit where the run says."""
    if location not in ("access", "return") or share is None or abs(share[0] - _HALF) < _SURE * share[1]:
        return False
    return location != ("return" if share[0] < _HALF else "access")


def last_coefficient(columns: np.ndarray, y: np.ndarray, groups: np.ndarray) -> tuple[float, float]:
    """Return the last coefficient of a regression and its standard error by leaving out group after group."""
    scale = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    A = columns / scale
    inside = groups >= 0
    A, y, groups = A[inside], y[inside], groups[inside]
    normals = np.stack([A[groups == g].T @ A[groups == g] for g in np.unique(groups)])
    rights = np.stack([A[groups == g].T @ y[groups == g] for g in np.unique(groups)])
    whole, right = normals.sum(axis=0), rights.sum(axis=0)
    value = float((np.linalg.pinv(whole) @ right)[-1])
    out = np.array([(np.linalg.pinv(whole - n) @ (right - r))[-1:] for n, r in zip(normals, rights, strict=True)])
    return value / float(scale[-1]), math.sqrt(float(jackknifed(out)[0, 0])) / float(scale[-1])
