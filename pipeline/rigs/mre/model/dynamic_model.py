"""The dynamic model (mre.md eqs 10-12) as columns of a separable fit, in the harmonic domain.

F_h = (sum of columns(q) * coefficients) exp(-j h omega lag), columns u, x, w shared by all runs and
field terms of their own per current. No fitting and no statistics here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.rigs.mre.model.loop import N_F, N_X, Loop, curve
from pipeline.rigs.mre.model.loop_noise import correlated, independent

# Which columns get a coefficient per current beside the shared u, x, w (mre.md 3.6, structural objection);
# "base" is for runs at one current.
FIELD_TERMS: Mapping[str, tuple[str, ...]] = {
    "ks": ("x", "v"),
    "ka": ("x", "w"),
    "km": ("x", "u"),
    "k": ("x",),
    "ksa": ("x", "v", "w"),
    "base": ("v",),
}
SHAPE_NAMES = ("tau", "rho", "c_bw", "n_bw")
# Typical steps of (ln tau, ln rho, C, n, lag).
SCALE = np.array([0.3, 0.3, 0.2, 0.3, 1e-4])
_POINTS = 256  # per cycle; the turning points are added


@dataclass(frozen=True)
class Term:
    """A linear coefficient: its column (u, x, v, w, m) and the current level that it belongs to.

    `level` is None for a coefficient that all runs share.
    """

    column: str
    level: int | None = None


@dataclass(frozen=True)
class Layout:
    """Which coefficients a variant has.

    `labels` is the current level of each run, `levels` their currents (A). At the `reference` level
    k_MR is zero by definition (k2 holds it), and s_MR is where there is no field: at 0 A, or where no
    current is known (`field_at_reference` False).
    """

    variant: str
    labels: tuple[int, ...]
    levels: tuple[float, ...]
    reference: int
    mass: bool = False
    field_at_reference: bool = False

    @property
    def terms(self) -> tuple[Term, ...]:
        """Coefficients in the order of the columns."""
        shared = [Term(column) for column in ("u", "x", "w", *(("m",) if self.mass else ()))]
        present = sorted(set(self.labels) - {self.reference})
        own = [Term(column, level) for level in present for column in FIELD_TERMS[self.variant]]
        if self.field_at_reference and "v" in FIELD_TERMS[self.variant] and self.reference in self.labels:
            own.append(Term("v", self.reference))
        return (*shared, *own)


@dataclass(frozen=True)
class Shape:
    """The nonlinear parameters: tau (s), rho (1/m), C, n and the force lag (s)."""

    tau: float
    rho: float
    c_bw: float
    n_bw: float
    lag: float = 0.0

    @classmethod
    def of(cls, q: np.ndarray, lag: float = 0.0) -> Shape:
        """Return the shape of a search point (ln tau, ln rho, C, n[, lag])."""
        return cls(
            float(np.exp(q[0])), float(np.exp(q[1])), float(q[2]), float(q[3]), float(q[4]) if q.size > 4 else lag
        )

    @property
    def search_point(self) -> np.ndarray:
        """(ln tau, ln rho, C, n, lag)."""
        return np.array([np.log(self.tau), np.log(self.rho), self.c_bw, self.n_bw, self.lag])


class HarmonicColumns:
    """Columns of all runs at a search point; what depends on the motion alone is computed once."""

    def __init__(self, X: np.ndarray, frequency: np.ndarray) -> None:
        """`X` has shape (runs, N_X), m; `frequency` (runs,), Hz."""
        from pipeline.rigs.mre.model.bouc_wen import closed_paths

        self.orders = np.arange(1, N_F + 1)
        self.angular = 2 * np.pi * frequency[:, None] * self.orders  # (runs, N_F)
        self.X = np.zeros(self.angular.shape, dtype=complex)
        self.X[:, :N_X] = X
        self.paths = closed_paths(np.array([curve(row, _POINTS) for row in X]))

    def __call__(self, shape: Shape) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Return columns u, x, v, w, m, shape (runs, N_F), and derivatives (4, runs, N_F) where not zero.

        Derivatives are by (ln tau, ln rho, C, n); no lag in either.
        """
        from pipeline.rigs.mre.model.bouc_wen import steady_states
        from pipeline.rigs.mre.model.linear_solid import maxwell_harmonics

        u, du = maxwell_harmonics(self.X, self.angular, shape.tau)
        w = steady_states(self.paths, shape.rho, shape.c_bw, shape.n_bw)[:, :, :4]
        W = np.fft.rfft(w, axis=1)[:, 1 : N_F + 1] * (2 / _POINTS)
        velocity = 1j * self.angular * self.X
        columns = {"u": u, "x": self.X, "v": velocity, "w": W[..., 0], "m": 1j * self.angular * velocity}
        zero = np.zeros_like(u)
        slopes = {
            "u": np.stack([du, zero, zero, zero]),
            "w": np.stack([zero, shape.rho * W[..., 1], W[..., 2], W[..., 3]]),
        }
        return columns, slopes


class HarmonicModel:
    """The separable model of several loops: ``model(q) -> (A, dA)``, one row per kept force harmonic."""

    def __init__(
        self,
        loops: Sequence[Loop],
        layout: Layout,
        held_lag: float | None = None,
        blocks: tuple[np.ndarray, ...] | None = None,
    ) -> None:
        """`held_lag` (s) is used where the lag is not a parameter; None makes it the fifth.

        `blocks` are the whitening matrices of the runs (`loop_noise`).
        """
        self.layout, self.held_lag = layout, held_lag
        self.blocks = independent(loops) if blocks is None else blocks
        self.loops = tuple(loops)
        self.columns = HarmonicColumns(
            np.array([loop.X for loop in loops]), np.array([loop.frequency for loop in loops])
        )
        self.kept = np.array([loop.kept for loop in loops])
        self.run_of_row = np.nonzero(self.kept)[0]
        self.data = np.array([loop.F for loop in loops])[self.kept]
        self.groups = np.tile(self.run_of_row, 2)
        lower, upper = search_space(max(loop.amplitude for loop in loops))
        self.lower, self.upper = lower[: self.n_shape], upper[: self.n_shape]

    @property
    def n_shape(self) -> int:
        """Number of nonlinear parameters."""
        return 4 if self.held_lag is not None else 5

    @property
    def real_data(self) -> np.ndarray:
        """Measured harmonics, imaginary parts behind the real ones, N."""
        return real_rows(self.data)

    def whitened(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (as `real_data`, shape (m, ...)) made independent with unit variance by run."""
        out = np.empty_like(rows, dtype=float)
        for here, blocks in self._blocks_alike:
            part = rows[here]
            out[here] = (blocks @ part.reshape(*here.shape, -1)).reshape(part.shape)
        return out

    @cached_property
    def _blocks_alike(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Rows (runs, k) and whitening matrices (runs, k, k) of the runs that keep as many harmonics."""
        order = np.argsort(self.groups, kind="stable")
        rows = np.split(order, np.cumsum([block.shape[0] for block in self.blocks])[:-1])
        by_size: dict[int, list[int]] = {}
        for i, block in enumerate(self.blocks):
            by_size.setdefault(block.shape[0], []).append(i)
        return [
            (np.array([rows[i] for i in alike]), np.array([self.blocks[i] for i in alike]))
            for alike in by_size.values()
        ]

    def noise_around(self, q: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the whitening matrices with the noise of x carried through the model at a fit."""

        def force(X: np.ndarray) -> np.ndarray:
            moved = [
                replace(loop, X=row, kept=np.ones(N_F, dtype=bool)) for loop, row in zip(self.loops, X, strict=True)
            ]
            rows = HarmonicModel(moved, self.layout, self.held_lag)(q)[0] @ c
            return np.asarray(rows.reshape(len(moved), N_F))

        return correlated(self.loops, force)

    def predicted(self, q: np.ndarray, c: np.ndarray) -> np.ndarray:
        """Return the modelled harmonics as `real_data` has them."""
        return real_rows(self(q)[0] @ c)

    def __call__(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return A (rows, terms) and dA/dq (n_shape, rows, terms), complex."""
        shape = Shape.of(q, self.held_lag or 0.0)
        columns, slopes = self.columns(shape)
        late = np.exp(-1j * self.columns.angular * shape.lag)[self.kept]
        labels = np.asarray(self.layout.labels)[self.run_of_row]
        terms = self.layout.terms
        A = np.zeros((self.run_of_row.size, len(terms)), dtype=complex)
        dA = np.zeros((self.n_shape, *A.shape), dtype=complex)
        for j, term in enumerate(terms):
            on = late if term.level is None else late * (labels == term.level)
            A[:, j] = columns[term.column][self.kept] * on
            if term.column in slopes:
                dA[:4, :, j] = slopes[term.column][:, self.kept] * on
        if self.held_lag is None:
            dA[4] = (-1j * self.columns.angular[self.kept])[:, None] * A
        return A, dA


def real_rows(rows: np.ndarray) -> np.ndarray:
    """Return complex rows as real ones, imaginary parts behind the real ones."""
    return np.concatenate([rows.real, rows.imag])


def search_space(largest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper bounds of (ln tau, ln rho, C, n, lag) for a largest amplitude (m).

    Those of mre.md section 5 with rho bound to the motion, so that other devices fit as well: rho X from
    0.1 (w is straight) to 100 (a step); the lag within +-2 ms.
    """
    lower = np.array([np.log(5e-4), np.log(0.1 / largest), 0.5, 1.0, -2e-3])
    upper = np.array([np.log(0.5), np.log(100 / largest), 4.0, 6.0, 2e-3])
    return lower, upper


def spread_starts(largest: float, count: int, seed: int) -> list[np.ndarray]:
    """Return `count` start points (ln tau, ln rho, C, n, lag): the standard one, then random ones.

    `largest` is the largest amplitude (m): rho is sought where it bends the loop.
    """
    first = np.array([np.log(0.01), np.log(2 / largest), 1.0, 1.8, 0.0])
    rng = np.random.default_rng(seed)
    low = np.array([np.log(2e-3), np.log(0.5 / largest), 0.55, 1.05])
    high = np.array([np.log(0.1), np.log(10 / largest), 2.5, 3.5])
    others = np.zeros((max(count - 1, 0), 5))
    others[:, :4] = low + rng.random((others.shape[0], 4)) * (high - low)
    return [first, *others]


def bounds_reached(q: np.ndarray, at_bound: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> dict[str, float]:
    """Return the bound, in natural units, of every shape parameter that lies at one."""
    bounds = np.where(q - lower < upper - q, lower, upper)
    bounds[:2] = np.exp(bounds[:2])
    names = (*SHAPE_NAMES, "force_lag")
    return {names[i]: float(bounds[i]) for i in np.flatnonzero(at_bound)}
