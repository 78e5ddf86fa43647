"""The methods paragraphs of `tpjb.bump`, written from the findings and the settings that were used."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    paragraphs = [_signals(findings), _polygon(findings)]
    if any(model.name.endswith("pads") and model.selected for model in findings.models):
        paragraphs += [_contact(findings), _errors()]
    return paragraphs


def _signals(findings: Findings) -> str:
    orbits = findings.arrays["orbits"]
    planes = orbits["plane"].nunique()
    angle = math.degrees(float(findings.settings.get("block_angle", 0.035)))
    levels = listing(f"{force:.4g} N" for force in sorted(orbits["force"].unique()))
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    return (
        "Bump test (Ciulli and Forte 2019): the dry bearing is pressed against the shaft at rest by a turning force. The "
        f"displacement of stator against shaft comes from opposed proximity probes in {counted(planes, 'plane')}, half the difference of a "
        f"pair. Force and displacement were averaged over {angle:.2g} deg of turn ({len(orbits) // planes} blocks in use). Force "
        f"levels were found from the size of the force, median over a turn: {levels}.{told}"
    )


def _polygon(findings: Findings) -> str:
    candidates = findings.arrays["candidates"]
    tried = ", ".join(
        f"{int(n)} ({1e6 * m:.2g} um)" for n, m in zip(candidates["n_pads"], candidates["misfit"], strict=True)
    )
    return (
        "At each level the support function, the 99.9 % quantile of the displacement along each side's normal, was summed over "
        "the sides and the rotation chosen at its least value over all rotations; each side was then moved to the median of "
        f"the samples within {1e6 * float(findings.settings.get('near', 0.5e-6)):.2g} um. Number of sides tried, with rms "
        f"distance of the orbit from the polygon: {tried}."
    )


def _contact(findings: Findings) -> str:
    model = next(m for m in findings.models if m.selected)
    return (
        "The contact law (each side a spring k_p once it is reached, a soft support k_s with its own neutral point) was fitted "
        f"to all levels and planes together: sides, rotation and neutral point of each plane, k_p and k_s ({model.n_parameters} "
        f"parameters, {model.n_data} data). Which sides are pressed follows from the least potential over all sets of sides. "
        "Blocks in which a side is met or left were not used, since they obey no one linear law. Residuals were weighted with "
        "the noise of the displacement and, through the compliance, of the force (effective variance, Orear 1982), the force "
        "being common to both planes; both noises were taken from the residuals in corners and along sides. Side distances "
        "are normalised so that sum c_i n_i = 0. The tilt is the difference of the centres over the distance of the planes."
    )


def _errors() -> str:
    return (
        "Intervals hold 95 %: residual noise, widened for its correlation in time by the effective number of samples (Geyer 1992), "
        "and, added in squares, the stated gain errors of probes and load cells (type B), which scale all lengths, or all stiffnesses, alike."
    )
