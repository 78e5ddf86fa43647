"""Are the numbers in the unit that they are said to be in? Told by their size with the pump on (rap.md, section 8)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.pressures.record import READERS, WORDS, Record
from pipeline.rigs.rap.pressures.tap_levels import TapLevel

# Pa in one of each: what a number may have been before somebody called it Pa.
PRESSURE_UNITS = {"mmHg": 133.322, "kPa": 1e3, "mbar": 100.0, "cmH2O": 98.0665, "psi": 6894.76, "bar": 1e5}
# m3/s in one of each.
FLOW_UNITS = {"mL/min": 1.0 / 6e7, "L/min": 1.0 / 6e4, "mL/h": 1.0 / 3.6e9, "L/h": 1.0 / 3.6e6, "mL/s": 1e-6, "uL/min": 1.0 / 6e10}  # fmt: skip
# Pressures of taps that stand off zero while the pump runs, Pa: possible (section 8) and usual (section 6).
_POSSIBLE = {"prefilter": (500.0, 5e4), "return": (150.0, 5e4), "access": (150.0, 5e4)}
_USUAL = {"prefilter": 3.3e3, "return": 1.75e3, "access": 1.9e3}
_BLOOD_FLOW, _UF_FLOW = (1e-7, 2e-5), (1e-11, 2e-6)
_USUAL_BLOOD_FLOW, _USUAL_UF_FLOW = 1.33e-6, 8.3e-8
# A pump pulsates by more than that, Pa rms: a low pressure that does so is in pascals.
_PULSATES = 40.0
# Readers of one tap differ by less than the first factor, or by that of a unit within the second share.
_ALIKE, _NEAR = 1.6, 0.2
# A channel that varies by less than that many times its noise at rest shows nothing but noise.
_NOISY = 2.0


def unit_faults(record: Record, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Return errors where the size of channels is that of another unit, one for each reader and unit."""
    found: list[QualityFinding] = []
    told: set[str] = set()
    for reader in READERS:
        own = [level for level in levels if level.reader == reader]
        for finding, channels in _by_size(record, own):
            found.append(finding)
            told.update(channels)
    found += [finding for finding in _by_the_other_reader(record, levels) if finding.channel not in told]
    return found + _flows(record)


def _by_size(record: Record, levels: Sequence[TapLevel]) -> list[tuple[QualityFinding, list[str]]]:
    """Judge the taps of one reader by the size that they must have with the pump on."""
    low = [level for level in levels if side_of(level) < 0]
    high = [level for level in levels if side_of(level) > 0]
    found = []
    for odd, power in ((low, 1), (high, -1)):
        if not odd:
            continue
        unit = _fitting(odd, power)
        told = _sizes(odd, 1.0)
        possible = listing([f"{_POSSIBLE[one.tap][0]:g} to {_POSSIBLE[one.tap][1]:g} Pa" for one in odd[:1]])
        if not unit:
            text = f"{told} with the pump on, where {possible} can be, and no unit of pressure explains it: look at scale and sensor"
        elif power > 0:
            text = (
                f"unit mix-up, factor {PRESSURE_UNITS[unit]:.4g}: {told} with the pump on, where {possible} can be; in {unit} these are "
                f"{_sizes(odd, PRESSURE_UNITS[unit])}. Give the unit in the recipe, as 'unit: {unit}', also of {_of_reader(levels, odd)}"
            )
        else:
            text = (
                f"unit mix-up, factor 1/{PRESSURE_UNITS[unit]:.4g}: {told} with the pump on, where {possible} can be; the numbers were converted from "
                f"{unit} and were none. Give the unit in the recipe, as 'unit: Pa'"
            )
        found.append(
            (
                QualityFinding("error", text, record.run, odd[0].channel),
                [one.channel for one in (levels if unit else odd)],
            )
        )
    return found


def _of_reader(levels: Sequence[TapLevel], odd: Sequence[TapLevel]) -> str:
    others = [level.channel for level in levels if level not in odd]
    return listing(others, 4) if others else "channels of the same source"


def side_of(level: TapLevel) -> int:
    """Return -1 where a level is too low to be in pascals, 1 where it is too high, 0 where it can be."""
    if level.tap not in _POSSIBLE or not math.isfinite(level.rise) or level.spread == 0.0:
        return 0
    low, high = _POSSIBLE[level.tap]
    size = abs(level.rise)
    if size < (level.noise if level.zeroed else level.scatter):
        return 0  # below its own noise: nothing was pumped
    if size > high:
        return 1
    return -1 if size < low and not level.scatter > _PULSATES else 0


def _fitting(levels: Sequence[TapLevel], power: int) -> str:
    """Return the unit whose factor makes all levels possible and brings them nearest to the usual ones; '' for none."""
    misfits = {}
    for unit, factor in PRESSURE_UNITS.items():
        sizes = [(abs(level.rise) * factor**power, level.tap) for level in levels]
        if all(0.5 * _POSSIBLE[tap][0] <= size <= 2.0 * _POSSIBLE[tap][1] for size, tap in sizes):
            misfits[unit] = sum(abs(math.log(size / _USUAL[tap])) for size, tap in sizes)
    return min(misfits, key=misfits.__getitem__) if misfits else ""


def _sizes(levels: Iterable[TapLevel], factor: float) -> str:
    many = list(levels)
    if factor == 1.0:
        return ", ".join(f"{level.channel} is {level.rise:.3g} Pa" for level in many)
    return ", ".join(f"{level.rise * factor:.4g}" for level in many) + " Pa"


def _by_the_other_reader(record: Record, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Judge two readers of one tap by one another: their ratio is that of two units."""
    found: dict[str, QualityFinding] = {}
    bench = {level.tap: level for level in levels if level.reader == "bench"}
    for own in levels:
        other = bench.get(own.tap)
        if own.reader == "bench" or other is None or not (own.spread > 0.0 and other.spread > 0.0):
            continue
        ratio = own.spread / other.spread
        wrong, right, off = (own, other, 1.0 / ratio) if ratio < 1.0 else (other, own, ratio)
        if wrong.zeroed and wrong.spread < _NOISY * wrong.noise:
            continue  # noise alone: the sensor sees nothing of what the other one sees
        units = {unit: abs(off / factor - 1.0) for unit, factor in PRESSURE_UNITS.items()}
        unit = min(units, key=units.__getitem__)
        if off < _ALIKE or units[unit] > _NEAR:
            continue
        text = (
            f"unit mix-up, factor {PRESSURE_UNITS[unit]:.4g}: {wrong.channel} ({WORDS[wrong.reader]} reading) varies by {wrong.spread:.3g} and "
            f"{right.channel} at the same tap by {right.spread:.4g}: the former is in {unit} where the latter is in Pa. Give its unit in the recipe, as "
            f"'unit: {unit}'"
        )
        found.setdefault(wrong.channel, QualityFinding("error", text, record.run, wrong.channel))
    return list(found.values())


def _flows(record: Record) -> list[QualityFinding]:
    """Judge flows by their size."""
    found = []
    for one, possible, usual in (
        (record.flow_set, _BLOOD_FLOW, _USUAL_BLOOD_FLOW),
        (record.meter, _BLOOD_FLOW, _USUAL_BLOOD_FLOW),
        (record.uf_set, _UF_FLOW, _USUAL_UF_FLOW),
    ):
        size = float(np.quantile(np.abs(one.values), 0.9)) if one is not None else 0.0
        if one is None or size == 0.0 or possible[0] <= size <= possible[1]:
            continue
        unit = _flow_unit(size, FLOW_UNITS, possible, usual)
        hint = f"; as {unit} it would fit" if unit else ""
        text = f"unit mix-up: {one.name} is {size:.4g} m3/s, where {possible[0]:g} to {possible[1]:g} m3/s can be{hint}. Give its unit in the recipe"
        found.append(QualityFinding("error", text, record.run, one.name))
    return found


def _flow_unit(size: float, units: Mapping[str, float], possible: tuple[float, float], usual: float) -> str:
    sizes = {unit: size * factor for unit, factor in units.items()}
    fits = {unit: abs(math.log(value / usual)) for unit, value in sizes.items() if possible[0] <= value <= possible[1]}
    return min(fits, key=fits.__getitem__) if fits else ""
