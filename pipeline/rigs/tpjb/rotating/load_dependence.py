"""Stiffness that depends on the load: the orbits that it predicts, and what ties it to the quadratic terms.

A bearing whose stiffness k(W) at rest changes with the static load W has a quadratic law. Dynamic tests at
several W give the tangent stiffness; the paper uses it as a secant, which doubles the curvature.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.uncertainty import Covariance, propagate
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit

Kind = Literal["power", "line"]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class StiffnessOfLoad:
    """kxx, kxy, kyx, kyy as functions of the static load.

    Attributes
    ----------
    reference
        Load that the curves are written about, N.
    kinds
        "power": k = a (W/reference)^b; "line": k = a + b (W/reference - 1); one each.
    curves
        (a, b) of each, shape (4, 2); a in N/m, b in 1 or N/m.
    covariances
        Of (a, b), shape (4, 2, 2).
    loads
        Where it was measured, N.
    """

    reference: float
    kinds: tuple[Kind, ...]
    curves: np.ndarray
    covariances: np.ndarray
    loads: tuple[float, ...]

    @classmethod
    def through(cls, loads: Sequence[float], k: np.ndarray, sigma: np.ndarray, kind: Kind = "power") -> StiffnessOfLoad:
        """Fit the curves to stiffnesses measured at two or more static loads.

        Parameters
        ----------
        loads
            Static loads, shape (m,), N.
        k, sigma
            kxx, kxy, kyx, kyy and their standard errors at each, shape (m, 4), N/m.
        kind
            What to fit; a coefficient that changes its sign gets a line in any case.

        Raises
        ------
        InputError
            If the loads are not at least two different positive ones.
        """
        W = np.asarray(loads, dtype=float)
        if np.unique(W).size < 2 or not (W > 0).all():
            raise InputError(
                f"stiffness against load needs two different static loads; there are {', '.join(f'{w:g} N' for w in W)}."
            )
        reference = float(np.exp(np.log(W).mean()))
        kinds: list[Kind] = []
        curves, covariances = np.empty((4, 2)), np.empty((4, 2, 2))
        for j in range(4):
            own, error = k[:, j], np.maximum(sigma[:, j], 1e-9 * np.abs(k).max())
            of_one_sign = bool((own > 0).all() or (own < 0).all())
            kinds.append("power" if kind == "power" and of_one_sign else "line")
            if kinds[-1] == "power":
                columns, values, error = np.log(W / reference), np.log(np.abs(own)), error / np.abs(own)
            else:
                columns, values = W / reference - 1, own
            A = np.stack([np.ones(W.size), columns], axis=1) / error[:, None]
            covariances[j] = np.linalg.inv(A.T @ A)
            curves[j] = covariances[j] @ A.T @ (values / error)
            if kinds[-1] == "power":
                curves[j, 0] = math.copysign(math.exp(curves[j, 0]), own[0])
                covariances[j] *= np.outer([curves[j, 0], 1], [curves[j, 0], 1])
        return cls(reference, tuple(kinds), curves, covariances, tuple(W.tolist()))

    def at(self, load: np.ndarray | float) -> np.ndarray:
        """Return the four stiffnesses at loads of shape (...), shape (4, ...), N/m."""
        return np.stack([self._curve(j, self.curves[j], load) for j in range(4)])

    def slope(self, load: float) -> tuple[np.ndarray, np.ndarray]:
        """Return dk/dW of the four at a load, and its standard error, shape (4,) each, 1/m."""

        def of(j: int) -> Callable[[np.ndarray], float]:
            return lambda c: self._slope(j, c, load)

        told = [self._told(j, of(j)) for j in range(4)]
        return np.array([value for value, _ in told]), np.array([error for _, error in told])

    def rise(self, low: float, high: float) -> tuple[float, float]:
        """Return the integral of dW/kyy between two loads, and its standard error, m."""
        loads = 0.5 * (high + low) + 0.5 * (high - low) * _NODES
        return self._told(3, lambda c: float(0.5 * (high - low) * (_WEIGHTS / self._curve(3, c, loads)).sum()))

    def product(self, j: int, load: float) -> tuple[float, float]:
        """Return kyy dk_j/dW at a load and its standard error, N/m^2 (j = 0: kxx, 3: kyy)."""
        if j == 3:
            return self._told(3, lambda c: float(self._curve(3, c, load)) * self._slope(3, c, load))
        k, (slope, error) = float(self.at(load)[3]), self._told(j, lambda c: self._slope(j, c, load))
        _, k_error = self._told(3, lambda c: float(self._curve(3, c, load)))
        return k * slope, math.hypot(k * error, slope * k_error)

    def _curve(self, j: int, c: np.ndarray, load: np.ndarray | float) -> np.ndarray:
        ratio = np.asarray(load, dtype=float) / self.reference
        return np.asarray(c[0] * ratio ** c[1] if self.kinds[j] == "power" else c[0] + c[1] * (ratio - 1))

    def _slope(self, j: int, c: np.ndarray, load: float) -> float:
        if self.kinds[j] == "power":
            return float(c[1] * self._curve(j, c, load) / load)
        return float(c[1] / self.reference)

    def _told(self, j: int, function: Callable[[np.ndarray], float]) -> tuple[float, float]:
        value, spread = propagate(function, self.curves[j], Covariance(self.covariances[j]))
        return float(value[0]), float(spread.std_error[0])


@dataclass(frozen=True)
class Relation:
    """Two sides of an equation that should agree; `left` is None where the orbits do not tell it.

    `z` is their difference over its standard error, which is `difference_sigma` where both sides come
    from the same orbits, else that of two independent ones.
    """

    name: str
    left: float | None
    left_sigma: float
    right: float
    right_sigma: float
    unit: str
    text: str
    difference_sigma: float | None = None

    @property
    def difference(self) -> float | None:
        """Left minus right."""
        return None if self.left is None else self.left - self.right

    @property
    def sigma(self) -> float:
        """Standard error of the difference."""
        return math.hypot(self.left_sigma, self.right_sigma) if self.difference_sigma is None else self.difference_sigma

    @property
    def z(self) -> float | None:
        """Difference over its standard error."""
        return None if self.difference is None else self.difference / max(self.sigma, 1e-300)


def relations(fit: ModelFit, stiffness: StiffnessOfLoad, static_load: float) -> list[Relation]:
    """Return the two relations between quadratic terms and the load dependence of stiffness.

    kyy2 = kyy/2 dkyy/dW and kxxy = kyy dkxx/dW (tpjb.md section 3): a static load along y that grows
    makes the tangent stiffness grow as the dynamic displacement dy does.

    Parameters
    ----------
    fit
        Of M6, which has all terms, at this static load.
    stiffness
        From dynamic tests at two or more loads; with those of rotating tests the two sides share data.
    """
    kyy2, by_kyy = fit.estimates["kyy2"], stiffness.product(3, static_load)
    kxxy, by_kxx = fit.estimates["kxxy"], stiffness.product(0, static_load)
    return [
        Relation(
            "kyy2 = kyy/2 dkyy/dW",
            kyy2.value,
            kyy2.std_error or 0.0,
            0.5 * by_kyy[0],
            0.5 * by_kyy[1],
            "N/m^2",
            kyy2.reason or "quadratic term of the orbit against the slope of the stiffness over the static load",
        ),
        Relation(
            "kxxy = kyy dkxx/dW",
            kxxy.value,
            kxxy.std_error or 0.0,
            *by_kxx,
            "N/m^2",
            kxxy.reason or "mixed term of the orbit against the slope of the stiffness over the static load",
        ),
    ]


def position_relation(
    low: tuple[float, float, float], high: tuple[float, float, float], stiffness: StiffnessOfLoad
) -> Relation:
    """Return the relation between static positions and stiffness: y(W2) - y(W1) = integral of dW/kyy.

    Parameters
    ----------
    low, high
        Static load (N), static position along y (m) and its standard error, at two loads.
    """
    right = stiffness.rise(low[0], high[0])
    return Relation(
        "y(W2) - y(W1) = integral dW/kyy",
        high[1] - low[1],
        math.hypot(low[2], high[2]),
        *right,
        "m",
        f"static positions at {low[0]:.4g} N and {high[0]:.4g} N against the compliance in between",
    )


def conservative(fit: ModelFit) -> list[Relation]:
    """Return what holds if the film's force has a potential: kxy = kyx, kxxy = 2 kyx2, kyxy = 2 kxy2.

    Both sides come from one fit, that of M6: the error of their difference takes their correlation along.
    """
    told, C = fit.estimates, fit.p_covariance
    found = []
    for left, factor, right in (("kxy", 1.0, "kyx"), ("kxxy", 2.0, "kyx2"), ("kyxy", 2.0, "kxy2")):
        i, j = COEFFICIENTS.index(left), COEFFICIENTS.index(right)
        known = told[left].determined and told[right].determined
        sigma = math.sqrt(max(float(C[i, i] + factor**2 * C[j, j] - 2 * factor * C[i, j]), 0.0))
        found.append(
            Relation(
                f"{left} = {factor:g} {right}" if factor != 1 else f"{left} = {right}",
                float(fit.p[i]) if known else None,
                math.sqrt(max(float(C[i, i]), 0.0)),
                factor * float(fit.p[j]),
                factor * math.sqrt(max(float(C[j, j]), 0.0)),
                "N/m" if factor == 1 else "N/m^2",
                told[left].reason or told[right].reason or "holds if the film's force has a potential",
                sigma,
            )
        )
    return found
