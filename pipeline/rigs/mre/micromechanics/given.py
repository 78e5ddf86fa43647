"""What findings give the micromechanical model: properties of the compound, flux at a current, measured increments.

Everything is read from the conditions of the runs, the parameters and the table `flux_levels`; nothing is fitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.findings import Findings, Parameter

NEEDED = {
    "powder_fraction": "the volume fraction of powder",
    "matrix_shear_modulus": "the shear modulus of the matrix",
}
_STANDARD = {"gap_ratio": 1.0, "powder_saturation": 2.1, "powder_permeability": 1000.0}
_WORDS = {
    "gap_ratio": "particles that touch, centres {:g} diameter apart",
    "powder_saturation": "a saturation of {:g} T",
    "powder_permeability": "a relative permeability of {:g}",
}
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
        tuple(f"{_WORDS[name].format(value)} ({name})" for name, value in usual.items()),
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


@dataclass(frozen=True)
class _Static:
    """A static stiffness (N/m) and its standard error."""

    value: float
    sd: float


def _field_stiffness(findings: Findings) -> list[Increment]:
    """Return by how much the field adds to the static shear stiffness, at large and at small strain.

    At large strain the Bouc-Wen spring has yielded and k2 is left; at small strain, which the theory is about,
    it is k2 + a_BW rho. Errors are added in quadrature as if k2, a_BW and rho were independent; their negative
    correlation makes that an upper limit.
    """
    found = []
    for what, small in (("large strain: k_2", False), ("small strain: k_2 + a_BW ρ", True)):
        base = _static(findings, 0.0, small)
        if base is None:
            continue
        for p in findings.find("k_mr"):
            current = p.at.get("coil_current")
            if p.value is not None and isinstance(current, float | int):
                found.append(_over(what, float(current), _Static(p.value, p.std_error or 0.0), base, 0.0))
        for current in sorted(
            {c for p in findings.find("k2") if isinstance(c := p.at.get("coil_current"), float | int)}
        ):
            whole = _static(findings, float(current), small)
            if abs(current) >= _NO_CURRENT and whole is not None:
                found.append(_over(what, float(current), whole, base, 1.0))
    return found


def _over(what: str, current: float, part: _Static, base: _Static, less: float) -> Increment:
    ratio = part.value / base.value
    sd = abs(ratio) * math.hypot(part.sd / part.value, base.sd / base.value) if part.value else part.sd / base.value
    value = ratio - less
    return Increment(f"static shear stiffness, {what}", current, value, value - 1.96 * sd, value + 1.96 * sd)


def _static(findings: Findings, current: float, small: bool) -> _Static | None:
    """Return the static stiffness at a current; None where part of it is not known, or differs between records."""
    k2 = _one(findings, "k2", current)
    if k2 is None or not k2.value:
        return None
    if not small:
        return _Static(k2.value, k2.std_error or 0.0)
    force, slope = _one(findings, "alpha_bw", current), _one(findings, "rho", current)
    if force is None or slope is None or force.value is None or slope.value is None:
        return None
    product = force.value * slope.value
    sd = math.hypot(k2.std_error or 0.0, product * math.hypot(_relative(force), _relative(slope)))
    return _Static(k2.value + product, sd)


def _one(findings: Findings, name: str, current: float) -> Parameter | None:
    """Return the only determined parameter of that name at a current, or at any where it does not depend on it."""
    near = [
        p
        for p in findings.find(name)
        if p.value is not None and abs(float(p.at.get("coil_current", current)) - current) < _NO_CURRENT
    ]
    return near[0] if len(near) == 1 else None


def _relative(p: Parameter) -> float:
    return abs((p.std_error or 0.0) / p.value) if p.value else 0.0
