"""Where the standard errors come from: scatter of the data (type A) and what calibrations leave open (type B)."""

from __future__ import annotations

import math

from pipeline.findings import Findings, Parameter
from pipeline.report.numbers import plain
from pipeline.report.reading_units import reading_unit
from pipeline.report.words import clean
from pipeline.rigs.experiment import Experiment


def type_a(parameter: Parameter) -> float | None:
    """Return the part of the standard error that comes from scatter; None where there is no standard error."""
    if parameter.std_error is None:
        return None
    return math.sqrt(max(parameter.std_error**2 - (parameter.type_b or 0.0) ** 2, 0.0))


def stated(findings: Findings, experiment: Experiment) -> str:
    """Return what the recipe says of the channels' calibration and what was done with it, for readers and for a paper."""
    if not findings.calibration:
        more = " beyond what is told as type B" if any(p.type_b for p in findings.parameters) else ""
        return (
            f"The recipe states no uncertainty of the channels' calibration, so that none is in the intervals{more}: a gain or an "
            "offset that is off in all runs alike shifts the numbers unseen."
        )
    parts = []
    for name, entry in findings.calibration.items():
        of = []
        if entry.get("gain_u"):
            of.append(f"gain {plain(100 * entry['gain_u'], 3)} %")
        if entry.get("offset_u"):
            unit = reading_unit(experiment.unit_of(name) or "1", entry["offset_u"])
            of.append(f"offset {plain(entry['offset_u'] / unit.size, 3)} {unit.name}".rstrip())
        parts.append(f"{clean(name)} {' and '.join(of)}")
    return (
        f"Stated standard uncertainties (k = 1), common to all runs: {'; '.join(parts)}. The campaign was identified again "
        "with each of them one standard uncertainty high and low; the intervals hold both types. Bands and errors that "
        "the evidence shows beside the parameters, and comparisons and judgements made with them, are of type A."
    )
