"""What is wrong with a run as its device's log alone can tell (tire.md, section 8). References are compared elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from pipeline.errors import counted
from pipeline.recording import QualityFinding
from pipeline.rigs.tire.passages.device import Device
from pipeline.rigs.tire.passages.revolutions import Revolutions, joined
from pipeline.rigs.tire.passages.run_findings import RunFindings
from pipeline.rigs.tire.passages.steadiness import judge_steadiness
from pipeline.rigs.tire.passages.waveform import Waveform

Course = Revolutions
"""Revolutions of a whole log without their tables: an hour of them is small."""

# Share of a revolution's samples in a gated log; those about the patch are there by so much more.
_GATED_SHARE, _GATED_PATCH = 0.75, 0.25
# Skewness of a flex sensor in the film's channel, of a film in the flex sensor's; of no flex sensor, however long the contact.
_SKEWED, _SWAPPED, _EVEN = 2.0, 1.2, 0.5
FIRST_HARMONIC = 0.02
_FEWEST = 6
_DEAD = 5.0
# A stop shorter than the wheel would have needed for this angle (rad) is none.
_SHORT_STOP = 25.0
_HUM = 1.0


def course_of(blocks: Iterable[Revolutions]) -> Course:
    """Return what single numbers tell of each revolution of a log; one block is held at a time."""
    return joined(block.without_tables() for block in blocks)


def is_gated(device: Device, course: Course) -> bool:
    """Tell whether the transmitter sleeps away from the patch: as told, or as samples lack there only."""
    if device.gated:
        return True
    if len(course) < _FEWEST:
        return False
    share = float(np.median(course.share))
    return bool(share < _GATED_SHARE and np.median(course.patch) > share + _GATED_PATCH)


def passage_findings(device: Device, course: Course, waveform: Waveform | None) -> tuple[QualityFinding, ...]:
    """Return what is wrong with a run, that with its packets included; an error means that it must not be used.

    Parameters
    ----------
    course
        All revolutions of the run, with or without tables.
    waveform
        Their average, None where there is none.
    """
    found = RunFindings(device.run)
    gated = is_gated(device, course)
    packets = [f for f in device.quality if not (gated and "packets lost" in f.message)]
    if gated:
        found.add("warning", _GATED if device.sensor_resistance else _GATED_WITHOUT, "flex_voltage")
    _broken(found, device, course)
    if not len(course):
        _nothing(found, device, course)
        return (*packets, *found)
    _order(found, device, course)
    if not _exchanged(found, device, course, gated):
        _signals(found, device, course, gated)
        if not device.on_road:
            judge_steadiness(found, device, course)
    if all(finding.level != "error" for finding in found):
        _outlying(found, waveform)
    return (*packets, *found)


_GATED = (
    "gated log: baseline not recorded, auto-zero off, R0 from metadata; truncated entry edge: the dips and what depends on "
    "them are doubtful."
)
_GATED_WITHOUT = (
    "gated log: baseline not recorded, auto-zero off, and the metadata lack sensor_resistance (R0); truncated entry edge. "
    "State R0 of the mounted sensor, or record without sleep."
)


def _outlying(found: RunFindings, waveform: Waveform | None) -> None:
    """Say how many revolutions the average left out."""
    if waveform is not None and waveform.rejected:
        total = waveform.rejected + waveform.revolutions
        found.add(
            "warning" if waveform.rejected > 0.1 * total else "note",
            f"{counted(waveform.rejected, 'revolution')} of {total} unlike the others: left out of the average.",
            "flex_voltage",
        )


def _broken(found: RunFindings, device: Device, course: Course) -> None:
    for begin, end in course.open:
        to_end = end > device.span[1] - 1.0
        found.add(
            "error",
            f"the flex sensor reads an end of its range from t = {begin:.1f} s {'on' if to_end else f'to {end:.1f} s'} "
            "(R2 open: V near VIN, or shorted): broken ink or wire.",
            "flex_voltage",
            (begin, end),
        )


def _nothing(found: RunFindings, device: Device, course: Course) -> None:
    """Say why there is no revolution."""
    if course.open:
        return
    swing = course.swing
    seen = f"the flex voltage swings by {swing * 1e3:.1f} mV only" if math.isfinite(swing) else "no sample is valid"
    if math.isfinite(swing) and swing > 50.0 * device.step:
        seen = f"the flex voltage swings by {swing * 1e3:.0f} mV but without three regular peaks"
    found.add(
        "error",
        f"no revolution found in {device.duration:.1f} s: {seen}; expected one peak a revolution. The wheel stands, turns "
        "less than three times or unloaded, or the sensor is dead.",
        "flex_voltage",
        device.span,
    )


def _order(found: RunFindings, device: Device, course: Course) -> None:
    """Say which passages are missing, doubled, or not told apart from standing."""
    repaired = np.flatnonzero(course.repaired)
    if repaired.size:
        times = ", ".join(f"{t:.1f}" for t in course.times[repaired[:8]])
        more = f" and {repaired.size - 8} more" if repaired.size > 8 else ""
        share = repaired.size / len(course)
        found.add(
            "warning" if share > 0.05 else "note",
            f"{counted(repaired.size, 'passage')} of {len(course)} lost in gaps (t = {times}{more} s): "
            "put between the neighbours for the angle, left out of the average.",
            "flex_voltage",
        )
    dropped = int((~course.whole & ~course.repaired & (course.clipped == 0.0)).sum())
    if dropped and not is_gated(device, course):
        found.add(
            "warning" if dropped > 0.05 * len(course) else "note",
            f"{counted(dropped, 'revolution')} of {len(course)} dropped: too many samples lost round the patch.",
            "flex_voltage",
        )
    if course.doubled:
        found.add("note", f"{counted(course.doubled, 'double peak')} dropped.", "flex_voltage")
    if course.spikes:
        found.add("note", f"{counted(course.spikes, 'spike')} of single samples left out.", "flex_voltage")
    turn = 2.0 * math.pi / float(np.median(course.speed))
    spans = [(a, b) for a, b in course.stops if b - a > 0.5 * turn]
    for begin, end in spans[:10]:
        near = course.speed[np.argmin(np.abs(course.times - begin))]
        why = "too much is lost" if (end - begin) * near < _SHORT_STOP else "the wheel stands or nearly so"
        found.add(
            "note",
            f"{why} from t = {begin:.1f} to {end:.1f} s: no speed and no revolution there.",
            "flex_voltage",
            (begin, end),
        )
    if len(spans) > 10:
        found.add("note", f"{len(spans) - 10} more stops.", "flex_voltage")
    long = [(a, b) for a, b in course.still if b - a > 15.0 and not _within(a, b, course.open)]
    for begin, end in long[:10]:
        found.add(
            "note",
            f"no passage from t = {begin:.1f} to {end:.1f} s: the wheel stands or runs unloaded.",
            "flex_voltage",
            (begin, end),
        )


def _within(begin: float, end: float, spans: tuple[tuple[float, float], ...]) -> bool:
    return any(min(end, b) - max(begin, a) > 0.5 * (end - begin) for a, b in spans)


def _exchanged(found: RunFindings, device: Device, course: Course, gated: bool) -> bool:
    """Say whether the channels look swapped, or one is dead."""
    skewness = float(np.median(course.skewness))
    film = float(np.median(course.film_skewness)) if device.has_film else math.nan
    swapped = abs(skewness) < _SWAPPED and abs(film) > _SKEWED
    if (swapped or abs(skewness) < _EVEN) and not gated:
        found.add(
            "error",
            f"channels look swapped: skewness of a revolution {skewness:.1f} in the flex channel (expected 3 to 5) and "
            f"{film:.1f} in the PVDF's (expected about 0). Exchange them in the recipe."
            if swapped
            else f"the flex channel does not look like one: skewness of a revolution {skewness:.1f}, expected 3 to 5 "
            "(one high peak, two shallow dips). Check which channel it is, and its polarity.",
            "flex_voltage",
        )
        return True
    return False


def _signals(found: RunFindings, device: Device, course: Course, gated: bool) -> None:
    """Say what is wrong with polarity, range, film, harmonics and hum."""
    if course.polarity < 0 or course.upper_leg:
        told = "" if device.polarity is None else f" (told: {device.polarity:+d})"
        if device.polarity != -1:
            found.add("warning", _UPPER_LEG if course.upper_leg else f"{_INVERTED_POLARITY}{told}.", "flex_voltage")
    elif device.polarity == -1:
        found.add("warning", "flex_polarity is told -1 but the peaks point up: +1 is used.", "flex_voltage")
    clipped = int((course.clipped > 0.0).sum())
    if clipped and not course.open:
        found.add(
            "error" if clipped > 0.5 * len(course) else "warning",
            f"flex sensor clipped in {clipped} of {len(course)} revolutions: they are left out. {_clipping(device)}",
            "flex_voltage",
        )
    _film(found, device, course)
    harmonic = float(np.median(course.first_harmonic))
    if harmonic > FIRST_HARMONIC and not gated:
        found.add(
            "warning",
            f"first harmonic of R2 is {harmonic:.1%} of the peak, not explicable by ring bending (limit 2 %): an artefact "
            "once per revolution, or a wrong divider_resistance or supply_voltage.",
            "flex_voltage",
        )
    hum = float(np.median(course.hum))
    noise = float(np.nanmedian(course.noise))
    R1, VIN = device.divider_resistance, device.supply_voltage
    slope = VIN * R1 / (R1 + float(np.nanmedian(course.level))) ** 2
    if hum > _HUM * noise * slope or hum > 5e-3:
        found.add("warning", f"mains hum of {hum * 1e3:.1f} mV at the flex sensor: shield it.", "flex_voltage")


def _clipping(device: Device) -> str:
    """Say why the flex sensor can be at an end of its range."""
    if device.scale_known and device.adc_full_scale > device.supply_voltage + 2.0 * device.step:
        return (
            f"A divider gives no more than its supply (supply_voltage {device.supply_voltage:g} V), the converter reads up to "
            f"adc_reference ({device.adc_full_scale:g} V): check both."
        )
    return "Choose a divider resistance nearer to R2."


_INVERTED_POLARITY = "flex polarity inverted: the peaks point down; R2 is mirrored about its level"
_UPPER_LEG = (
    "flex polarity inverted: the peaks point down because the sensor is in the divider's upper leg (R1 in the lower): R2 = "
    "R1 (VIN - V)/V is used."
)


def _film(found: RunFindings, device: Device, course: Course) -> None:
    if not device.has_film:
        found.add(
            "note",
            "no PVDF film in the log: debonding of the flex sensor cannot be told from a change of load.",
            "pvdf_voltage",
        )
        return
    clipped = course.film_clipped > 0.0
    if clipped.any():
        least = float(course.speed[clipped].min()) / (2.0 * math.pi)
        found.add(
            "warning",
            f"PVDF clipped in {int(clipped.sum())} of {len(course)} revolutions, from {least:.2f} rev/s on: lower gain. "
            "They are left out of what the film tells.",
            "pvdf_voltage",
        )
    elif course.film_amplitude is not None and not np.any(course.film_amplitude > _DEAD * device.step):
        found.add("warning", "the PVDF film shows no passages: broken or not connected.", "pvdf_voltage")
