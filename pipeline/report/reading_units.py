"""Units for reading: SI -> mm, kN/m, µs, chosen by magnitude. Not for input; that is `recording.units`.

A size too odd for any of them is written with a power of ten before the unit, so that the number
itself stays short.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pipeline.report.words import clean

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FINEST, _LONGEST = 1e-5, 1e4  # of a shown number: error in the unit, and size in the smaller unit
_PREFIXES = (("n", 1e-9), ("µ", 1e-6), ("m", 1e-3), ("", 1.0), ("k", 1e3), ("M", 1e6), ("G", 1e9), ("T", 1e12))
_PREFIXABLE = {"N", "Pa", "J", "W", "V", "A", "T", "C", "F", "H", "Wb", "Hz", "m", "s", "ohm"}

# SI unit -> (name, its size in SI, magnitude from which on it is used), small to large. Units that take a
# prefix by the common rule are not listed.
_LADDERS: dict[str, tuple[tuple[str, float, float], ...]] = {
    "1": (("", 1.0, 1e-3),),
    "m": (("nm", 1e-9, 1e-9), ("µm", 1e-6, 1e-6), ("mm", 1e-3, 1e-4), ("m", 1.0, 1.0)),
    "s": (("ns", 1e-9, 1e-9), ("µs", 1e-6, 1e-6), ("ms", 1e-3, 1e-3), ("s", 1.0, 0.1)),
    "kg": (("mg", 1e-6, 1e-6), ("g", 1e-3, 1e-3), ("kg", 1.0, 0.1)),
    "K": (("mK", 1e-3, 1e-3), ("K", 1.0, 0.1)),
    "Pa": (("Pa", 1.0, 1e-3), ("kPa", 1e3, 1e3), ("MPa", 1e6, 1e5), ("GPa", 1e9, 1e9)),
    "Hz": (("mHz", 1e-3, 1e-3), ("Hz", 1.0, 0.1), ("kHz", 1e3, 1e4), ("MHz", 1e6, 1e6)),
    "rad": (("µrad", 1e-6, 1e-6), ("mrad", 1e-3, 1e-3), ("°", math.pi / 180, math.pi / 180)),
    "rad/s": (("mrad/s", 1e-3, 1e-3), ("rad/s", 1.0, 0.1)),
    "rad/s^2": (("rad/s²", 1.0, 1e-3),),
    "m/s": (("µm/s", 1e-6, 1e-6), ("mm/s", 1e-3, 1e-3), ("m/s", 1.0, 1.0)),
    "m/s^2": (("mm/s²", 1e-3, 1e-3), ("m/s²", 1.0, 0.1)),
    "m^2": (("µm²", 1e-12, 1e-12), ("mm²", 1e-6, 1e-8), ("m²", 1.0, 1e-2)),
    "m^3": (("mm³", 1e-9, 1e-9), ("cm³", 1e-6, 1e-6), ("l", 1e-3, 1e-3), ("m³", 1.0, 1e-1)),
    "m^3/s": (("mm³/s", 1e-9, 1e-9), ("ml/s", 1e-6, 1e-6), ("l/s", 1e-3, 1e-3), ("m³/s", 1.0, 1.0)),
    "kg m^2": (("kg·mm²", 1e-6, 1e-6), ("kg·cm²", 1e-4, 1e-4), ("kg·m²", 1.0, 1e-1)),
    "1/m": (("1/m", 1.0, 1e-2), ("1/mm", 1e3, 1e3)),
    "count": (("counts", 1.0, 1e-2),),
}  # fmt: skip


@dataclass(frozen=True)
class ReadingUnit:
    """A unit as shown: `name` ('' for ratios), its `size` in SI and the SI value of its `zero`."""

    name: str
    size: float = 1.0
    zero: float = 0.0

    def read(self, si: float) -> float:
        """Return an SI number as it is read."""
        return (si - self.zero) / self.size

    def heading(self, label: str) -> str:
        """Return the label with the unit in brackets; ratios show none."""
        return f"{label} ({self.name})" if self.name else label


PERCENT = ReadingUnit("%", 0.01)
CELSIUS = ReadingUnit("°C", 1.0, 273.15)
# Units that are no SI units and are asked for by name.
_BY_NAME = {
    "%": PERCENT, "degC": CELSIUS, "km/h": ReadingUnit("km/h", 1.0 / 3.6), "mmHg": ReadingUnit("mmHg", 133.322387415),
    "mL": ReadingUnit("mL", 1e-6), "mL/min": ReadingUnit("mL/min", 1e-6 / 60.0), "mL/h": ReadingUnit("mL/h", 1e-6 / 3600.0),
    "mL/h/mmHg": ReadingUnit("mL/(h·mmHg)", 1e-6 / 3600.0 / 133.322387415), "W h": ReadingUnit("Wh", 3600.0),
    "min": ReadingUnit("min", 60.0), "h": ReadingUnit("h", 3600.0),
}  # fmt: skip


def spelt(si_unit: str) -> str:
    """Return a unit as it is printed: ``N s/m`` -> ``N·s/m``, ``m^2`` -> ``m²``, ``1`` -> ````."""
    if si_unit in ("1", ""):
        return ""
    si_unit = clean(si_unit)
    text = re.sub(r"\^\(?(-?\d+)\)?(?![\d.])", lambda power: power[1].translate(_SUPERSCRIPT), si_unit)
    text = re.sub(r"\bohm\b", "Ω", text)
    return re.sub(r"\s*[*·]\s*|(?<=[^\s/])\s+(?=[^\s/])", "·", text.strip())


def power_of_ten(exponent: int) -> str:
    """Return ``10⁻³`` and the like."""
    return f"10{str(exponent).translate(_SUPERSCRIPT)}"


def _ladder(si_unit: str) -> tuple[tuple[str, float, float], ...]:
    if si_unit in _LADDERS:
        return _LADDERS[si_unit]
    first = re.match(r"[A-Za-z]+(?![\w^])", si_unit)
    if first and first[0] in _PREFIXABLE:
        return tuple((prefix + spelt(si_unit), size, size) for prefix, size in _PREFIXES)
    return ((spelt(si_unit), 1.0, 1e-2),)


def reading_unit(si_unit: str, magnitude: float, resolution: float = 0.0) -> ReadingUnit:
    """Choose the unit in which numbers of about `magnitude` (SI) read best.

    Parameters
    ----------
    si_unit
        SI unit as declared: ``N/m``, ``N s/m``, ``1``; ``%`` for a ratio that is read in percent, ``degC`` for
        an absolute temperature in K that is read in degrees Celsius; ``km/h``, ``mmHg``, ``mL``, ``mL/min``, ``mL/h``,
        ``mL/h/mmHg``, ``W h``, ``min`` and ``h`` for what is to be read so.
    magnitude
        Typical size; zero or not finite gives the plain SI unit.
    resolution
        Typical standard error: where it would need more than five places, the next smaller unit is taken.

    Examples
    --------
    >>> reading_unit("N/m", 2.6e5).name
    'kN/m'
    >>> reading_unit("s", 60e-6).name
    'µs'
    >>> reading_unit("m", 2e-4).name, reading_unit("m", 2e-4, resolution=9e-10).name
    ('mm', 'µm')
    """
    if si_unit in _BY_NAME:
        return _BY_NAME[si_unit]
    if not (math.isfinite(magnitude) and magnitude > 0):
        return ReadingUnit("" if si_unit == "1" else spelt(si_unit))
    ladder = _ladder(si_unit)
    fitting = [(name, size) for name, size, start in ladder if magnitude >= start * (1 - 1e-9)]
    while len(fitting) > 1 and 0 < resolution < _FINEST * fitting[-1][1] and magnitude < _LONGEST * fitting[-2][1]:
        fitting.pop()
    name, size = fitting[-1] if fitting else ladder[0][:2]
    if 1e-3 * (1 - 1e-9) <= magnitude / size < 1e6:
        return ReadingUnit(name, size)
    exponent = 3 * math.floor(math.log10(magnitude / size) / 3)
    return ReadingUnit(
        f"{power_of_ten(exponent)} {name}" if name else f"×{power_of_ten(exponent)}", size * 10.0**exponent
    )


def size_of(value: float | None, std_error: float | None = None, ci95: tuple[float, float] | None = None) -> float:
    """Return the magnitude that decides the unit of an uncertain number: a zero is as large as its uncertainty."""
    return max(abs(value or 0.0), abs(std_error or 0.0)) or max(map(abs, ci95 or (0.0,)))


def typical(values: Iterable[float | None]) -> float:
    """Return the median magnitude of the finite, nonzero values; 0 where there are none."""
    found = [abs(value) for value in values if value is not None and math.isfinite(value) and value != 0]
    return float(np.median(found)) if found else 0.0
