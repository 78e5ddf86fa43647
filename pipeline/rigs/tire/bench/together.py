"""The runs of one tire together: rolling radius, calibration, ring and PVDF, one step after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.contradictions import (
    doubt_circuit,
    doubt_closure,
    doubt_shadow,
    look_for_mirrored,
    look_for_odd,
)
from pipeline.rigs.tire.bench.film_check import check_film
from pipeline.rigs.tire.bench.joint_fit import fit_rings
from pipeline.rigs.tire.bench.load_faults import hysteresis, shared_error
from pipeline.rigs.tire.bench.peaks_over_load import calibrate_peaks, nominal_loads, withdraw_doubtful
from pipeline.rigs.tire.bench.rolling import roll
from pipeline.rigs.tire.bench.same_tire import Tire
from pipeline.rigs.tire.passages.features import features
from pipeline.rigs.tire.ring.sensor import highest_order


def campaign_of(tire: Tire, runs: Sequence[BenchRun]) -> Campaign:
    """Identify what the runs of one tire give together."""
    found = Campaign(tire, list(runs))
    roll(found)
    order = highest_order(tire.length, found.radius)
    found.features = {run.name: features(run.waveform, found.radius, order) for run in runs}
    doubt_closure(found)
    doubt_shadow(found)
    look_for_odd(found)
    odd = {one.run for one in found.odd}
    even = [run for run in found.runs if run.name not in odd]
    _hold_against_loads_as_set(found, even)
    found.findings += [*hysteresis(even), *nominal_loads(found.runs)]
    look_for_mirrored(found)
    calibrate_peaks(found)
    fit_rings(found)
    doubt_circuit(found)
    if found.ring is not None or found.circuit_doubt:
        calibrate_peaks(found)
    withdraw_doubtful(found)
    check_film(found)
    return found


def _hold_against_loads_as_set(found: Campaign, runs: Sequence[BenchRun]) -> None:
    """Believe no load where all are off by one force; take them as so uncertain where they are off by one factor."""
    error = shared_error(runs)
    if error is None:
        return
    found.findings.append(error.finding)
    found.untared = error.finding.message if error.force else ""
    found.tire = replace(found.tire, load_gain_u=max(found.tire.load_gain_u, abs(error.share)))
