"""Point dipoles in a sheared chain: equations (1)-(9) of Brancati 2019 as plain functions, SI.

Symbols: phi volume fraction of powder, G0 modulus of the matrix (Pa), d particle diameter, r0 distance of
neighbours in the unstrained chain, gap ratio h = r0/d, eps = x/r0 shear strain, J_p = mu0 M_p polarisation (T),
m = J_p pi d^3/6 dipole moment (Wb m), mu1 relative permeability of the matrix. Nothing here is fitted.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

Lattice = Literal["fixed_gap", "cubic"]
LATTICES: tuple[Lattice, ...] = ("fixed_gap", "cubic")
MU0 = 4e-7 * math.pi
SPHERE = 1 / 3  # demagnetising factor of a sphere
# Densest simple cubic packing: above it the spheres of eq. (6) would overlap.
CUBIC_LIMIT = math.pi / 6
# Quadratic coefficient of eq. (1); the optimum of the fixed gap depends on it alone.
QUADRATIC = 14.1

# Numbers or arrays that broadcast; what comes back is an array of their shape (0-d for numbers).
Numbers = float | np.ndarray


def compound_modulus(matrix: float, fraction: Numbers, linear: float = 1.25) -> np.ndarray:
    """Return the shear modulus of the compound without field, Pa (eq. 1).

    `matrix` is G0 in Pa. The usual coefficient of Guth and Gold is ``linear=2.5``; 1.25 is the paper's.

    Examples
    --------
    >>> float(compound_modulus(0.3e6, 0.25))
    658125.0
    """
    phi = np.asarray(fraction)
    return np.asarray(matrix * (1 + linear * phi + QUADRATIC * phi**2))


def young_modulus(shear: float, poisson: float) -> float:
    """Return E = 2 G (1 + nu), Pa."""
    return 2 * shear * (1 + poisson)


def dipole_energy(m1: np.ndarray, m2: np.ndarray, r: np.ndarray, permeability: float = 1.0) -> float:
    """Return the energy of two dipoles, J (eq. 2).

    Moments `m1`, `m2` in Wb m and distance `r` in m, shape (3,) each.
    """
    size = float(np.linalg.norm(r))
    unit = r / size
    dots = float(m1 @ m2) - 3 * float(m1 @ unit) * float(m2 @ unit)
    return dots / (4 * math.pi * permeability * MU0 * size**3)


def chain_stress(
    strain: Numbers, fraction: float, moment: float, diameter: float, distance: float, permeability: float = 1.0
) -> np.ndarray:
    """Return the shear stress of dipoles that lie in chains across the shear, Pa (eq. 3, "r" read as r0).

    It is the derivative of the energy density ``6 phi/(pi d^3) E12`` by the strain.
    """
    size = 9 * fraction * moment**2 / (2 * math.pi**2 * permeability * MU0 * diameter**3 * distance**3)
    eps = np.asarray(strain)
    return np.asarray(size * eps * (4 - eps**2) / (1 + eps**2) ** 3.5)


def strain_factor(strain: Numbers) -> np.ndarray:
    """Return how eq. (4) falls with the shear strain, 1 at none; it changes sign at 0.3893.

    Examples
    --------
    >>> round(float(strain_factor(0.10)), 3)
    0.892
    """
    square = np.asarray(strain) ** 2
    return np.asarray((4 * square**2 - 27 * square + 4) / (4 * (1 + square) ** 4.5))


def zero_strain() -> float:
    """Return the shear strain at which the field adds nothing: the smaller root of 4 e^4 - 27 e^2 + 4."""
    return math.sqrt((27 - math.sqrt(27**2 - 64)) / 8)


def gap_ratio_of_cubic(fraction: Numbers) -> np.ndarray:
    """Return h = r0/d of a simple cubic lattice (eq. 6); below 1, beyond phi = pi/6, the spheres would overlap."""
    return np.asarray((CUBIC_LIMIT / np.asarray(fraction)) ** (1 / 3))


def magnetisation(
    flux_density: Numbers, saturation: float = 2.1, permeability: float = 1000.0, demagnetisation: float = 0.0
) -> np.ndarray:
    """Return the magnetisation of the particles over its saturation, M_p/M_s (eq. 7 of Froehlich and Kennelly).

    Parameters
    ----------
    flux_density
        B of the applied field in T; H = B/mu0.
    saturation
        J_s = mu0 M_s of the iron, T. (The paper's "M_s = 2.1 T" is J_s.)
    permeability
        mu_p, relative, of the iron.
    demagnetisation
        N of the particle: the field inside is H - N M. 0 as in the paper, 1/3 for a sphere.

    Examples
    --------
    >>> round(float(magnetisation(0.8 / 3, demagnetisation=1 / 3)), 3)
    0.379
    """
    chi = permeability - 1
    b = np.asarray(flux_density) / saturation  # H/M_s
    if demagnetisation == 0:
        return np.asarray(chi * b / (1 + chi * b))
    # M (1 + chi (H - N M)/M_s) = chi (H - N M), the smaller root, with M and H in units of M_s.
    n = chi * demagnetisation
    half = 1 + chi * b + n
    # In this form, not as (half - root)/(2 n), which cancels in a weak field.
    return np.asarray(2 * chi * b / (half + np.sqrt(half**2 - 4 * n * chi * b)))


def field_modulus(
    fraction: Numbers,
    polarisation: Numbers,
    *,
    lattice: Lattice = "fixed_gap",
    gap_ratio: float = 1.0,
    strain: float = 0.0,
    permeability: float = 1.0,
) -> np.ndarray:
    """Return the shear modulus that the field adds, G_m in Pa (eq. 4; with "cubic" eq. 8).

    Parameters
    ----------
    fraction, polarisation
        phi and J_p = mu0 M_p (T).
    lattice
        "fixed_gap" keeps h = `gap_ratio` whatever the fraction, as in a cured chain; "cubic" takes h from eq. (6).
    strain
        Shear strain eps; beyond 0.3893 the field softens.
    """
    phi = np.asarray(fraction)
    h3 = gap_ratio**3 if lattice == "fixed_gap" else CUBIC_LIMIT / phi
    return np.asarray(phi * polarisation**2 / (2 * permeability * MU0 * h3) * strain_factor(strain))


def increment(
    fraction: Numbers,
    flux_density: Numbers,
    matrix: float,
    *,
    lattice: Lattice = "fixed_gap",
    demagnetisation: float = 0.0,
    gap_ratio: float = 1.0,
    strain: float = 0.0,
    saturation: float = 2.1,
    permeability: float = 1000.0,
) -> np.ndarray:
    """Return G_m/G, the relative increment of the modulus; the paper's ratio of eq. (9) is 1 more.

    Examples
    --------
    >>> round(float(increment(0.25, 0.267, 0.3e6)), 3)
    0.656
    """
    J_p = saturation * magnetisation(flux_density, saturation, permeability, demagnetisation)
    added = field_modulus(fraction, J_p, lattice=lattice, gap_ratio=gap_ratio, strain=strain)
    return np.asarray(added / compound_modulus(matrix, fraction))


def best_fraction(lattice: Lattice) -> float:
    """Return the volume fraction of the largest increment.

    At a fixed gap 1/sqrt(14.1) = 0.2663 for any G0 and any linear coefficient of eq. (1). On the cubic lattice
    the increment rises up to the densest packing, pi/6: it has no maximum inside.
    """
    return 1 / math.sqrt(QUADRATIC) if lattice == "fixed_gap" else CUBIC_LIMIT
