"""The ring fit of a campaign: which runs enter it, and which one is at fault where only one does not fit."""

from __future__ import annotations

import math

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.reference import HEIGHT, LOAD
from pipeline.rigs.tire.bench.ring_fit import fit_ring
from pipeline.rigs.tire.bench.ring_run import Known, RingRun, noise_error
from pipeline.rigs.tire.bench.ring_verdict import judged
from pipeline.rigs.tire.bench.same_tire import Tire, pressure_of

# One run in so many may be at fault where the ring does not fit; the others must be more than that.
_MOST_OUT, _FEWEST_LEFT = 4, 3
_ALONE = 4.0
_OPEN = 0.9


def fit_rings(found: Campaign) -> None:
    """Fit the ring to all runs with a load, each at its own pressure."""
    tire = found.tire
    if found.untared:
        found.no_ring = found.untared
        return
    if tire.sensor_length is None:
        found.no_ring = "sensor_length_flex is not stated, and it trades with the contact length"
        return
    runs = []
    for run in found.runs:
        if run.name in found.unfitted:
            continue
        if not math.isfinite(run.load) or run.load <= 0.0:
            found.unfitted[run.name] = "its load is not known"
        else:
            runs.append(_ring_run(run, tire, found.friction.get(run.name, 0.0)))
    if not runs:
        found.no_ring = (
            f"no run has a load and a waveform that can be used ({listing(dict.fromkeys(found.unfitted.values()), 3)})"
        )
        return
    known = Known(
        R=found.radius,
        R_u=found.radius_u,
        Ro=found.free_radius,
        sensor_length=tire.sensor_length,
        sensor_length_u=tire.sensor_length_u,
        belt_width=tire.belt_width,
        pressure_u=tire.pressure_u,
        load_gain_u=tire.load_gain_u,
        outer_radius_u=found.free_radius_u,
        loads_set=any(LOAD not in found.run(run.run).reference.means for run in runs),
    )
    try:
        found.ring = fit_ring(runs, known)
    except InputError as error:
        found.no_ring = str(error)
        return
    found.verdict = judged(found.ring)
    if not found.verdict.fits:
        _without_the_worst(found, runs, known)
    _scattered(found, runs, known)
    found.unfitted.update(found.ring.left_out)


def _without_the_worst(found: Campaign, runs: list[RingRun], known: Known) -> None:
    """Look whether the model fits once a run or two are taken out: then those are at fault and not the model."""
    left, ring = runs, found.ring
    if ring is None or not _stands_alone([run.band_chi2_reduced for run in ring.runs]):
        return
    out: list[str] = []
    while ring is not None and len(out) < max(len(runs) // _MOST_OUT, 1) and len(left) > _FEWEST_LEFT:
        worst = max(ring.runs, key=lambda run: run.band_chi2_reduced).run
        out.append(worst)
        left = [run for run in left if run.run != worst]
        ring = fit_ring(left, known, near=ring.values)
        verdict = judged(ring)
        if verdict.fits:
            found.ring, found.verdict = ring, verdict
            for name in out:
                text = "the ring that fits all other runs does not fit this one: creep or bond of the sensor, load or pressure are not what is stated"
                found.unfitted[name] = found.uncalibrated[name] = text
                found.misfit.add(name)
                found.findings.append(
                    QualityFinding("warning", f"{text}. The run is in neither ring fit nor calibration", name)
                )
            return


def _scattered(found: Campaign, runs: list[RingRun], known: Known) -> None:
    """Let load, gain and pressure differ from run to run where that explains what noise does not."""
    if found.ring is None:
        return
    used = {run.run for run in found.ring.runs}
    ring = fit_ring([run for run in runs if run.run in used], known, near=found.ring.values, scattered=True)
    verdict = judged(ring)
    if ring.scatter.size > 0.0 and verdict.fits:
        found.ring, found.verdict = ring, verdict


def _stands_alone(misfits: list[float]) -> bool:
    """Tell whether one run fits much worse than the others do."""
    return len(misfits) > _FEWEST_LEFT and max(misfits) > _ALONE * float(np.median(misfits))


def _ring_run(run: BenchRun, tire: Tire, friction: float) -> RingRun:
    height = HEIGHT in run.reference.means
    wave = run.waveform
    # Angles that a gated log holds in some revolutions only are those where noise opened the gate.
    recorded = wave.count > _OPEN * np.median(wave.count[wave.count > 0])
    gated = not math.isfinite(wave.level)
    return RingRun(
        run=run.name,
        theta=wave.theta,
        resistance=np.where(recorded, wave.mean, math.nan) if gated else wave.mean,
        std_error=noise_error(wave.theta, wave.mean, wave.groups, wave.std_error),
        load=run.load - friction,
        load_se=run.load_se,
        rotation=wave.speed,
        pressure=pressure_of(run, tire),
        nominal_load=run.nominal_load,
        nominal_speed=run.nominal_speed,
        hub_height=run.reference.value(HEIGHT) if height else None,
        hub_height_se=run.reference.std_error(HEIGHT) if height else None,
    )
