"""Equations (1)-(9): every number of mre.md 3.1, and each equation from the one before it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.rigs.mre.micromechanics.dipoles import (
    CUBIC_LIMIT,
    MU0,
    SPHERE,
    Lattice,
    best_fraction,
    chain_stress,
    compound_modulus,
    dipole_energy,
    field_modulus,
    gap_ratio_of_cubic,
    increment,
    magnetisation,
    strain_factor,
    young_modulus,
    zero_strain,
)

PHI, G0, J_S = 0.25, 0.3e6, 2.1
H = 1.3
DIAMETER = 5e-6
MOMENT = 1.7 * math.pi * DIAMETER**3 / 6


def energy_density(strain: float) -> float:
    r0 = H * DIAMETER
    m = np.array([0.0, 0.0, MOMENT])
    return 6 * PHI / (math.pi * DIAMETER**3) * dipole_energy(m, m, np.array([strain * r0, 0.0, r0]))


@pytest.mark.parametrize("strain", [0.0, 0.05, 0.2, 0.3893, 0.7])
def test_stress_is_the_derivative_of_the_energy_of_in_line_dipoles(strain: float) -> None:
    step = 1e-4
    slope = (
        8 * (energy_density(strain + step) - energy_density(strain - step))
        - (energy_density(strain + 2 * step) - energy_density(strain - 2 * step))
    ) / (12 * step)
    assert chain_stress(strain, PHI, MOMENT, DIAMETER, H * DIAMETER) == pytest.approx(slope, rel=1e-7, abs=1e-3)


@pytest.mark.parametrize("strain", [0.0, 0.05, 0.2, 0.3893, 0.7])
def test_field_modulus_is_the_derivative_of_the_stress(strain: float) -> None:
    def stress(e: float) -> float:
        return float(chain_stress(e, PHI, MOMENT, DIAMETER, H * DIAMETER))

    step = 1e-3
    slope = (8 * (stress(strain + step) - stress(strain - step)) - stress(strain + 2 * step) + stress(strain - 2 * step)) / (
        12 * step
    )  # fmt: skip
    assert field_modulus(PHI, 1.7, gap_ratio=H, strain=strain) == pytest.approx(slope, rel=1e-6, abs=0.5)


@pytest.mark.parametrize("strain", [0.0, 0.1, 0.3])
def test_cubic_lattice_is_the_fixed_gap_at_the_gap_of_the_lattice(strain: float) -> None:
    gap = float(gap_ratio_of_cubic(PHI))
    cubic = field_modulus(PHI, 1.7, lattice="cubic", strain=strain)
    assert cubic == pytest.approx(field_modulus(PHI, 1.7, gap_ratio=gap, strain=strain), rel=1e-12)
    # Equation (8) as printed.
    M_p = 1.7 / MU0
    printed = 6 * (4 * strain**4 - 27 * strain**2 + 4) * PHI**2 * MU0 * M_p**2 / (8 * math.pi * (1 + strain**2) ** 4.5)
    assert cubic == pytest.approx(printed, rel=1e-12)


def test_gap_of_the_simple_cubic_lattice() -> None:
    assert gap_ratio_of_cubic(0.25) == pytest.approx(1.279, abs=5e-4)
    assert gap_ratio_of_cubic(CUBIC_LIMIT) == pytest.approx(1.0)
    assert pytest.approx(0.5236, abs=5e-5) == CUBIC_LIMIT


def test_moduli_of_the_compound_of_the_paper() -> None:
    assert compound_modulus(G0, PHI) == pytest.approx(0.658125e6)
    assert young_modulus(float(compound_modulus(G0, PHI)), 0.2) == pytest.approx(1.5795e6)
    assert young_modulus(0.66e6, 0.2) == pytest.approx(1.584e6)


def test_saturated_modulus() -> None:
    assert field_modulus(PHI, J_S, lattice="cubic") == pytest.approx(3 * PHI**2 * J_S**2 / (math.pi * MU0))
    assert field_modulus(PHI, J_S, gap_ratio=H) == pytest.approx(PHI * J_S**2 / (2 * MU0 * H**3))
    # 2.1 taken as A/m and not as tesla gives nonsense.
    assert field_modulus(PHI, 2.1 * MU0, lattice="cubic") < 1e-6


@pytest.mark.parametrize(("strain", "factor"), [(0.0, 1.0), (0.05, 0.972), (0.10, 0.892), (0.20, 0.613)])
def test_strain_lowers_the_field_modulus(strain: float, factor: float) -> None:
    assert strain_factor(strain) == pytest.approx(factor, abs=5e-4)


def test_field_modulus_changes_sign() -> None:
    assert zero_strain() == pytest.approx(0.3893, abs=5e-5)
    assert strain_factor(zero_strain()) == pytest.approx(0.0, abs=1e-12)
    assert strain_factor(0.38) > 0 > strain_factor(0.40)


def test_increment_of_the_paper_is_reproduced_by_touching_spheres_only() -> None:
    far = 1e3  # T: saturated
    assert increment(PHI, far, G0, lattice="cubic") == pytest.approx(0.318, abs=5e-4)
    assert increment(PHI, far, G0) == pytest.approx(0.667, abs=5e-4)
    assert increment(PHI, 0.267, G0) == pytest.approx(0.656, abs=5e-4)


def test_without_demagnetisation_the_powder_saturates_at_millitesla() -> None:
    assert magnetisation(2.1e-3) == pytest.approx(0.5, abs=1e-3)
    assert magnetisation(0.133) ** 2 == pytest.approx(0.97, abs=2e-3)


@pytest.mark.parametrize(("flux", "share"), [(0.8 / 6, 0.189), (0.8 / 3, 0.379), (3.2 / 6, 0.752), (0.8, 0.982)])
def test_magnetisation_of_spheres(flux: float, share: float) -> None:
    assert magnetisation(flux, demagnetisation=SPHERE) == pytest.approx(share, abs=1e-3)


def test_magnetisation_solves_its_own_equation() -> None:
    B = np.geomspace(1e-6, 5, 50)
    M = magnetisation(B, demagnetisation=SPHERE)
    inside = B / J_S - SPHERE * M
    assert np.allclose(M, 999 * inside / (1 + 999 * inside), rtol=1e-9)
    assert magnetisation(0.0, demagnetisation=SPHERE) == 0.0
    assert np.allclose(magnetisation(B, demagnetisation=1e-9), magnetisation(B), rtol=1e-5)


@pytest.mark.parametrize(("flux", "share"), [(0.8 / 3, 0.096), (0.8, 0.64)])
def test_increment_with_demagnetisation_grows_with_the_square_of_the_field(flux: float, share: float) -> None:
    assert increment(PHI, flux, G0, demagnetisation=SPHERE) == pytest.approx(share, abs=5e-3)


@pytest.mark.parametrize("linear", [1.25, 2.5, 0.0])
def test_fixed_gap_has_its_optimum_at_one_over_root_of_the_quadratic_coefficient(linear: float) -> None:
    phi = np.linspace(0.01, 0.52, 100_001)
    ratio = field_modulus(phi, J_S) / compound_modulus(G0, phi, linear)
    assert phi[ratio.argmax()] == pytest.approx(0.2663, abs=1e-4)
    assert best_fraction("fixed_gap") == pytest.approx(0.2663, abs=5e-5)


def test_cubic_lattice_has_no_optimum_inside() -> None:
    phi = np.linspace(0.01, CUBIC_LIMIT, 1000)
    assert (np.diff(increment(phi, 1.0, G0, lattice="cubic")) > 0).all()
    assert best_fraction("cubic") == CUBIC_LIMIT


@pytest.mark.parametrize("lattice", ["fixed_gap", "cubic"])
def test_increment_never_decreases_with_the_field(lattice: Lattice) -> None:
    B = np.linspace(0, 2, 200)
    for demagnetisation in (0.0, SPHERE):
        found = increment(PHI, B, G0, lattice=lattice, demagnetisation=demagnetisation)
        assert found[0] == 0
        assert (np.diff(found) >= 0).all()
