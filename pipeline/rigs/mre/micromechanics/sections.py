"""The chapter "Micromechanics": what dipoles in chains predict, beside the increments that were measured.

Works from findings alone: conditions of the runs, parameters and the table `flux_levels`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
    Section,
    Status,
    Table,
    Text,
    Value,
)
from pipeline.rigs.mre.micromechanics.dipoles import (
    CUBIC_LIMIT,
    LATTICES,
    SPHERE,
    Lattice,
    best_fraction,
    compound_modulus,
    increment,
    strain_factor,
    young_modulus,
    zero_strain,
)
from pipeline.rigs.mre.micromechanics.given import (
    NEEDED,
    Compound,
    Flux,
    Increment,
    compound_of,
    flux_of,
    increments_of,
    one_value,
)

_INCREMENT = Axis("increment G_m/G", "%")
_FORMS: tuple[tuple[Lattice, float], ...] = tuple((lattice, n) for lattice in LATTICES for n in (0.0, SPHERE))
_SATURATED = 1e3  # T
_PAPER_FLUX, _PAPER_STIFFENING, _PAPER_OPTIMUM = 0.267, 0.65, (0.25, 0.30)
_CLOSE = 0.05


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapter, one text where a condition is missing, nothing where none of the compound is told."""
    compound = compound_of(findings)
    if isinstance(compound, list):
        if len(compound) == len(NEEDED):
            return []
        told = listing(f"'{name}' ({NEEDED[name]})" for name in compound)
        text = f"What a field adds by the theory of dipoles in chains is not computed: the runs do not give {told}, or not alike."
        return [Section("micromechanics", "Micromechanics", [Text([text])])]
    flux, measured = flux_of(findings), increments_of(findings)
    blocks: list[Figure | Table | Text] = [Text(_introduction(findings, compound, flux))]
    blocks.append(_over_flux(compound, flux, measured))
    if measured:
        blocks.append(_beside_measured(compound, flux, measured))
    blocks += [_over_fraction(compound, flux, measured), _contradictions(compound)]
    return [Section("micromechanics", "Micromechanics", blocks)]


def _predicted(compound: Compound, flux: np.ndarray | float, lattice: Lattice, n: float, fraction: np.ndarray | float | None = None) -> np.ndarray:  # fmt: skip
    return increment(
        compound.fraction if fraction is None else fraction,
        flux,
        compound.matrix,
        lattice=lattice,
        demagnetisation=n,
        gap_ratio=compound.gap_ratio,
        saturation=compound.saturation,
        permeability=compound.permeability,
    )


def _form(lattice: Lattice, n: float) -> str:
    return f"{'fixed gap' if lattice == 'fixed_gap' else 'cubic'}, N = {'1/3' if n else '0'}"


def _introduction(findings: Findings, compound: Compound, flux: Flux | None) -> list[str]:
    G = float(compound_modulus(compound.matrix, compound.fraction))
    text = (
        f"Without field the compound has G = {G / 1e6:.3g} MPa by eq. (1), from the matrix ({compound.matrix / 1e6:.3g} MPa) and "
        f"{100 * compound.fraction:.3g} % powder."
    )
    nu = one_value(findings, "poisson_ratio")
    if nu is not None:
        text += f" With Poisson's ratio {nu:g}, E = {young_modulus(G, nu) / 1e6:.3g} MPa."
    text += (
        " The field adds G_m: dipoles in line, their chain sheared (eqs 2 to 5). Two forms of the lattice are shown: chains whose "
        f"particles keep their distance whatever the fraction (fixed gap, centres {compound.gap_ratio:g} times the diameter apart, eq. 4; the better picture of a cured "
        "chain), and a simple cubic lattice (eq. 8); and particles without (N = 0, the paper's) and with the demagnetising field of a sphere (N = 1/3)."
    )
    said = [text]
    if compound.said:
        said.append(f"Not given by the runs and taken as usual: {listing(compound.said)}.")
    if flux is None:
        said.append(
            "The flux density at the coil currents is not known, so that measured increments have no place in the figure: log flux_density, or give "
            "the condition flux_per_current."
        )
    else:
        said.append(f"The flux density at the coil currents is {flux.source}.")
    said.append(
        "The theory is one of shear across the chains. For strain along the chain the same dipoles have a negative second derivative of the energy (they "
        "soften in compression), so that E = 2 (G + G_m)(1 + ν) is an engineering assumption, and axial increments are shown under it."
    )
    return said


def _placed(flux: Flux | None, measured: Sequence[Increment]) -> list[tuple[float, Increment]]:
    places = [(flux.at(one.current), one) for one in measured] if flux is not None else []
    return [(at, one) for at, one in places if math.isfinite(at)]


def _explained(compound: Compound, flux: Flux | None, measured: Sequence[Increment]) -> str:
    """Say how near the forms of the theory come to what was measured, and which comes nearest."""
    placed = _placed(flux, measured)
    if not placed:
        return "Not told: no increment was measured at a known flux density."
    value, low, high = np.array([(one.value, one.low, one.high) for _, one in placed]).T
    at = np.array([place for place, _ in placed])
    said = {_form(lattice, n): _predicted(compound, at, lattice, n) for lattice, n in _FORMS}
    off = {form: float(np.mean(np.abs(predicted - value))) for form, predicted in said.items()}
    nearest = min(off, key=off.__getitem__)
    held = int(((low <= said[nearest]) & (said[nearest] <= high)).sum())
    number = f"the {len(placed)} measured increments" if len(placed) > 1 else "the measured increment"
    away = 100.0 * off[nearest]
    return (
        f"Of its four forms {nearest} comes nearest, {away:.{1 if away < 10.0 else 0}f} percentage points off {number}"
        f"{' on average' if len(placed) > 1 else ''}; {'none' if held == 0 else held} of the 95 % intervals "
        f"{'hold' if held > 1 else 'holds'} its prediction."
    )


def _over_flux(compound: Compound, flux: Flux | None, measured: Sequence[Increment]) -> Figure:
    placed = _placed(flux, measured)
    most = max([0.8, *(1.15 * at for at, _ in placed)])
    B = np.unique(np.r_[0.0, np.geomspace(1e-4, most, 120), np.linspace(0.0, most, 160)])
    marks: list[Mark] = [
        Line(B, _predicted(compound, B, lattice, n), k, _form(lattice, n), dashed=n == 0.0)
        for k, (lattice, n) in enumerate(_FORMS)
    ]
    for k, what in enumerate(dict.fromkeys(one.what for _, one in placed)):
        part = [(at, one) for at, one in placed if one.what == what]
        x = np.array([at for at, _ in part])
        value, low, high = np.array([(one.value, one.low, one.high) for _, one in part]).T
        marks.append(Points(x, value, len(_FORMS) + k, what, low, high))
    beyond = len(measured) - len(placed) if flux is not None else 0
    return Figure(
        "micromechanics_flux",
        "Increment over the flux density",
        f"Does the theory explain what was measured? {_explained(compound, flux, measured)} Lines: G_m/G at small strain; points: measured increments with 95 % intervals. "
        "Without demagnetisation the powder saturates within millitesla, so the lines are flat; with it the increment grows with the square of the field, then saturates."
        + (f" {beyond} measured increments lie beyond the currents at which the flux is known." if beyond > 0 else ""),
        "predicted increment of the shear modulus over flux density for two lattices and two demagnetising factors, with measured increments",
        [Panel(marks, Axis("flux density", "T"), _INCREMENT)],
    )


def _beside_measured(compound: Compound, flux: Flux | None, measured: Sequence[Increment]) -> Table:
    rows: list[list[Cell]] = []
    for one in measured:
        at = flux.at(one.current) if flux is not None else math.nan
        known = math.isfinite(at)
        cells: list[Cell] = [one.what, one.current, at if known else None]
        cells.append(Value(one.value, (one.high - one.low) / 3.92, (one.low, one.high)))
        cells += [float(_predicted(compound, at, lattice, n)) if known else None for lattice, n in _FORMS]
        rows.append(cells)
    return Table(
        "micromechanics_measured",
        "Measured and predicted increments",
        "The points of the figure in numbers. Predicted: G_m/G in small shear at the flux density of that current; no parameter of it was fitted.",
        [
            Column("measured on"),
            Column("coil current", "A"),
            Column("flux density", "T"),
            Column("measured", "%"),
            *(Column(_form(lattice, n), "%") for lattice, n in _FORMS),
        ],
        rows,
    )


def _over_fraction(compound: Compound, flux: Flux | None, measured: Sequence[Increment]) -> Figure:
    known = [flux.at(one.current) for one in measured] if flux is not None else []
    B = max((at for at in known if math.isfinite(at)), default=_SATURATED)
    at = f"at {B:.3g} T" if B < _SATURATED else "in saturation"
    phi = np.linspace(0.005, CUBIC_LIMIT, 200)
    marks: list[Mark] = [
        Line(phi, _predicted(compound, B, lattice, n, phi), k, _form(lattice, n), dashed=n == 0.0)
        for k, (lattice, n) in enumerate(_FORMS)
    ]
    marks.append(Rule(x=best_fraction("fixed_gap"), label="optimum, fixed gap"))
    marks.append(Rule(x=CUBIC_LIMIT, label="densest cubic packing"))
    marks.append(Rule(x=compound.fraction, role="measured", label="this compound"))
    return Figure(
        "micromechanics_fraction",
        "Increment over the volume fraction of powder",
        f"Which fraction serves best? At a fixed gap {best_fraction('fixed_gap'):.4f} = 1/√14.1, whatever the moduli are; on the cubic lattice none: the increment rises "
        f"up to the densest packing, {CUBIC_LIMIT:.4f}. {_of_the_best(compound, B)} Drawn: G_m/G {at}.",
        "predicted increment over volume fraction for both lattices with the optimum of the fixed gap and the densest cubic packing marked",
        [Panel(marks, Axis("volume fraction of powder"), _INCREMENT)],
    )


def _of_the_best(compound: Compound, B: float) -> str:
    """Say what share of the largest increment at a fixed gap this compound's fraction gives."""
    here, best = (
        _predicted(compound, B, "fixed_gap", 0.0, phi) for phi in (compound.fraction, best_fraction("fixed_gap"))
    )
    return f"This compound's {compound.fraction:.3g} gives {100 * float(here / best):.3g} % of the most at a fixed gap."


def _contradictions(compound: Compound) -> Table:
    def judged(value: float) -> Status:
        return Status.agrees if abs(value - _PAPER_STIFFENING) < _CLOSE else Status.contradicts

    best = best_fraction("fixed_gap")
    inside = _PAPER_OPTIMUM[0] <= best <= _PAPER_OPTIMUM[1]
    rows: list[list[Cell]] = [
        ["best fraction, cubic lattice (eq. 8)", "0.25 to 0.30", f"none below {CUBIC_LIMIT:.3f}", Status.contradicts],
        ["best fraction, fixed gap (eq. 4)", "0.25 to 0.30", f"{best:.4f}", Status.agrees if inside else Status.contradicts],
    ]  # fmt: skip
    claimed = f"about {100 * _PAPER_STIFFENING:.0f} %"
    for lattice in LATTICES:
        cases = [(f"{_form(lattice, 0.0).partition(',')[0]}, saturated, any N", _SATURATED, 0.0)]
        cases += [(f"{_form(lattice, n)}, {_PAPER_FLUX:g} T", _PAPER_FLUX, n) for n in (0.0, SPHERE)]
        for form, B, n in cases:
            value = float(_predicted(compound, B, lattice, n))
            rows.append([f"increment, {form}", claimed, f"{100 * value:.1f} %", judged(value)])
    tenth = float(strain_factor(0.1))
    rows.append(
        ["strain at which the field softens", "not told", f"{100 * zero_strain():.1f} %, and {tenth:.3f} of the increment at 10 %", Status.not_checkable]
    )  # fmt: skip
    verdicts = [row[-1] for row in rows]
    agree, against = verdicts.count(Status.agrees), verdicts.count(Status.contradicts)
    return Table(
        "micromechanics_contradictions",
        "The paper's claims by the paper's equations",
        f"Do the paper's equations give what the paper claims? In {agree} of {agree + against} rows, for the compound of this campaign. Claimed: the largest effect at 0.25 to 0.30 (section 2) and a stiffening of about 65 % at 2 A (Fig. 8), where a straight "
        "line to 0.8 T at 6 A gives 0.267 T. Eq. (9) of the paper is a ratio, 1 without field; told here is the increment.",
        [Column("claim"), Column("paper"), Column("by the equations"), Column("verdict")],
        rows,
    )
