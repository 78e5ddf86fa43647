"""Faults that only a fit shows (tpjb.md, section 8): drift, the shaft's line, a load that explains itself.

Each is named with its size; what is dealt with is a note, what is not a warning.
"""

from __future__ import annotations

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.tpjb.rotating.drift import drift_of
from pipeline.rigs.tpjb.rotating.group import LoadGroup
from pipeline.rigs.tpjb.rotating.linear_limit import MARGINAL
from pipeline.rigs.tpjb.rotating.noise import alias_line
from pipeline.rigs.tpjb.rotating.turns import Turns

# Runout of a shaft, m, beyond which a line at its alias cannot be what averaging left of it.
_MOST_RUNOUT = 60e-6


def faults_of_fit(group: LoadGroup) -> list[QualityFinding]:
    """Return what the fits of a group show of its runs."""
    found = [*group.findings, *drift_of(group), *_shaft_line(group)]
    for turns in group.runs:
        found += _load_harmonics(group, turns)
    return found


def _shaft_line(group: LoadGroup) -> list[QualityFinding]:
    """Say how large the shaft's line is, and doubt that one-second values are means where it is too large."""
    found, seen = [], []
    for turns in group.runs:
        orbit = turns.record.orbit
        residual = group.selected.paths[group.index[turns.run]].residual
        line = alias_line(orbit, residual)
        if line is None or orbit.shaft_frequency is None:
            continue
        amplitude, at = line
        if turns.record.notched is not None:
            amplitude = turns.record.notched
        left = abs(float(np.sinc(orbit.shaft_frequency * orbit.step)))
        if amplitude < 0.5 * float(np.sqrt((residual**2).mean())) or not left > 0:
            continue
        if amplitude / left > _MOST_RUNOUT and turns.record.averaged == 1:
            text = (
                f"a line of {1e6 * amplitude:.2g} um stands at {at:.3g} Hz, where sampling folds the shaft frequency: as what "
                f"averaging over {orbit.step:.3g} s leaves, the shaft's runout would be {1e6 * amplitude / left:.3g} um. Are "
                "the values samples, and not means? The line is left out of the noise of the coefficients."
            )
            found.append(QualityFinding("warning", text, turns.run))
        else:
            seen.append((turns.run, amplitude, at, amplitude / left))
    if seen:
        _, amplitude, at, runout = max(seen, key=lambda entry: entry[1])
        text = (
            f"{listing((run for run, *_ in seen), 8)}: a line of up to {1e6 * amplitude:.2g} um at {at:.3g} Hz is what is left "
            f"of the shaft's own {1e6 * runout:.2g} um once a turn; it does not count as noise of the coefficients."
        )
        found.append(QualityFinding("note", text, seen[0][0] if len(seen) == 1 else None))
    return found


def _load_harmonics(group: LoadGroup, turns: Turns) -> list[QualityFinding]:
    distortion = group.distortions.get(turns.run)
    if distortion is None or distortion.load < distortion.value / 3.0 or distortion.value < 3.0 * distortion.std_error:
        return []
    nonlinear = distortion.value > MARGINAL
    text = (
        f"the load itself has harmonics of {100 * distortion.load:.2g} %, more than a third of the THD of "
        f"{100 * distortion.value:.2g} %; what they explain is taken out"
        + (": the nonlinear verdict is weak." if nonlinear else ".")
    )
    return [QualityFinding("warning" if nonlinear else "note", text, turns.run, "force_u")]
