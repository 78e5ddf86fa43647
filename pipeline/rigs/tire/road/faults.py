"""What is wrong with a drive, in plain words: what its passages, its tracks and its reference channels tell (tire.md, 8).

What the transmitter's log alone tells stands in `passages.passage_faults`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.errors import counted
from pipeline.recording import QualityFinding
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.tire.road.gain_off import WITHHELD
from pipeline.rigs.tire.road.revolution_fit import OTHER_GAIN, REASONS
from pipeline.rigs.tire.road.run_numbers import REVERSED, RunNumbers

# A larger share of passages that tell nothing is a warning.
_MANY_LOST = 0.2
# Loads beyond this multiple of the bench's highest, below this of its least: the ring is carried far.
FAR_ABOVE, FAR_BELOW = 1.5, 0.5
# R0 differs from the bench's, or within the drive, by more than this: warmer or colder.
_WARMER = 0.01
# Flex over film differs from the bench's: more than both fits leave open.
OTHER_RATIO = 0.05
# The waveform's scatter about the model over the drive's own noise: from here on the model does not fit.
_MISFIT = 2.0
# Reasons to leave a revolution out that lie in its waveform.
_OF_THE_SHAPE = (0, 2, 3, 4)
# Mean NIS within which a track's errors are right to a few per cent, whatever a test of thousands of revolutions says.
_CALM = (0.8, 1.25)
# A mean difference to the reference beyond so many standard deviations, and this share of the load.
_BIAS_SD, _BIAS_SHARE = 2.5, 0.01


def faults_of(run: RunNumbers) -> list[QualityFinding]:
    """Return what is to be said of one drive, besides what its log alone tells."""
    found = [*_lost(run), *_bonding(run), *_direction(run), *_units(run), *_clocks(run)]
    if run.has_forces:
        found += [*_range(run), *_misfit(run), *_shape(run), *_resistance(run), *_tracks(run), *_biases(run)]
    return found


def _warning(run: RunNumbers, text: str, channel: str | None = None) -> QualityFinding:
    return QualityFinding("warning", text, run.run, channel)


def _note(run: RunNumbers, text: str, channel: str | None = None) -> QualityFinding:
    return QualityFinding("note", text, run.run, channel)


def _lost(run: RunNumbers) -> Iterator[QualityFinding]:
    m, lost = len(run.forces), run.passages_lost
    if not lost:
        return
    why = ""
    if run.has_forces:
        reasons = run.forces.reason[~run.forces.fits]
        counts = np.bincount(reasons, minlength=len(REASONS))
        told = [f"{REASONS[place]}: {counts[place]}" for place in np.argsort(-counts) if place and counts[place]]
        why = f" ({'; '.join(told[:4])})" if told else ""
    share = lost / m
    text = f"{counted(lost, 'passage')} of {m} ({100 * share:.1f} %) give no number{why}; the tracks are predicted through them."
    if share > _MANY_LOST:
        yield _warning(run, f"{text} The radio's shadow behind the rim, or a sensor that comes off?")
    else:
        yield _note(run, text)


def _bonding(run: RunNumbers) -> Iterator[QualityFinding]:
    if run.bonding is None:
        return
    step = run.came_off
    if step is not None:
        text = (
            f"the flex sensor's amplitude fell by {100.0 * (1.0 - step.share):.0f} % against the PVDF film's at t = {step.time:.2f} s: "
            "debonding or a cracked sensor. Loads and forces from then on are withheld; glue the sensor anew and calibrate it again."
        )
        yield QualityFinding("warning", text, run.run, "flex_code", (step.time, run.device.span[1]))
    elif not run.bonding.ok:
        yield _warning(run, f"flex sensor and PVDF film do not keep their ratio: {run.bonding.verdict}.")
    lost = run.forces.reason == OTHER_GAIN
    if run.has_forces and step is None and lost.any():
        since = float(run.forces.time[np.argmax(lost)])
        text = (
            f"the flex sensor's answer falls against the PVDF film's, at t = {since:.1f} s it is {100.0 * WITHHELD:.0f} % below that on "
            f"the bench: debonding, or a gain that drifts. Load and force are withheld where it is ({counted(int(lost.sum()), 'revolution')}), "
            "and carry it in their errors before."
        )
        yield QualityFinding("warning", text, run.run, "flex_code", (since, run.device.span[1]))
    off = run.bonding.mean - 1.0
    if (
        run.has_forces
        and math.isfinite(off)
        and run.carried.tire
        and run.carried.tire.bench.film
        and abs(off) > OTHER_RATIO
    ):
        yield _warning(
            run,
            f"the flex sensor answers {100.0 * off:+.0f} % against the PVDF film compared with the bench: a gain changed since then, and "
            "load and force with it; their errors hold it.",
        )


def _direction(run: RunNumbers) -> Iterator[QualityFinding]:
    if run.reversed:
        yield _warning(run, f"{REVERSED}. Longitudinal force is withheld.")


def _units(run: RunNumbers) -> Iterator[QualityFinding]:
    compared = run.comparison
    if compared is not None and compared.speed_unit not in ("m/s", ""):
        yield _warning(
            run,
            f"speed unit: the reference speed over the rotation looks like {compared.speed_unit}, not m/s; it is not compared. "
            "State the unit of that channel in the recipe.",
            "vehicle_speed",
        )
    if compared is None:
        return
    wrong = compared.load_unit not in ("N", "")
    for remark in compared.remarks:
        yield (_warning if (wrong and "looks like" in remark) or not compared.follows else _note)(run, remark)


def _clocks(run: RunNumbers) -> Iterator[QualityFinding]:
    compared = run.comparison
    if compared is None:
        return
    if compared.offset_applied:
        yield _note(
            run,
            f"the clocks of transmitter and vehicle are {compared.offset:+.3f} s apart (standard error {compared.offset_se:.3f} s); the "
            "reference channels are shifted by that. Start both loggers from one signal.",
        )
    elif run.clocks_unsure:
        yield _warning(
            run,
            f"the clocks of transmitter and vehicle seem {compared.offset:+.2f} s apart, but {compared.offset_verdict}: the reference "
            "channels are not shifted, and load and force not held against them.",
        )


def _range(run: RunNumbers) -> Iterator[QualityFinding]:
    tire = run.carried.tire
    loads = run.forces.load[run.forces.fits]
    if tire is None or not loads.size:
        return
    least, most = tire.bench.loads
    low, high = np.percentile(loads, [5.0, 95.0])
    if high > FAR_ABOVE * most or low < FAR_BELOW * least:
        yield _warning(
            run,
            f"loads from {low:.0f} to {high:.0f} N lie far outside the bench's {least:.0f} to {most:.0f} N: the ring model is carried "
            "where nothing was measured. Calibrate up to the loads of the road.",
        )


def _misfit(run: RunNumbers) -> Iterator[QualityFinding]:
    fits = run.forces.fits
    misfit = float(np.nanmedian(run.forces.misfit)) if np.isfinite(run.forces.misfit).any() else math.nan
    fits = fits[np.isin(run.forces.reason, _OF_THE_SHAPE)]
    if misfit > _MISFIT or (fits.size and fits.mean() < 0.5):
        told = f"they miss by {times_noise(misfit)}" if math.isfinite(misfit) else "no revolution fits"
        yield _warning(
            run,
            f"the waveforms are not those of the bench's ring ({told}, {100 * fits.mean():.0f} % of the revolutions fit): another "
            "pressure or tire than stated, a sensor that comes off, or a road that is not flat under the patch.",
        )


def _shape(run: RunNumbers) -> Iterator[QualityFinding]:
    shape, pressure, tire = run.shape_error, run.causes.pressure, run.carried.tire
    if shape is None or tire is None:
        return
    if pressure is not None and tire.bench.pressure is not None:
        stated = tire.pressure_ratio * tire.bench.pressure
        yield _warning(
            run,
            f"the waveform is that of a tire at p0 = {stated * math.exp(pressure.change) / 1e5:.2f} bar, not at the {stated / 1e5:.2f} bar "
            f"stated: loads read {pressure.load:+.0f} N off by that, and their errors hold it. State the pressure of the drive.",
            "inflation_pressure",
        )
    elif shape.matters:
        yield _warning(
            run,
            f"the bench's ring leaves {100.0 * shape.share:.1f} % of the mean waveform unexplained ({100.0 * shape.share_se:.1f} % would be "
            "noise): another tire, pressure or sensor than on the bench, or a tire that is no such ring. The errors of load and force hold "
            "it; a difference that leaves the shape as it is would not show here.",
        )


def _resistance(run: RunNumbers) -> Iterator[QualityFinding]:
    tire, resistance = run.carried.tire, run.forces.resistance[run.forces.fits]
    if tire is None or tire.bench.resistance is None or not resistance.size:
        return
    R0 = float(np.median(resistance))
    off = R0 / tire.bench.resistance - 1.0
    low, high = np.percentile(resistance, [2.5, 97.5])
    gain = f"a gain that drifts along is not, and would shift the load by {run.common.gain_to_load:.0f} N per 1 %."
    if abs(off) > _WARMER:
        yield _warning(
            run,
            f"R0 is {R0:.5g} ohm here and {tire.bench.resistance:.5g} ohm on the bench ({100 * off:+.1f} %): temperature? R0 is taken out "
            f"of every revolution; {gain}",
        )
    if high - low > _WARMER * R0:
        yield _warning(run, f"R0 drifts by {100 * (high - low) / R0:.1f} % within the drive: R0 drift removed; {gain}")


def _tracks(run: RunNumbers) -> Iterator[QualityFinding]:
    for name, words in (("load", "load"), ("force", "longitudinal force"), ("rotation", "rotation")):
        track = run.tracks.get(name)
        if track is None:
            continue
        if not track.consistent and not _CALM[0] < track.mean_nis < _CALM[1]:
            # Errors that are too large mislead nobody.
            yield (_warning if track.mean_nis > 1.0 else _note)(
                run, f"the filter of the {words} is not consistent with its innovations: {track.verdict}"
            )
        gated = int(np.count_nonzero(track.gated))
        if gated > max(3, 0.02 * len(run.forces)):
            yield _note(
                run,
                f"{counted(gated, 'revolution')} of the {words} stand off by more than the gate (NIS > 10.8) and are left out of its track.",
            )


def _biases(run: RunNumbers) -> Iterator[QualityFinding]:
    """Tell of a mean difference to a reference that the stated uncertainties do not explain."""
    compared = run.comparison
    if compared is None or run.reversed or run.clocks_unsure:
        return
    loads = run.forces.load[run.forces.fits]
    if not loads.size:
        return
    typical = float(np.median(loads))
    for bias, common, channel, floor in (
        (compared.load_bias, run.common.load_sd, "vertical_load", _BIAS_SHARE * typical),
        (compared.force_bias, run.common.force_sd, "longitudinal_force", _BIAS_SHARE * typical),
    ):
        known = common[np.isfinite(common)]
        spread = math.hypot(float(np.median(known)) if known.size else 0.0, floor)
        if bias is not None and math.isfinite(bias) and abs(bias) > _BIAS_SD * spread:
            yield _warning(
                run,
                f"the mean difference to {channel} is {bias:+.0f} N, more than bench and pressure leave uncertain ({spread:.0f} N): "
                "pressure, temperature, gain of the sensor or zero of the reference changed since the bench.",
                channel,
            )
