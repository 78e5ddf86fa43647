"""What the runs of a campaign say against each other and against the closed belt: which of them are not believed."""

from __future__ import annotations

import math

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.outliers import Marks, odd_runs
from pipeline.rigs.tire.bench.reference import LOAD
from pipeline.rigs.tire.bench.same_tire import at_usual_pressure, in_words, were
from pipeline.rigs.tire.conditions import DIVIDER
from pipeline.rigs.tire.passages.features import Features
from pipeline.rigs.tire.passages.passage_faults import FIRST_HARMONIC

# Asymmetry of the dips in standard errors and over the peak, from which on it is told.
_SURE, _LOPSIDED = 5.0, 0.003
# First harmonic over the peak that speaks against the divider's law where the ring does not fit either: sound logs have 1e-4.
_CLOSED = 0.003
# Neighbouring angles of 1024 that no revolution has.
_SHADOW = 3


def doubt_closure(found: Campaign) -> None:
    """Set aside runs whose R2 has a first harmonic: the bending of a closed belt has none (tire.md, 3.1)."""
    text = (
        f"first harmonic of R2 is more than {FIRST_HARMONIC:.0%} of the peak, not explicable by ring bending: an artefact once per revolution, or a wrong "
        "divider_resistance, supply_voltage or adc_reference"
    )
    for run in found.runs:
        if _first_harmonic(run) > FIRST_HARMONIC:
            found.doubted[run.name] = found.uncalibrated[run.name] = found.unfitted[run.name] = text


def doubt_shadow(found: Campaign) -> None:
    """Set aside what is read off waveforms that lack the same angles in every revolution, though the log is not gated."""
    for run in found.runs:
        lost = run.waveform.count == 0
        if not math.isfinite(run.waveform.level) or lost.sum() < _SHADOW or run.name in found.doubted:
            continue
        angles = np.degrees(run.waveform.theta[lost])
        text = (
            f"radio shadow: {lost.mean():.1%} of the angles, from {angles.min():.0f} to {angles.max():.0f} deg after the peak, are lost in every revolution. "
            "What is read off the waveform there is not told. Turn the antenna or the receiver, or write to the SD card"
        )
        found.doubted[run.name] = found.uncalibrated[run.name] = text
        found.findings.append(QualityFinding("warning", text, run.name, "packet_counter"))


def _first_harmonic(run: BenchRun) -> float:
    """Return the first harmonic of R2 over the peak; 0 where part of the revolution is not recorded."""
    return float(np.median(run.course.first_harmonic)) if math.isfinite(run.waveform.level) else 0.0


def look_for_odd(found: Campaign) -> None:
    """Leave out of calibration and ring fit what the other runs contradict."""
    marks = [
        _marks(run, found.features[run.name])
        for run in found.runs
        if at_usual_pressure(run, found.tire) and run.name not in found.doubted
    ]
    found.odd = odd_runs(marks)
    for one in found.odd:
        if one.cause == "film":
            found.findings.append(QualityFinding("warning", one.text, one.run, "pvdf_code"))
            continue
        found.uncalibrated[one.run] = found.unfitted[one.run] = one.text
        if one.cause in ("sensor", "unknown"):
            found.doubted[one.run] = one.text
        channel = "flex_code" if one.cause == "sensor" else LOAD
        text = f"{one.text}. The run is in neither calibration nor ring fit"
        found.findings.append(QualityFinding("warning", text, one.run, channel))


def doubt_circuit(found: Campaign) -> None:
    """Believe no R2 at all where the ring does not fit and the divider is assumed, or contradicted by the closed belt."""
    if found.verdict is None or found.verdict.fits:
        return
    harmonic = float(np.median([_first_harmonic(run) for run in found.runs]))
    divider = [name for name in DIVIDER if name in found.tire.assumed]
    if divider:
        why = f"{in_words({name: found.tire.assumed[name] for name in divider})} {were(divider)} assumed, and the ring model does not fit: R2 may be wrong"
    elif harmonic > _CLOSED:
        why = (
            f"R2 has a first harmonic of {harmonic:.1%} of its peak, which a closed belt has not, and the ring model does not fit: divider_resistance, "
            "supply_voltage or adc_reference are not as stated, or an artefact comes once per revolution"
        )
    else:
        return
    found.circuit_doubt = why
    for run in found.runs:
        found.doubted.setdefault(run.name, why)
        found.uncalibrated.setdefault(run.name, why)


def _marks(run: BenchRun, marks: Features) -> Marks:
    film = run.waveform.film
    swing = float(np.nanmax(film) - np.nanmin(film)) if film is not None and np.isfinite(film).any() else math.nan
    return Marks(run.name, run.load, run.rotation, marks.value.peak + run.lift, swing, marks.value.deformation)


def look_for_mirrored(found: Campaign) -> None:
    """Tell of runs whose dip is deeper behind the patch: a tire's loss makes the one before it deeper in free rolling."""
    for run in found.runs:
        marks = found.features[run.name]
        asymmetry, error = marks.value.asymmetry, marks.asymmetry_error
        if asymmetry < -_SURE * error and asymmetry < -_LOPSIDED * marks.value.peak:
            text = (
                f"rotation sense reversed, or the wheel is driven: the trailing dip is {-asymmetry:.0f} ohm deeper than the leading one, and in free rolling the "
                "loss of the tire makes the leading one deeper. Look at the sense of rotation and the order of time"
            )
            found.mirrored[run.name] = text
            found.findings.append(QualityFinding("warning", text, run.name))
