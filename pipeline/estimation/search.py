"""The search of nonlinear least squares: coordinates, differences, lmfit, Gauss-Newton.

Works on a residual and a list of unknowns; what the optimum means is told by `least_squares`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import InputError

Values = Mapping[str, float]

# Residuals beyond it, from starts far off, overflow when the search squares them twice.
_LARGEST = 1e60


@dataclass(frozen=True)
class Unknown:
    """A parameter to find: start, bounds and unit in SI.

    `logarithmic` searches ln(value): for positive ones that may be wrong by decades. `fixed` holds
    it at the start.
    """

    name: str
    start: float
    low: float = -math.inf
    high: float = math.inf
    unit: str = "1"
    logarithmic: bool = False
    fixed: bool = False


class Search:
    """The residual as a function of search coordinates: scaled values, or their logarithms."""

    def __init__(
        self,
        residual: Callable[[Values], np.ndarray],
        unknowns: tuple[Unknown, ...],
        jacobian: Callable[[Values], np.ndarray] | None,
        step: float | None,
    ) -> None:
        self.unknowns = unknowns
        self.free = [u for u in unknowns if not u.fixed]
        self.step = step
        self._residual, self._jacobian = residual, jacobian
        for u in self.free:
            if not u.low <= u.start <= u.high or u.low == u.high or (u.logarithmic and u.start <= 0):
                raise InputError(f"{u.name}: the start {u.start:.6g} does not lie within {u.low:.6g} .. {u.high:.6g}.")
        if not self.free:
            raise InputError("nothing to fit: every parameter is fixed.")
        self.scale = np.array([1.0 if u.logarithmic else _scale(u) for u in self.free])
        self.low = np.array([self._inside(u, u.low) for u in self.free]) / self.scale
        self.high = np.array([self._inside(u, u.high) for u in self.free]) / self.scale
        self.evaluations = 0
        self.wall = math.nan
        self.size = 0.0

    @staticmethod
    def _inside(unknown: Unknown, value: float) -> float:
        if unknown.logarithmic:
            return math.log(value) if value > 0 else -math.inf
        return value

    def values(self, z: np.ndarray) -> dict[str, float]:
        """Return all parameters, SI, at search coordinates z of shape (k,)."""
        found = {u.name: u.start for u in self.unknowns}
        for u, coordinate in zip(self.free, z * self.scale, strict=True):
            value = math.exp(min(coordinate, 700.0)) if u.logarithmic else float(coordinate)
            found[u.name] = min(max(value, u.low), u.high)
        return found

    def residual(self, z: np.ndarray) -> np.ndarray:
        """Return the residual; a high wall where it is not finite or has no finite square."""
        self.evaluations += 1
        with np.errstate(all="ignore"):
            out = np.asarray(self._residual(self.values(z)), dtype=float).ravel()
        if np.all(np.abs(out) < _LARGEST):
            return out
        return np.full(out.size, self.wall)

    def cost(self, z: np.ndarray) -> float:
        """Return the sum of squares."""
        out = self.residual(z)
        return float(out @ out)

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives with respect to z: the caller's, or central differences."""
        if self._jacobian is not None:
            values = self.values(z)
            inner = [values[u.name] if u.logarithmic else s for u, s in zip(self.free, self.scale, strict=True)]
            columns = np.asarray(self._jacobian(values), dtype=float)
            return np.asarray(columns * np.array(inner))
        differences = []
        for i in range(z.size):
            h = (self.step or 6e-6) * max(abs(z[i]), 1e-3 if not self.free[i].logarithmic else 1.0)
            up, down = z.copy(), z.copy()
            up[i], down[i] = min(z[i] + h, self.high[i]), max(z[i] - h, self.low[i])
            differences.append((self.residual(up) - self.residual(down)) / (up[i] - down[i]))
        return np.asarray(np.stack(differences, axis=1))

    def starts(self, count: int, seed: int) -> list[np.ndarray]:
        """Return the given start, then a Latin hypercube."""
        given = np.array([self._inside(u, u.start) for u in self.free]) / self.scale
        rng = np.random.default_rng(seed)
        spread = np.where([u.logarithmic for u in self.free], math.log(10.0), 10 * np.maximum(np.abs(given), 1.0))
        low = np.where(np.isfinite(self.low), self.low, given - spread)
        high = np.where(np.isfinite(self.high), self.high, given + spread)
        extra = max(count - 1, 0)
        cells = (
            np.stack([rng.permutation(extra) for _ in self.free], axis=1) if extra else np.zeros((0, len(self.free)))
        )
        return [given, *(low + (high - low) * (cells + rng.random(cells.shape)) / max(extra, 1))]

    def descend(self, start: np.ndarray, max_evaluations: int | None) -> np.ndarray | None:
        """Run lmfit from one start; None where the residual is not finite there."""
        import lmfit

        self.wall = math.nan  # nothing to fall back on yet
        first = self.residual(start)
        if first.size < len(self.free):
            raise InputError(f"{first.size} data cannot determine {len(self.free)} parameters; give more data.")
        if not np.isfinite(first).all():
            return None
        # What counts as far off, and as nothing, in the unit of the residual.
        self.size = max(self.size, math.sqrt(float(first @ first)))
        self.wall = 10 * self.size or 1.0
        parameters = lmfit.Parameters()
        bounded = bool(np.isfinite(self.low).any() or np.isfinite(self.high).any())
        for i, (value, low, high) in enumerate(zip(start, self.low, self.high, strict=True)):
            parameters.add(f"z{i}", value=value, min=low, max=high)

        def point(p: Any) -> np.ndarray:
            return np.array([p[f"z{i}"].value for i in range(start.size)])

        minimizer = lmfit.Minimizer(
            lambda p: self.residual(point(p)),
            parameters,
            calc_covar=False,
            max_nfev=max_evaluations or 2000 * start.size,
        )
        tolerances = {"ftol": 1e-13, "xtol": 1e-12, "gtol": 1e-13 if bounded else 0.0}
        best: np.ndarray | None = None
        for caution in (100.0, 0.1):
            method = "least_squares" if bounded else "leastsq"
            options: dict[str, Any] = {"x_scale": "jac"} if bounded else {"factor": caution}
            with np.errstate(all="ignore"):  # far-off trial points are the search's own business
                found = minimizer.minimize(method, Dfun=lambda p: self.jacobian(point(p)), **tolerances, **options)
            end = point(found.params)
            if best is None or self.cost(end) < self.cost(best):
                best = end
            if bounded or not self._ran_away(start, end):
                break
        return best

    def _ran_away(self, start: np.ndarray, end: np.ndarray) -> bool:
        """Tell whether the first, large step threw the search onto a plateau or far off."""
        J = self.jacobian(end)
        norms = np.sqrt((J**2).sum(axis=0))
        far = np.abs(end - start) > 1e3 * np.maximum(np.abs(start), 1.0)
        return bool(far.any() or (norms <= 1e-12 * norms.max()).any())

    def polished(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """Take Gauss-Newton steps until they are a small part of the errors.

        Returns z, the residual, its Jacobian, and whether that was reached.
        """
        r = self.residual(z)
        for _ in range(30):
            J = self.jacobian(z)
            held = self.held(z, J.T @ r)
            move = np.zeros(z.size)
            move[~held] = -np.linalg.lstsq(J[:, ~held], r, rcond=1e-13)[0]
            gain = float(np.linalg.norm(J @ move))
            small = gain <= 1e-9 * float(np.linalg.norm(r)) / math.sqrt(r.size) + 1e-15 * self.size
            fraction = 1.0
            while fraction > 1e-4:
                trial = np.clip(z + fraction * move, self.low, self.high)
                trial_r = self.residual(trial)
                if trial_r @ trial_r <= r @ r:
                    break
                fraction /= 4
            else:
                break
            z, r = trial, trial_r
            if small:
                break
        # The expected fall of chi2 against the noise of chi2: 1 % of a standard error is enough.
        return z, r, J, gain <= 1e-2 * float(np.linalg.norm(r)) / math.sqrt(r.size) + 1e-12 * self.size

    def held(self, z: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Tell which coordinates sit on a bound that they want to pass."""
        near = 1e-9 * np.maximum(np.abs(z), 1.0)
        return np.asarray(((z - self.low < near) & (gradient > 0)) | ((self.high - z < near) & (gradient < 0)))


def _scale(unknown: Unknown) -> float:
    """Return a natural size for a parameter that is searched linearly."""
    if unknown.start:
        return abs(unknown.start)
    span = unknown.high - unknown.low
    return span if math.isfinite(span) else 1.0
