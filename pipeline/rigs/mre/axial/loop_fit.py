"""The loop model fitted to one record: force, and what the gauge tells of the motion, together.

First rho alone is searched, with everything else linear (variable projection, Golub-Pereyra 1973); then all
unknowns, the motion's coefficients among them, are fitted to the force samples and to the gauge's marks at once,
because the force tells when the press turned better than a gauge that comes in steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.residuals import whiteness
from pipeline.estimation.separable import covariance_of
from pipeline.estimation.uncertainty import Covariance, effective_size
from pipeline.rigs.mre.axial.loop import LoopModel, along_strokes
from pipeline.rigs.mre.axial.loop_data import LoopData, LoopFit, Path

_RHOS = 61
# Chi-square by which a turn that stands still must fit better than one that does not.
_STANDS = 12.0
# However a residual is coloured, so many samples a parameter it counts for: fewer is a misfit and told as such.
_LEAST_EFFECTIVE = 5


def fit_loop(data: LoopData) -> LoopFit:
    """Fit the loop model to one record.

    Raises
    ------
    ValueError
        If there are fewer samples than unknowns.
    """
    problem = _Problem(data)
    standing = problem.surely_standing()
    best = problem.searched(standing)
    for turn in range(len(data.motion.strokes) + 1):
        if turn in standing or not data.motion.smooth:
            continue
        tried = problem.searched(tuple(sorted({*standing, turn})))
        if tried.cost < best.cost - _STANDS * best.sigma**2:
            best, standing = tried, tuple(sorted({*standing, turn}))
    return problem.fitted(best)


@dataclass(frozen=True, eq=False)
class _Start:
    """Where variable projection ended."""

    standing: tuple[int, ...]
    z: np.ndarray
    cost: float
    sigma: float


class _Problem:
    """Unknowns, their packing, and the misfit of force and gauge."""

    def __init__(self, data: LoopData) -> None:
        self.data = data
        self.m0 = data.motion.coefficients
        self.turns0 = self._turns_read()
        self.stroke_length = float(np.abs(np.diff(self.turns0)).max())
        n = data.force.size
        if n < 8 + data.extra.shape[1]:
            raise ValueError(f"{n} samples are too few for a loop")
        if self.m0.size:
            self.gauge = np.linalg.inv(np.linalg.cholesky(data.motion.covariance + 1e-26 * np.eye(self.m0.size)))

    def _turns_read(self) -> np.ndarray:
        motion = self.data.motion
        middle = np.asarray(0.5 * (motion.lowest + motion.highest))
        if not motion.smooth:
            return middle
        return np.asarray(motion.crossings(self.m0, float(self.data.time[0]))[1])

    def surely_standing(self) -> tuple[int, ...]:
        """Return the turns where the gauge shows that the press stood: the strokes would meet beyond it."""
        motion = self.data.motion
        if not motion.smooth:
            return tuple(range(len(motion.strokes) + 1))
        slack = 0.1 * motion.step + 3 * max(s.missed for s in motion.strokes)
        outside = (self.turns0 < motion.lowest - slack) | (self.turns0 > motion.highest + slack)
        return tuple(np.flatnonzero(outside).tolist())

    def path(self, m: np.ndarray, standing: tuple[int, ...], places: np.ndarray) -> Path:
        """Return the samples' places; `places` are those of the standing turns."""
        motion, time = self.data.motion, self.data.time
        if not motion.smooth:
            assert self.data.d_read is not None
            turns = self.turns0.copy()
            turns[list(standing)] = places
            stroke = np.searchsorted([s.end for s in motion.strokes[:-1]], time, side="right")
            d = self.data.d_read + m[stroke] if m.size else self.data.d_read
            return Path(d - turns[0], stroke, turns - turns[0], time[[0, -1]])
        times, turns = motion.crossings(m, float(time[0]))
        turns[list(standing)] = places
        stroke = np.searchsorted(times[1:-1], time, side="right")
        d = np.empty(time.size)
        for i, (s, c) in enumerate(zip(motion.strokes, motion.split(m), strict=True)):
            here = stroke == i
            low, high = sorted((turns[i], turns[i + 1]))
            at = s.at(time[here], c)
            # A turn that does not stand bounds nothing: the strokes meet there by themselves.
            first, last = (turns[i], turns[i + 1]) if s.direction > 0 else (turns[i + 1], turns[i])
            lower_stands = (i if s.direction > 0 else i + 1) in standing
            upper_stands = (i + 1 if s.direction > 0 else i) in standing
            if lower_stands:
                at = np.maximum(at, first)
            if upper_stands:
                at = np.minimum(at, last)
            d[here] = np.clip(at, low - self.stroke_length, high + self.stroke_length)
        return Path(d - turns[0], stroke, turns - turns[0], times)

    def columns(self, path: Path, rho: float) -> np.ndarray:
        w = along_strokes(path.d, path.stroke, path.turns.tolist(), rho)
        return np.column_stack([path.d, path.d**3, w, np.ones(w.size), self.data.extra])

    def rhos(self) -> np.ndarray:
        finest = self.stroke_length / max(self.data.time.size / len(self.data.motion.strokes), 10)
        return np.geomspace(0.05 / self.stroke_length, 20 / finest, _RHOS)

    def searched(self, standing: tuple[int, ...], log_rho: float | None = None) -> _Start:
        """Search rho, and where the press stood, with the linear unknowns projected out; from `log_rho` if given."""
        from scipy.optimize import least_squares

        F = self.data.force
        motion = self.data.motion
        places = np.clip(self.turns0, motion.lowest, motion.highest)[list(standing)]
        # Turns known to within a sample wait for the whole fit.
        sought = () if motion.turn_spread is not None else standing
        rhos = self.rhos()

        def solved(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            there = q[1:] * motion_unit if sought else places
            A = self.columns(self.path(self.m0, standing, there), math.exp(q[0]))
            c = _solved(A, F)
            return c, F - A @ c

        def misfit(q: np.ndarray) -> np.ndarray:
            return solved(q)[1]

        motion_unit = self.stroke_length / 100
        q_places = places / motion_unit if sought else np.zeros(0)
        if log_rho is None:
            costs = [float(np.sum(solved(np.r_[math.log(rho), q_places])[1] ** 2)) for rho in rhos[::3]]
            log_rho = math.log(rhos[::3][int(np.argmin(costs))])
        start = np.r_[log_rho, q_places]
        low = np.r_[math.log(rhos[0]), motion.lowest[list(sought)] / motion_unit - 1e-9]
        high = np.r_[math.log(rhos[-1]), motion.highest[list(sought)] / motion_unit + 1e-9]
        found = least_squares(
            misfit, np.clip(start, low + 1e-12, high - 1e-12), bounds=(low, high), x_scale=0.3,
            ftol=1e-10, xtol=1e-10,
        )  # fmt: skip
        c, r = solved(found.x)
        z = np.r_[found.x[0], found.x[1:] * motion_unit if sought else places, c, self.m0]
        dof = max(F.size - c.size - found.x.size, 1)
        return _Start(standing, z, float(r @ r), math.sqrt(float(r @ r) / dof))

    def unpacked(self, z: np.ndarray, standing: tuple[int, ...]) -> tuple[float, Path, np.ndarray]:
        s, p = len(standing), 4 + self.data.extra.shape[1]
        places, c, m = z[1 : 1 + s], z[1 + s : 1 + s + p], z[1 + s + p :]
        return math.exp(min(z[0], 60.0)), self.path(m, standing, places), c

    def fitted(self, start: _Start) -> LoopFit:
        """Fit everything together from where the search ended."""
        from scipy.optimize import least_squares

        F, sigma = self.data.force, max(start.sigma, 1e-12)
        n, p, k = F.size, 4 + self.data.extra.shape[1], self.m0.size
        start, before = self._with_start(start)
        standing = start.standing
        s = len(standing)
        rho, path, c = self.unpacked(start.z, standing)
        size = np.maximum(np.linalg.norm(self.columns(path, rho), axis=0), 1e-30)
        spread = np.sqrt(np.diag(self.data.motion.covariance)) if k else np.zeros(0)
        scale = np.r_[0.1, np.full(s, 1e-3 * self.stroke_length), sigma / size, spread]
        linear = slice(1 + s, 1 + s + p)
        turn_spread = self.data.motion.turn_spread
        if turn_spread is not None:
            turn_spread = np.r_[max(turn_spread[0], self.data.start_spread), turn_spread[1:]]

        def rows(y: np.ndarray) -> np.ndarray:
            z = start.z + scale * y
            rho, path, c = self.unpacked(z, standing)
            parts = [(F - self.columns(path, rho) @ c) / sigma]
            if k:
                parts.append(self.gauge @ (z[-k:] - self.m0))
            if turn_spread is not None:
                parts.append((z[1 : 1 + s] - self.turns0) / turn_spread)
            if before > 0:
                first = self.data.motion.crossings(z[-k:], float(self.data.time[0]))[1][0]
                parts.append(np.array([(z[1] - first) / before]))
            return np.concatenate(parts)

        def jacobian(y: np.ndarray) -> np.ndarray:
            at = rows(y)
            J = np.zeros((at.size, y.size))
            rho, path, _ = self.unpacked(start.z + scale * y, standing)
            J[:n, linear] = -self.columns(path, rho) * scale[linear] / sigma
            for j in (*range(linear.start), *range(linear.stop, y.size)):
                step = np.zeros(y.size)
                step[j] = 1e-3
                J[:, j] = (rows(y + step) - at) / 1e-3
            return J

        low, high = np.full(start.z.size, -np.inf), np.full(start.z.size, np.inf)
        low[0], high[0] = math.log(self.rhos()[0]), math.log(self.rhos()[-1])
        if s:
            reach = 6 * before + (self.data.motion.highest - self.data.motion.lowest)[list(standing)]
            low[1 : 1 + s] = self.data.motion.lowest[list(standing)] - (before > 0) * reach
            high[1 : 1 + s] = self.data.motion.highest[list(standing)] + (before > 0) * reach
        low, high = (low - start.z) / scale - 1e-6, (high - start.z) / scale + 1e-6
        found = least_squares(
            rows, np.zeros(start.z.size), jacobian, bounds=(low, high), ftol=1e-7, xtol=1e-7, max_nfev=15
        )
        z = start.z + scale * found.x
        rho, path, c = self.unpacked(z, standing)
        residual = F - self.columns(path, rho) @ c
        fresh = math.sqrt(float(residual @ residual) / max(n - (z.size - k), 1))
        effective = float(n)
        if not whiteness(residual, p + 1 + s).passed:
            effective = float(np.clip(effective_size(residual, p + 1 + s), min(_LEAST_EFFECTIVE * (p + 1 + s), n), n))
        J = np.array(found.jac)
        J[:n] *= sigma / max(fresh, 1e-12) * math.sqrt(effective / n)
        matrix, _ = covariance_of(J)
        wide = fresh * math.sqrt(n / effective)
        rhos, chi2, each, errors = self._along_rho(path, wide)
        return LoopFit(
            data=self.data, path=path, model=LoopModel(float(c[0]), float(c[1]), float(c[2]), rho), offset=float(c[3]),
            z=z,
            covariance=Covariance(matrix * np.outer(scale, scale), max(effective - p - 1 - s, 1.0), "force and gauge together"),
            residual=residual, sigma=fresh, standing=standing, effective=effective, rhos=rhos, chi2=chi2,
            conditional=each, conditional_error=errors, elastic=self._elastic(path, wide),
            unpack=lambda values: self._model_at(values, standing),
        )  # fmt: skip

    def _with_start(self, start: _Start) -> tuple[_Start, float]:
        """Let the motion begin up to about a sample before the log does; return how far (m, 1 sigma), 0 for not."""
        motion, time = self.data.motion, self.data.time
        if not motion.smooth or 0 in start.standing or time.size < 2:
            return start, 0.0
        first = motion.strokes[0]
        velocity = abs(float(np.diff(first.at(time[:2], motion.split(self.m0)[0]))[0])) / float(time[1] - time[0])
        z = np.insert(start.z, 1, self.turns0[0])
        before = max(0.5 * velocity * float(np.median(np.diff(time))), self.data.start_spread)
        return _Start((0, *start.standing), z, start.cost, start.sigma), before

    def _model_at(self, z: np.ndarray, standing: tuple[int, ...]) -> tuple[LoopModel, np.ndarray]:
        s = len(standing)
        c, m = z[1 + s : 5 + s], z[5 + s + self.data.extra.shape[1] :]
        motion = self.data.motion
        turns = motion.crossings(m, float(self.data.time[0]))[1] if motion.smooth else self.turns0.copy()
        turns[list(standing)] = z[1 : 1 + s]
        return LoopModel(float(c[0]), float(c[1]), float(c[2]), math.exp(min(z[0], 60.0))), turns - turns[0]

    def _along_rho(self, path: Path, sigma: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        rhos = self.rhos()
        chi2, each, errors = [], [], []
        for rho in rhos:
            c, sd, misfit = _linear(self.columns(path, float(rho)), self.data.force, sigma)
            chi2.append(misfit)
            each.append(c)
            errors.append(sd)
        return rhos, np.array(chi2), np.array(each), np.array(errors)

    def _elastic(self, path: Path, sigma: float) -> tuple[np.ndarray, np.ndarray, float]:
        A = np.column_stack([path.d, path.d**3, np.ones(path.d.size), self.data.extra])
        return _linear(A, self.data.force, sigma)


def _solved(A: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Return least-squares coefficients by the normal equations of columns of unit norm."""
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    scaled = A / size
    return np.asarray(np.linalg.pinv(scaled.T @ scaled, rcond=1e-14, hermitian=True) @ (scaled.T @ F) / size)


def _linear(A: np.ndarray, F: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return coefficients, standard errors for noise `sigma`, and the misfit over sigma^2."""
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    scaled = A / size
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-14, hermitian=True)
    c = inverse @ (scaled.T @ F) / size
    r = F - A @ c
    return c, sigma * np.sqrt(np.maximum(np.diag(inverse), 0.0)) / size, float(r @ r) / max(sigma, 1e-12) ** 2
