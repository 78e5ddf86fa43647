"""Which parameters do the data determine one by one, and where only a sum or a product.

Works on the Jacobian of the residual at the optimum, so it speaks of small deviations around it; a
curved valley is followed by `profile`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

# Singular values below it, relative to the largest, are zero: finite differences give no more digits.
_RANK = 1e-7

Function = Callable[[Mapping[str, float]], float]


@dataclass(frozen=True)
class Combination:
    """A function of parameters that is determined although its members are not."""

    text: str
    members: tuple[str, ...]
    value: float
    std_error: float


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What a Jacobian tells about k parameters.

    Attributes
    ----------
    names
        Of the parameters, in the order of the matrices.
    std_error
        Shape (k,); infinite where the data say nothing.
    correlation
        Shape (k, k); NaN where a standard error is infinite.
    condition
        Condition number of the Jacobian with its columns scaled to the same length.
    undetermined
        Parameters that cannot be told from others, or at all.
    combinations
        What can be told of them.
    statements
        All that in plain sentences.
    """

    names: tuple[str, ...]
    std_error: np.ndarray
    correlation: np.ndarray
    condition: float
    undetermined: tuple[str, ...]
    combinations: tuple[Combination, ...]
    statements: tuple[str, ...]


def assess(
    values: Mapping[str, float],
    jacobian: np.ndarray,
    *,
    sigma: float = 1.0,
    limit: float = 0.5,
    condition_limit: float = 500.0,
    units: Mapping[str, str] | None = None,
    sizes: Mapping[str, float] | None = None,
    candidates: Mapping[str, Function] | None = None,
) -> Identifiability:
    """Find parameters that the data do not determine, and combinations of them that they do.

    Parameters
    ----------
    values
        Parameters at the optimum, SI, in the order of the columns.
    jacobian
        Of the residual, shape (n, k); for a covariance C give the transposed Cholesky factor of its
        inverse, shape (k, k).
    sigma
        Standard deviation of the residual; 1 for residuals divided by their noise.
    limit
        A parameter with a larger relative standard error is undetermined, if other parameters are
        what makes it so (its error with the others known is five times smaller) or if its size is
        given. A well measured zero is therefore not called undetermined.
    condition_limit
        Above this condition number the members of the weakest direction that correlate beyond 0.95
        are undetermined, whatever their formal error.
    units
        Sums and differences are tried for parameters of the same unit; without units for all.
    sizes
        What counts as large for a parameter, instead of its own value.
    candidates
        Further combinations to try: text -> function of the values, as ``"k2 + alpha*rho"``.

    Examples
    --------
    Two springs in parallel, moved together:

    >>> x = np.linspace(0, 1, 20)
    >>> assess({"k1": 3.0, "k2": 4.0}, np.stack([x, x], axis=1), sigma=0.01).combinations[0].text
    'k1 + k2'
    """
    names = tuple(values)
    information = _Information(jacobian, sigma)
    unit = np.eye(len(names))
    se = np.array([information.std_error(row) for row in unit])
    correlation = information.correlation(se)
    size = np.array([abs((sizes or {}).get(name, value)) for name, value in values.items()])
    given = np.array([name in (sizes or {}) for name in names])
    weak = ~np.isfinite(se) | ((se > limit * size) & ((se > 5 * information.alone()) | given))
    if information.condition > condition_limit:
        weak |= information.in_weakest() & (np.abs(np.nan_to_num(correlation - unit, nan=1.0)).max(axis=1) > 0.95)
    found = _combinations(dict(values), information, se, correlation, weak, limit, units, candidates or {})
    undetermined = tuple(name for name, is_weak in zip(names, weak, strict=True) if is_weak)
    statements = _statements(dict(values), se, undetermined, found, information, correlation, units or {})
    return Identifiability(names, se, correlation, information.condition, undetermined, found, statements)


class _Information:
    """The Jacobian's singular values and directions, columns scaled to the same length."""

    def __init__(self, jacobian: np.ndarray, sigma: float) -> None:
        norms = np.sqrt((jacobian**2).sum(axis=0))
        self.scale = np.where(norms > 0, norms, 1.0)
        self.sigma = sigma
        self.dead = norms == 0
        _, self.singular, self.directions = np.linalg.svd(jacobian / self.scale, full_matrices=False)
        if self.singular.size < norms.size:  # fewer data than parameters
            _, self.singular, self.directions = np.linalg.svd((jacobian / self.scale).T @ (jacobian / self.scale))
            self.singular = np.sqrt(self.singular)
        self.known = self.singular > _RANK * max(float(self.singular[0]), 1e-300)
        smallest = float(self.singular[-1])
        self.condition = float(self.singular[0]) / smallest if self.known.all() and smallest > 0 else math.inf

    def std_error(self, gradient: np.ndarray) -> float:
        """Return the standard error of a linear combination; infinite where it is not determined."""
        along = self.directions @ (gradient / self.scale)
        lost = np.abs(along[~self.known])
        if lost.size and lost.max() > 1e-5 * np.linalg.norm(gradient / self.scale):
            return math.inf
        return self.sigma * float(np.linalg.norm(along[self.known] / self.singular[self.known]))

    def correlation(self, se: np.ndarray) -> np.ndarray:
        """Return the correlation matrix; NaN where a standard error is infinite."""
        inverse = np.where(self.known, 1 / np.maximum(self.singular, 1e-300), 0.0)
        root = inverse[:, None] * self.directions / self.scale * self.sigma
        out = root.T @ root / np.outer(se, se)
        out[~np.isfinite(se)] = np.nan
        out[:, ~np.isfinite(se)] = np.nan
        np.fill_diagonal(out, 1.0)
        return np.asarray(out)

    def alone(self) -> np.ndarray:
        """Return the standard errors that each parameter would have with all others known."""
        return np.where(self.dead, np.inf, self.sigma / self.scale)

    def in_weakest(self) -> np.ndarray:
        """Tell which parameters take part in the direction that the data determine least."""
        return np.asarray(np.abs(self.directions[-1]) > 0.3)


def _combinations(
    values: dict[str, float],
    information: _Information,
    se: np.ndarray,
    correlation: np.ndarray,
    weak: np.ndarray,
    limit: float,
    units: Mapping[str, str] | None,
    candidates: Mapping[str, Function],
) -> tuple[Combination, ...]:
    """Try sums, differences, products and ratios of the weak ones, then what the caller proposes."""
    names = list(values)
    relative = {name: se[i] / abs(values[name]) if values[name] else math.inf for i, name in enumerate(names)}
    found: dict[str, Combination] = {}

    def consider(text: str, function: Function, members: Sequence[str]) -> Combination | None:
        value = function(values)
        error = information.std_error(_gradient(function, values))
        good = value != 0 and error <= min(limit, 0.2 * min(relative[member] for member in members)) * abs(value)
        return Combination(text, tuple(members), value, error) if good else None

    for i, j in combinations(range(len(names)), 2):
        tied = not abs(correlation[i, j]) < 0.9  # NaN: infinite errors may well be tied
        if not (weak[i] and weak[j] and tied):
            continue
        a, b = names[i], names[j]
        tried = [consider(text, function, (a, b)) for text, function in _pairs(a, b, units)]
        good = [combination for combination in tried if combination]
        if good:
            best = min(good, key=lambda c: c.std_error / abs(c.value))
            found[best.text] = best
    for text, members in _sums(names, information, weak, units):
        if not any(set(c.members) <= set(members) for c in found.values()):
            total = consider(text, _sum_of(members), members)
            if total:
                found[text] = total
    for text, function in candidates.items():
        slope = _gradient(function, values)
        parts = [name for name, part, is_weak in zip(names, slope, weak, strict=True) if part and is_weak]
        proposed = consider(text, function, parts) if parts else None
        if proposed:
            found[text] = proposed
    return tuple(found.values())


def _pairs(a: str, b: str, units: Mapping[str, str] | None) -> list[tuple[str, Function]]:
    pairs: list[tuple[str, Function]] = [
        (f"{a} * {b}", lambda p: p[a] * p[b]),
        (f"{a} / {b}", lambda p: p[a] / p[b] if p[b] else math.nan),
    ]
    if units is None or units.get(a) == units.get(b):
        pairs = [(f"{a} + {b}", lambda p: p[a] + p[b]), (f"{a} - {b}", lambda p: p[a] - p[b]), *pairs]
    return pairs


def _sums(
    names: list[str], information: _Information, weak: np.ndarray, units: Mapping[str, str] | None
) -> list[tuple[str, tuple[str, ...]]]:
    """Return the sums over three and more weak parameters of one unit."""
    by_unit: dict[str | None, list[str]] = {}
    taking_part = np.abs(information.directions[~information.known]).max(axis=0, initial=0.0) > 0.05
    for name, is_weak, takes_part in zip(names, weak, taking_part | information.in_weakest(), strict=True):
        if is_weak and takes_part:
            by_unit.setdefault(None if units is None else units.get(name), []).append(name)
    return [(" + ".join(members), tuple(members)) for members in by_unit.values() if len(members) > 2]


def _sum_of(members: Sequence[str]) -> Function:
    return lambda p: sum(p[member] for member in members)


def _gradient(function: Function, values: dict[str, float]) -> np.ndarray:
    """Return the derivatives of a smooth function by central differences."""
    slopes = []
    for name, value in values.items():
        step = 1e-5 * (abs(value) or 1.0)
        up, down = function({**values, name: value + step}), function({**values, name: value - step})
        slopes.append((up - down) / (2 * step))
    return np.asarray(np.nan_to_num(np.array(slopes), posinf=0.0, neginf=0.0))


def _statements(
    values: dict[str, float],
    se: np.ndarray,
    undetermined: tuple[str, ...],
    found: tuple[Combination, ...],
    information: _Information,
    correlation: np.ndarray,
    units: Mapping[str, str],
) -> tuple[str, ...]:
    names = list(values)
    dead = {name for name, is_dead in zip(names, information.dead, strict=True) if is_dead}
    spoken = []
    for combination in found:
        parts = ", ".join(combination.members)
        percent = 100 * combination.std_error / abs(combination.value)
        unit = next((f" {units[m]}" for m in combination.members if m in units and "+" in combination.text), "")
        spoken.append(
            f"{parts} are not determined one by one; only {combination.text} = {combination.value:.5g}{unit} "
            f"(standard error {percent:.2g} %) is."
        )
    alone = [name for name in undetermined if not any(name in c.members for c in found)]
    for name in alone:
        error = se[names.index(name)]
        size = f"standard error {error:.2g}" if math.isfinite(error) else "others can take its place exactly"
        size = "the data say nothing about it" if name in dead else size
        spoken.append(f"{name} is not determined: {size}.")
    if not undetermined and len(names) > 1:
        off = np.abs(np.nan_to_num(correlation - np.eye(len(names))))
        i, j = np.unravel_index(int(np.argmax(off)), off.shape)
        spoken.append(
            f"All {len(names)} parameters are determined; the most correlated are {names[i]} and {names[j]} "
            f"({correlation[i, j]:+.3f}), condition number {information.condition:.3g}."
        )
    return tuple(spoken)
