"""Mass and parallel stiffness of the stator: from a baseline campaign, else from the runs' conditions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings, Parameter
from pipeline.recording import Condition, Level, QualityFinding, Recording
from pipeline.rigs.tpjb.gains import type_a

_BASELINE = "tpjb.baseline"
# Relative errors that a stated mass and a stated stiffness may have at least.
_WEIGHED, _STATED = 1e-3, 0.05


@dataclass(frozen=True)
class Inertia:
    """m_s (kg) and k_s (N/m) with standard errors and correlation; an error is NaN where it is unknown.

    `mass` is None where nothing gives it; `source` is the reason then.
    """

    mass: float | None
    stiffness: float
    mass_error: float
    stiffness_error: float
    correlation: float
    source: str
    findings: tuple[QualityFinding, ...] = ()

    def error_at(self, w: np.ndarray) -> np.ndarray:
        """Return the standard error of m_s - k_s/w^2, kg, at w (rad/s); what is unknown counts nothing."""
        m = 0.0 if math.isnan(self.mass_error) else self.mass_error
        k = (0.0 if math.isnan(self.stiffness_error) else self.stiffness_error) / w**2
        return np.sqrt(np.maximum(m**2 + k**2 - 2 * self.correlation * m * k, 0.0))


def inertia_of(recordings: Sequence[Recording], uses: Mapping[str, Findings]) -> Inertia:
    """Return the stator's inertia for the runs of one operating point.

    A usable baseline campaign goes before what the runs state; where they differ that is said. What was
    handed over and is not used is said, too.
    """
    noticed: list[QualityFinding] = []
    taken = ""
    for campaign, found in uses.items():
        reason = f"'{taken}' is used already" if taken and found.experiment == _BASELINE else _unusable(found)
        if not reason:
            taken = campaign
            continue
        level: Level = "warning" if found.experiment == _BASELINE and not taken else "note"
        text = f"campaign '{campaign}' ({found.experiment}) was handed over and is not used: {reason}."
        noticed.append(QualityFinding(level, text))
    if taken:
        return _of_baseline(taken, uses[taken], recordings, noticed)
    mass = _stated(recordings, "stator_mass")
    if mass is None:
        why = f" {noticed[0].message}" if noticed else ""
        reason = (
            "'stator_mass' is not given, so that the inertia of the stator cannot be taken off the force. Give it as a "
            f"condition, or 'uses: [CAMPAIGN]' with a campaign of tpjb.baseline.{why}"
        )
        return Inertia(None, 0.0, math.nan, math.nan, 0.0, reason, tuple(noticed))
    stiffness = _stated_stiffness(recordings, noticed)
    _varying(recordings, noticed, stator_mass=mass)
    return Inertia(
        float(np.mean(mass)),
        stiffness,
        math.nan,
        math.nan,
        0.0,
        "conditions of the runs, errors unknown",
        tuple(noticed),
    )


def _unusable(found: Findings) -> str:
    """Return why findings tell nothing of the stator's inertia; '' where they do."""
    if found.experiment != _BASELINE:
        return "of other experiments the dynamic test takes the stator's mass and stiffness from tpjb.baseline only"
    if found.verdict == "rejected":
        return f"its verdict is rejected ({' '.join(found.reasons[:1]) or 'no reason given'})".replace(".)", ")")
    masses = found.find("stator_mass")
    if not any(p.value is not None for p in masses):
        return f"it gives no mass ({masses[0].description if masses else 'no parameter stator_mass'})".replace(
            ".)", ")"
        )
    return ""


def _of_baseline(
    campaign: str, found: Findings, recordings: Sequence[Recording], noticed: list[QualityFinding]
) -> Inertia:
    mass = next(p for p in found.find("stator_mass") if p.value is not None)
    stiffness = next((p for p in found.find("stabilizer_stiffness") if p.value is not None), None)
    assert mass.value is not None
    if found.verdict != "ok":
        text = (
            f"campaign '{campaign}' (tpjb.baseline), which gives the stator's mass, has the verdict {found.verdict}: "
        )
        noticed.append(QualityFinding("warning", text + " ".join(found.reasons[-2:])))
    for parameter, slack, unit, scale in ((mass, _WEIGHED, "kg", 1.0), (stiffness, _STATED, "MN/m", 1e-6)):
        stated = _stated(recordings, parameter.name) if parameter is not None else None
        if parameter is None or parameter.value is None or stated is None:
            continue
        sd = parameter.std_error or 0.0  # with type B: the mass was weighed by another scale
        apart = abs(parameter.value - float(np.mean(stated)))
        level: Level = "warning" if apart > 2 * sd + slack * abs(parameter.value) else "note"
        text = (
            f"{parameter.name}: the runs state {scale * float(np.mean(stated)):.5g} {unit}, campaign '{campaign}' found "
            f"{scale * parameter.value:.5g} ± {scale * 2 * sd:.2g} {unit}; the latter is used"
        )
        mend = ". They differ by more than their errors: mend one of them." if level == "warning" else "."
        noticed.append(QualityFinding(level, text + mend))
    bearings = [
        {str(b) for b in held if b}
        for held in (
            [r.conditions.get("bearing") for r in found.runs],
            [r.conditions.get("bearing") for r in recordings],
        )
    ]
    if all(bearings) and not bearings[0] & bearings[1]:
        text = f"campaign '{campaign}' weighed the stator with bearing {listing(bearings[0])}, these runs hold {listing(bearings[1])}."
        noticed.append(QualityFinding("warning", text))
    table = found.arrays.get("covariance")
    correlation = float(table["correlation"].iloc[0]) if table is not None and len(table) else 0.0
    known = stiffness is not None and stiffness.value is not None
    return Inertia(
        mass.value,
        float(stiffness.value)
        if stiffness is not None and stiffness.value is not None
        else _stated_stiffness(recordings, noticed),
        _error(mass),
        _error(stiffness) if known and stiffness is not None else math.nan,
        correlation,
        f"campaign '{campaign}' (tpjb.baseline)",
        tuple(noticed),
    )


def _error(parameter: Parameter) -> float:
    """Return the error that reaches the film's force: the load cells weigh stator and film, so their gain does not."""
    error = type_a(parameter)
    return math.nan if error is None else error


def _stated_stiffness(recordings: Sequence[Recording], noticed: list[QualityFinding]) -> float:
    stiffness = _stated(recordings, "stabilizer_stiffness")
    if stiffness is None:
        text = "'stabilizer_stiffness' is not given and taken as none: stiffness comes out about 1 % high."
        noticed.append(QualityFinding("warning", text, recordings[0].run))
        return 0.0
    _varying(recordings, noticed, stabilizer_stiffness=stiffness)
    return float(np.mean(stiffness))


def _varying(recordings: Sequence[Recording], noticed: list[QualityFinding], **stated: list[float]) -> None:
    for name, values in stated.items():
        if np.ptp(values) > 1e-3 * abs(np.mean(values)):
            text = f"the runs of one operating point state {name} from {min(values):g} to {max(values):g}; the mean is used."
            noticed.append(QualityFinding("warning", text, recordings[0].run))


def _stated(recordings: Sequence[Recording], name: str) -> list[float] | None:
    values = [number for r in recordings if (number := _number(r.conditions.get(name))) is not None]
    return values or None


def _number(value: Condition | None) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
