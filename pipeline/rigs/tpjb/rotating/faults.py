"""Faults of one run that its signals show before any law is fitted (tpjb.md, section 8), and `check` for one log.

Each is named with size and what to do. What only a fit shows is in `fit_faults`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.harmonics import circularity
from pipeline.rigs.tpjb.rotating.orientation import orientation_of, unit_findings
from pipeline.rigs.tpjb.rotating.record import Record, record_of
from pipeline.rigs.tpjb.rotating.turns import Turns, turns_of

POOR_LOAD = 0.02
_PITCHING = 0.05
_WRONG_STATE = 0.02
_OTHER_SIZES = 0.3


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Return what one log shows: probes, directions, units, state, and how the load turns.

    Raises
    ------
    InputError
        If the log cannot be used at all: another test, no sound probe, a load that does not turn.
    """
    settings = RotatingSettings()
    record = record_of(recording, settings)
    mend = orientation_of(record)
    turns = turns_of(record if mend.mend is None else record.mapped(mend.mend), settings)
    return (*record.findings, *mend.findings, *unit_findings(turns.record), *faults_of(turns))


def faults_of(turns: Turns) -> list[QualityFinding]:
    """Return what a run shows by itself, its axes already mended."""
    record = turns.record
    found = [*_state(record), *_pitching(turns), *_other_sizes(record)]
    if turns.refusal:
        found.append(QualityFinding("warning", f"{turns.refusal}.", record.run))
    if turns.load is not None and circularity(turns.load) > POOR_LOAD:
        text = (
            f"the load is not circular: its backward turning part is {100 * circularity(turns.load):.2g} % of the forward "
            f"one (above {100 * POOR_LOAD:g} %). Load control is poor; the fits use the load as measured, the verdict on "
            "nonlinearity is weak."
        )
        found.append(QualityFinding("warning", text, record.run, "force_u"))
    if not record.rotation.has_dwell:
        text = (
            "there is no stretch without force: the static equilibrium is not seen, and combinations of quadratic terms "
            "that only shift the mean position are weak. Hold 60 s at zero force before and after the turns."
        )
        found.append(QualityFinding("note", text, record.run))
    return found


def _state(record: Record) -> list[QualityFinding]:
    """Compare speed and static load with what the run is labelled as."""
    found = []
    if record.orbit.shaft_frequency is None:
        text = (
            "the shaft speed is not given (neither 'speed' nor 'shaft_speed_nominal'): the operating point lacks it, and the "
            "shaft's own line is not looked for."
        )
        found.append(QualityFinding("note", text, record.run))
    nominal = record.conditions.get("shaft_speed_nominal")
    if record.speed is not None and isinstance(nominal, int | float) and nominal > 0:
        off = record.speed / nominal - 1.0
        if abs(off) > _WRONG_STATE:
            per = 30.0 / math.pi
            text = (
                f"the shaft turns at {record.speed * per:.5g} rpm, {100 * off:+.2g} % off the {nominal * per:.5g} rpm of the "
                "label: wrong state of the test, or wrong unit of speed. Coefficients hold for the measured speed."
            )
            found.append(QualityFinding("warning", text, record.run, "speed"))
    labelled = record.conditions.get("static_load")
    if record.static_measured is not None and isinstance(labelled, int | float) and labelled > 0:
        off = record.static_measured / labelled - 1.0
        if abs(off) > _WRONG_STATE:
            text = (
                f"force_static is {record.static_measured:.5g} N on average, {100 * off:+.2g} % off the label "
                f"({labelled:.5g} N): wrong state of the test, or wrong unit. The label is used."
            )
            found.append(QualityFinding("warning", text, record.run, "force_static"))
    return found


def _pitching(turns: Turns) -> list[QualityFinding]:
    """Compare the planes: a stator that pitches has no one displacement."""
    planes = turns.record.planes
    if len(planes) < 2:
        return []
    steady = turns.record.rotation.steady
    first, second = (plane[:, steady] - plane[:, steady].mean(axis=1, keepdims=True) for plane in planes.values())
    apart = float(np.sqrt(np.mean((second - first) ** 2)))
    moved = float(np.sqrt(np.mean((0.5 * (first + second)) ** 2)))
    # What is not noise repeats with the load; noise of the probes alone is no pitching.
    coherent = _repeating(turns, second - first)
    if not moved > 0 or coherent < _PITCHING * moved:
        return []
    text = (
        f"the probe planes move differently by {100 * coherent / moved:.2g} % of the orbit ({1e6 * apart:.2g} um rms): "
        "pitching motion: stabilizers? The middle plane is interpolated; the film thickness varies along the bearing."
    )
    return [QualityFinding("warning", text, turns.run)]


def _repeating(turns: Turns, signal: np.ndarray) -> float:
    """Return the rms of the part of a signal, shape (2, n), that turns once with the load."""
    time = turns.steady.time
    turning = np.exp(-2j * np.pi * turns.record.rotation.frequency * time)
    return float(np.sqrt((np.abs(2.0 * (signal @ turning) / time.size) ** 2).sum() / 4.0))


def _other_sizes(record: Record) -> list[QualityFinding]:
    size = np.hypot(*record.orbit.force) / record.rotation.size
    other = ~record.rotation.steady & (size > 0.1)
    share = float(other.mean())
    if share < _OTHER_SIZES:
        return []
    text = (
        f"{100 * share:.2g} % of the log hold a load of another size than {record.rotation.size:.4g} N: harmonics are those "
        "of the longest stretch of even size; the models are fitted to all of it."
    )
    return [QualityFinding("note", text, record.run)]
