"""Mass and parallel stiffness of the stator: from a baseline campaign, else from the runs' conditions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Condition, QualityFinding, Recording


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
    """Return the stator's inertia for the runs of one operating point."""
    for campaign, found in uses.items():
        if found.experiment == "tpjb.baseline":
            given = _of_baseline(campaign, found)
            if given is not None:
                return given
    mass, stiffness = (_stated(recordings, name) for name in ("stator_mass", "stabilizer_stiffness"))
    noticed = []
    if mass is None:
        reason = (
            "'stator_mass' is not given, so that the inertia of the stator cannot be taken off the force. Give it as a "
            "condition, or 'uses: [CAMPAIGN]' with a campaign of tpjb.baseline"
        )
        return Inertia(None, 0.0, math.nan, math.nan, 0.0, reason)
    for name, values in (("stator_mass", mass), ("stabilizer_stiffness", stiffness)):
        if values is not None and np.ptp(values) > 1e-3 * abs(np.mean(values)):
            text = f"the runs of one operating point state {name} from {min(values):g} to {max(values):g}; the mean is used."
            noticed.append(QualityFinding("warning", text, recordings[0].run))
    if stiffness is None:
        text = "'stabilizer_stiffness' is not given and taken as none: stiffness comes out about 1 % high."
        noticed.append(QualityFinding("warning", text, recordings[0].run))
    return Inertia(
        float(np.mean(mass)),
        0.0 if stiffness is None else float(np.mean(stiffness)),
        math.nan,
        math.nan,
        0.0,
        "conditions of the runs, errors unknown",
        tuple(noticed),
    )


def _of_baseline(campaign: str, found: Findings) -> Inertia | None:
    mass = next((p for p in found.parameters if p.name == "stator_mass" and p.value is not None), None)
    stiffness = next((p for p in found.parameters if p.name == "stabilizer_stiffness" and p.value is not None), None)
    if mass is None or mass.value is None:
        return None
    table = found.arrays.get("covariance")
    correlation = float(table["correlation"].iloc[0]) if table is not None and len(table) else 0.0
    return Inertia(
        mass.value,
        stiffness.value if stiffness is not None and stiffness.value is not None else 0.0,
        mass.std_error if mass.std_error is not None else math.nan,
        stiffness.std_error if stiffness is not None and stiffness.std_error is not None else math.nan,
        correlation,
        f"campaign '{campaign}' (tpjb.baseline)",
    )


def _stated(recordings: Sequence[Recording], name: str) -> list[float] | None:
    values = [number for r in recordings if (number := _number(r.conditions.get(name))) is not None]
    return values or None


def _number(value: Condition | None) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def gain_error(recordings: Sequence[Recording]) -> float | None:
    """Return the relative standard error that all coefficients share: gains of probes and load cells; None if unknown."""
    shares = [_stated(recordings, name) for name in ("sensor_gain_u", "force_gain_u")]
    known = [max(values) for values in shares if values]
    return math.hypot(*known) if known else None
