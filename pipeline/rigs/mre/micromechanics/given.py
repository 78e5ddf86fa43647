"""What findings give the micromechanical model: properties of the compound, flux at a current, measured increments.

Everything is read from the conditions of the runs, the parameters and the table `flux_levels`; nothing is fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.findings import Findings, Parameter

NEEDED = {
    "powder_fraction": "the volume fraction of powder",
    "matrix_shear_modulus": "the shear modulus of the matrix",
}
_STANDARD = {"gap_ratio": 1.0, "powder_saturation": 2.1, "powder_permeability": 1000.0}
_MEASURED = {
    "stiffening_secant": "axial stiffening, secant",
    "stiffening_slope": "axial stiffening, slope",
    "mr_effect_amplitude": "shear stiffness at equal amplitude",
    "mr_effect_force": "shear stiffness at equal force",
    "force_increment": "force at a fixed gap",
}
_MOST = 40  # increments shown
_NO_CURRENT = 0.1  # A


@dataclass(frozen=True)
class Compound:
    """What the model needs of the compound; `said` names what was not given but taken as usual."""

    fraction: float
    matrix: float
    gap_ratio: float
    saturation: float
    permeability: float
    said: tuple[str, ...]


@dataclass(frozen=True)
class Increment:
    """A measured relative increment at a coil current (A), with its 95 % interval."""

    what: str
    current: float
    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Flux:
    """Flux density at coil currents: `current` (A) and `density` (T), shape (n,), or a straight line.

    `source` says where it is from.
    """

    current: np.ndarray
    density: np.ndarray
    source: str

    def at(self, current: float) -> float:
        """Return the flux density at a current, T; NaN beyond what was measured by more than a tenth."""
        size, known = abs(current), np.abs(self.current)
        if not known.size or size > 1.1 * known.max():
            return math.nan
        order = np.argsort(known)
        return float(np.interp(size, known[order], np.abs(self.density)[order]))


def one_value(findings: Findings, name: str) -> float | None:
    """Return a condition that all runs that give it share; None where none does, or they differ."""
    given = {run.conditions.get(name) for run in findings.runs if run.used} - {None}
    numbers = {float(value) for value in given if isinstance(value, int | float) and not isinstance(value, bool)}
    return numbers.pop() if len(numbers) == 1 else None


def compound_of(findings: Findings) -> Compound | list[str]:
    """Return the compound, or the names of the conditions that it would need."""
    given = {name: one_value(findings, name) for name in (*NEEDED, *_STANDARD)}
    fraction, matrix = given["powder_fraction"], given["matrix_shear_modulus"]
    if not fraction or not matrix:
        return [name for name in NEEDED if not given[name]]
    usual = {name: value for name, value in _STANDARD.items() if given[name] is None}
    taken = {**_STANDARD, **{name: value for name, value in given.items() if value is not None}}
    return Compound(
        fraction,
        matrix,
        taken["gap_ratio"],
        taken["powder_saturation"],
        taken["powder_permeability"],
        tuple(f"{name} = {value:g}{' T' if 'saturation' in name else ''}" for name, value in usual.items()),
    )


def flux_of(findings: Findings) -> Flux | None:
    """Return the flux over the current: as measured, else by the condition `flux_per_current`, else None."""
    table = findings.arrays.get("flux_levels")
    if table is not None and len(table):
        current, density = table["current"].to_numpy(float), table["flux_density"].to_numpy(float)
        known = np.isfinite(current) & np.isfinite(density)
        if known.any():
            current, density = current[known], density[known]
            if np.abs(current).min() > _NO_CURRENT:
                current, density = np.r_[0.0, current], np.r_[0.0, density]
            return Flux(current, density, "as measured at each current")
    slope = one_value(findings, "flux_per_current")
    if slope is None:
        return None
    reach = 1e3
    return Flux(
        np.array([0.0, reach]),
        np.array([0.0, reach * slope]),
        f"assumed to be {slope:.4g} T per ampere (condition flux_per_current); it was not measured",
    )


def increments_of(findings: Findings) -> list[Increment]:
    """Return the measured increments, as they stand among the parameters."""
    found = []
    for p in findings.parameters:
        current = p.at.get("coil_current")
        if p.name in _MEASURED and p.value is not None and isinstance(current, float | int):
            preload = p.at.get("preload")
            more = f", {preload:g} N" if isinstance(preload, float | int) else ""
            found.append(_increment(f"{_MEASURED[p.name]}{more}", float(current), p))
    return [*found, *_field_stiffness(findings)][:_MOST]


def _increment(what: str, current: float, p: Parameter) -> Increment:
    value = float(p.value or 0.0)
    low, high = p.ci95 or (math.nan, math.nan)
    return Increment(what, current, value, low, high)


def _field_stiffness(findings: Findings) -> list[Increment]:
    """Return k_MR over the static stiffness k2, or k2 at a current over k2 at none, with errors in quadrature."""
    statics: Sequence[Parameter] = [p for p in findings.find("k2") if p.value]
    base = next((p for p in statics if not p.at or abs(float(p.at.get("coil_current", math.nan))) < 0.05), None)
    if base is None or not base.value:
        return []
    found = []
    for p in findings.find("k_mr"):
        current = p.at.get("coil_current")
        if p.value is not None and isinstance(current, float | int):
            sd = abs(p.value / base.value) * math.hypot(_relative(p), _relative(base))
            ratio = p.value / base.value
            found.append(
                Increment(
                    "static shear stiffness, k_MR/k2", float(current), ratio, ratio - 1.96 * sd, ratio + 1.96 * sd
                )
            )
    for p in statics:
        current = p.at.get("coil_current")
        if p is not base and isinstance(current, float | int):
            ratio = float(p.value or 0.0) / base.value
            sd = abs(ratio) * math.hypot(_relative(p), _relative(base))
            found.append(
                Increment("static shear stiffness k2", float(current), ratio - 1, ratio - 1 - 1.96 * sd, ratio - 1 + 1.96 * sd)
            )  # fmt: skip
    return found


def _relative(p: Parameter) -> float:
    return abs((p.std_error or 0.0) / p.value) if p.value else 0.0
