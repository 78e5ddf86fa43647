"""Models M1L to M4L: the orbit from stiffness that depends on the load, k_ij(W + f_y), of dynamic tests.

Secant is the paper's way; tangent-consistent integrates the compliance instead, since a dynamic test
gives the tangent stiffness. Without free coefficients, save the quadratic terms of M3L and M4L.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.load_dependence import StiffnessOfLoad
from pipeline.rigs.tpjb.rotating.model_fit import LawFit, fit_law
from pipeline.rigs.tpjb.rotating.noise import Noise, orbit_noise
from pipeline.rigs.tpjb.rotating.orbit import Orbit

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True, eq=False)
class LoadLaw:
    """A law whose linear part follows the total load along y.

    Attributes
    ----------
    name, text
        "M1L", and what it is.
    stiffness, static_load
        k(W), and W of these runs, N.
    cross
        Whether kxy and kyx take part.
    tangent
        Whether k is integrated as the tangent that it is; else it is used as a secant.
    free
        Quadratic terms that are fitted anew (secant only).
    """

    name: str
    text: str
    stiffness: StiffnessOfLoad
    static_load: float
    cross: bool
    tangent: bool = False
    free: tuple[str, ...] = ()

    @property
    def scale(self) -> np.ndarray:
        """Typical sizes of the free coefficients."""
        return np.full(len(self.free), law.SCALE[-1])

    def _linear(self, along_y: np.ndarray) -> np.ndarray:
        """Return kxx, kxy, kyx, kyy under the dynamic force along y, shape (4, ...)."""
        k = self.stiffness.at(self.static_load + along_y)
        if not self.cross:
            k[1:3] = 0.0
        return k

    def displacement(self, theta: np.ndarray, f: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
        """Return the displacement (m), shape (2, n), under the force `f`."""
        if not self.tangent:
            return law.equilibrium(self._coefficients(theta, f), f, near)
        # First the load along y rises to its value, then that along x at the stiffness that it meets there.
        part = 0.5 * (1 + _NODES)
        kxx, kxy, kyx, kyy = self._linear(part[:, None] * f[1])
        det = kxx * kyy - kxy * kyx
        weight = 0.5 * _WEIGHTS[:, None] * f[1] / det
        d = np.stack([-(weight * kxy).sum(axis=0), (weight * kxx).sum(axis=0)])
        kxx, kxy, kyx, kyy = self._linear(f[1])
        return np.asarray(d + np.stack([kyy, -kyx]) * f[0] / (kxx * kyy - kxy * kyx))

    def _coefficients(self, theta: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Return the ten coefficients under the load of each sample, shape (10, n)."""
        p = np.zeros((10, f.shape[1]))
        p[:4] = self._linear(f[1])
        for name, value in zip(self.free, theta, strict=True):
            p[law.COEFFICIENTS.index(name)] = value
        return p

    def slopes(self, theta: np.ndarray, d: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return dd/dtheta, shape (2, k, n), and dd/df, shape (2, 2, n); with the load the stiffness changes, too."""
        push = 1e-5 * self.static_load
        if self.tangent:
            by_force = np.empty((2, 2, f.shape[1]))
            for j in range(2):
                step = np.zeros((2, 1))
                step[j] = push
                up, down = (self.displacement(theta, f + sign * step) for sign in (1, -1))
                by_force[:, j] = (up - down) / (2 * push)
            return np.zeros((2, 0, f.shape[1])), np.nan_to_num(by_force)
        p = self._coefficients(theta, f)
        by_coefficient, by_force = law.sensitivity(p, d), law.compliance(p, d)
        stiffening = (self._linear(f[1] + push) - self._linear(f[1] - push)) / (2 * push)
        by_force[:, 1] += np.einsum("ijn,jn->in", by_coefficient[:, :4], stiffening)
        places = [law.COEFFICIENTS.index(name) for name in self.free]
        return np.nan_to_num(by_coefficient[:, places]), np.nan_to_num(by_force)


def load_laws(stiffness: StiffnessOfLoad, static_load: float) -> tuple[LoadLaw, ...]:
    """Return M1L to M4L as the paper has them, and the tangent-consistent M1T and M2T."""
    anew = ("kxx2", "kyy2")
    return (
        LoadLaw("M1L", "direct terms k(W + fy) as secant", stiffness, static_load, False),
        LoadLaw("M2L", "all terms k(W + fy) as secant", stiffness, static_load, True),
        LoadLaw("M3L", "M1L with quadratic direct terms fitted anew", stiffness, static_load, False, free=anew),
        LoadLaw("M4L", "M2L with quadratic direct terms fitted anew", stiffness, static_load, True, free=anew),
        LoadLaw("M1T", "direct terms k(W + fy) as tangent", stiffness, static_load, False, tangent=True),
        LoadLaw("M2T", "all terms k(W + fy) as tangent", stiffness, static_load, True, tangent=True),
    )


def fit_load_models(
    orbits: Sequence[Orbit],
    stiffness: StiffnessOfLoad,
    static_load: float,
    noises: Sequence[Noise] | None = None,
) -> tuple[dict[str, LawFit], dict[str, str]]:
    """Fit offset and drift (and what is free) of every load-dependent model to the runs at one static load.

    Returns
    -------
    The fits by name, and by name why a model has no solution under these loads.
    """
    noises = [orbit_noise(orbit) for orbit in orbits] if noises is None else noises
    largest = max(orbit.rotation.size for orbit in orbits)
    fold = 2 * float(np.abs(stiffness.at(static_load)).max()) ** 2 / (4 * largest)
    fits, failed = {}, {}
    for own in load_laws(stiffness, static_load):
        bound = np.full(len(own.free), fold)
        start = np.zeros(len(own.free))
        if not all(np.isfinite(own.displacement(start, orbit.force)).all() for orbit in orbits):
            failed[own.name] = "no equilibrium under the largest load: the law folds before"
            continue
        try:
            fits[own.name] = fit_law(orbits, noises, own, start, (-bound, bound))
        except InputError as error:
            failed[own.name] = str(error)
    return fits, failed
