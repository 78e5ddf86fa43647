"""The PVDF check of a campaign: which runs enter it, and which one contradicts all others."""

from __future__ import annotations

import math

from pipeline.errors import InputError
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.pvdf_fit import FilmFit, FilmRun, fit_film, quiet_error
from pipeline.rigs.tire.bench.ring_run import noise_error

_FEWEST_LEFT = 3
# The film's voltage grows with the speed: a run whose rotation scatters by more (relative) has no one law.
_UNSTEADY = 0.05


def check_film(found: Campaign) -> None:
    """Fit the PVDF's rate model on all runs whose flex sensor is sound."""
    tire = found.tire
    unsound = {one.run for one in found.odd if one.cause == "film"} | set(found.doubted) | found.misfit
    unsound |= {run.name for run in found.runs if run.waveform.speed_scatter > _UNSTEADY}
    runs = [
        FilmRun(
            run.name,
            wave.speed,
            wave.mean,
            noise_error(wave.theta, wave.mean, wave.groups, wave.std_error),
            wave.film,
            quiet_error(wave.film, wave.film_se),
        )
        for run in found.runs
        if (wave := run.waveform).film is not None and wave.film_se is not None and run.name not in unsound
    ]
    if not runs:
        why = next(iter(found.doubted.values()), "")
        found.no_film = "no run has a PVDF signal that can be used" + (f" beside its flex sensor: {why}" if why else "")
        return
    if tire.film_length is None or tire.sensor_length is None:
        found.no_film = "the lengths of both sensors are needed: state sensor_length_flex and sensor_length_pvdf"
        return
    try:
        found.film = _film_of(runs, found)
    except InputError as error:
        found.no_film = str(error)
        return
    worst = max(found.film.runs, key=lambda run: run.nrmse).run
    if found.film.verdict != "bad" or len(found.film.runs) <= _FEWEST_LEFT:
        return
    others = _film_of([run for run in runs if run.run != worst], found)
    if others.verdict != "bad":
        found.film = others
        found.unbonded.add(worst)
        text = (
            "flex and PVDF contradict each other in this run and in no other: channels swapped, a bond that yields, or the log runs backward. "
            "It does not enter the PVDF check"
        )
        found.findings.append(QualityFinding("warning", text, worst, "pvdf_code"))


def _film_of(runs: list[FilmRun], found: Campaign) -> FilmFit:
    tire = found.tire
    known = found.ring is not None and found.verdict is not None and found.verdict.fits
    ring = found.ring if known else None
    values = ring.values if ring is not None else None
    return fit_film(
        runs,
        film_length=tire.film_length or math.nan,
        flex_length=values.sensor_length if values is not None else tire.length,
        R=found.radius,
        flex_lag=values.sensor_lag if values is not None else None,
        film_length_u=tire.sensor_length_u,
        flex_length_u=ring.std_error("sensor_length") / ring.values.sensor_length if ring else tire.sensor_length_u,
    )
