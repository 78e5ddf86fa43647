"""Are the numbers in the unit that they are said to be in? Told by their size with the pump on (rap.md, section 8)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.pressures.record import WORDS, Record
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


def unit_faults(record: Record, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Return errors where a channel's size is that of another unit."""
    found = {finding.channel: finding for finding in [*_by_the_other_reader(record, levels), *_by_size(record, levels)]}
    return [*found.values(), *_flows(record)]


def _by_size(record: Record, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Judge each tap by the size that it must have with the pump on."""
    found = []
    for level in levels:
        if level.tap not in _POSSIBLE or not math.isfinite(level.rise):
            continue
        low, high = _POSSIBLE[level.tap]
        size = abs(level.rise)
        if low <= size <= high or (size < low and level.scatter > _PULSATES):
            continue
        up = size < low
        unit = _fitting(size, PRESSURE_UNITS, (low, high), _USUAL[level.tap], up)
        told = f"{_name(level)} is {level.rise:.4g} Pa with the pump on, where {low:g} to {high:g} Pa can be"
        if unit and up:
            factor = PRESSURE_UNITS[unit]
            text = (
                f"unit mix-up, factor {factor:.4g}: {told}; as {unit} it would be {level.rise * factor:.4g} Pa. Give its unit in the recipe, as "
                f"'unit: {unit}'"
            )
        elif unit:
            text = f"unit mix-up, factor 1/{PRESSURE_UNITS[unit]:.4g}: {told}; it was converted from {unit} and was none. Give its unit as 'unit: Pa'"
        elif size == 0.0 or level.spread == 0.0:
            continue
        else:
            text = f"{told}, and no unit of pressure explains it: look at its scale in the recipe, or at the sensor"
        found.append(QualityFinding("error", text, record.run, level.channel))
    return found


def _fitting(size: float, units: Mapping[str, float], possible: tuple[float, float], usual: float, up: bool) -> str:
    """Return the unit by whose factor a size becomes possible, the nearest to the usual one; '' where there is none."""
    low, high = possible
    sizes = {unit: size * factor if up else size / factor for unit, factor in units.items()}
    fits = {unit: abs(math.log(value / usual)) for unit, value in sizes.items() if low <= value <= high}
    return min(fits, key=fits.__getitem__) if fits else ""


def _by_the_other_reader(record: Record, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Judge two readers of one tap by one another: their ratio is that of two units."""
    found = []
    bench = {level.tap: level for level in levels if level.reader == "bench"}
    for own in levels:
        other = bench.get(own.tap)
        if own.reader == "bench" or other is None or not (own.spread > 0.0 and other.spread > 0.0):
            continue
        ratio = own.spread / other.spread
        wrong, right, off = (own, other, 1.0 / ratio) if ratio < 1.0 else (other, own, ratio)
        if off < _ALIKE:
            continue
        units = {unit: abs(off / factor - 1.0) for unit, factor in PRESSURE_UNITS.items()}
        unit = min(units, key=units.__getitem__)
        if units[unit] > _NEAR:
            continue
        text = (
            f"unit mix-up, factor {PRESSURE_UNITS[unit]:.4g}: {_name(wrong)} varies by {wrong.spread:.3g}, {right.channel} at the same tap by "
            f"{right.spread:.4g}: the former is in {unit} where the latter is in Pa. Give its unit in the recipe, as 'unit: {unit}'"
        )
        found.append(QualityFinding("error", text, record.run, wrong.channel))
    return found


def _name(level: TapLevel) -> str:
    return f"{level.channel}, {WORDS[level.reader]} reading,"


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
        unit = _fitting(size, FLOW_UNITS, possible, usual, True)
        hint = f"; as {unit} it would fit" if unit else ""
        text = f"unit mix-up: {one.name} is {size:.4g} m3/s, where {possible[0]:g} to {possible[1]:g} m3/s can be{hint}. Give its unit in the recipe"
        found.append(QualityFinding("error", text, record.run, one.name))
    return found
