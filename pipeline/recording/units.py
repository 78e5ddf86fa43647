"""Units at the border: the text of a unit -> factor, offset and SI unit (pint underneath).

Inside rigfit every number is SI. Ratios have the unit ``"1"``, text channels the unit ``""``.
Rates of rotation follow their meaning, not only their dimension: a cycle is 2 pi rad, so 60 rpm is
1 Hz and 6.283 rad/s, whichever of the two a channel is declared in.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from pipeline.errors import InputError, listing, nearest
from pipeline.recording.unit_words import symbol_of

if TYPE_CHECKING:
    import numpy as np
    import pint

    Number = TypeVar("Number", float, np.ndarray)

# Spellings of test machines and loggers that pint does not know or takes for something else
# (its "Nm" is a textile number, its "U/min" an enzyme activity, its "G" not the gauss).
# fmt: off
_SPELLINGS = {
    "": "1", "-": "1", "--": "1", "[-]": "1", "none": "1", "ratio": "1", "n/a": "1",
    "Nm": "N*m", "N-m": "N*m", "Nmm": "N*mm", "kNm": "kN*m", "mNm": "mN*m", "Ncm": "N*cm",
    "Ns/m": "N*s/m", "Nms/rad": "N*m*s/rad", "Nm/rad": "N*m/rad", "Nm/deg": "N*m/deg",
    "Ns": "N*s", "Ws": "W*s", "Wh": "W*h", "Pas": "Pa*s", "Ah": "A*h", "mAh": "mA*h",
    "G": "gauss_field", "U/min": "rpm", "rev/min": "rpm", "r/min": "rpm", "rev": "turn", "revs": "turn",
    "rev/s": "turn/s", "rps": "turn/s", "cpm": "1/min", "spm": "1/min",
    "gn": "g_0", "g0": "g_0", "kp": "kgf", "Sec": "s", "Sek": "s", "sek": "s", "Secs": "s",
    "秒": "s",
    "degC": "degC", "C": "C", "deg C": "degC", "Deg C": "degC", "grad C": "degC", "Grad C": "degC", "Grad": "deg", "Grad Celsius": "degC",
    "cnt": "count", "cnts": "count", "mmHG": "mmHg", "cc": "cm^3", "ccm": "cm^3", "lpm": "l/min",
    "LPM": "l/min", "KN": "kN", "Kn": "kN", "Hz.": "Hz", "kHz": "kHz", "HZ": "Hz",
    "MM": "mm", "Mm": "mm", "Volt": "V", "Volts": "V", "Newtons": "N", "Amps": "A", "Amp": "A",
    "gauss": "gauss_field", "Gauss": "gauss_field",
}
# fmt: on
# The name that an SI unit goes by here, for channels that no experiment declares.
_SI_NAMES = (
    "1",
    "m",
    "s",
    "kg",
    "A",
    "K",
    "rad",
    "N",
    "Pa",
    "N m",
    "J",
    "W",
    "V",
    "T",
    "C",
    "ohm",
    "Hz",
    "rad/s",
    "m/s",
    "m/s^2",
    "N/m",
    "N s/m",
    "kg m^2",
    "m^2",
    "m^3",
    "m^3/s",
    "kg/m^3",
    "kg/s",
    "F",
    "H",
    "Wb",
    "A/m",
    "Pa s",
    "rad/s^2",
    "N m s/rad",
    "N m/rad",
    "1/m",
    "V/N",
    "count",
)  # fmt: skip
# What a symbol means where this SI unit is wanted: C is then not the coulomb, g not the gram, mil not an angle.
_MEANT = {
    "K": {"C": "degC", "F": "degF"},
    "m/s^2": {"g": "g_0", "mg": "millig_0", "G": "g_0", "gs": "g_0"},
    "m": {"mil": "thou", "mils": "thou", "Mil": "thou"},
    "count": dict.fromkeys(
        (
            "",
            "1",
            "-",
            "--",
            "#",
            "pulse",
            "pulses",
            "Pulse",
            "Pulses",
            "tick",
            "ticks",
            "edges",
            "increments",
            "inc",
            "Inkremente",
            "Imp",
        ),
        "count",
    ),
}
# Units offered in a message, by the SI unit that they convert to.
_OFFERED = {
    "m": "m, cm, mm, um, mil, inch", "s": "s, ms, us, min, h", "N": "N, kN, mN, kgf, lbf",
    "A": "A, mA", "K": "K, degC, degF", "rad": "rad, deg, turn", "Pa": "Pa, kPa, MPa, bar, psi, mmHg",
    "V": "V, mV", "T": "T, mT, gauss", "Hz": "Hz, kHz, rpm, 1/min", "rad/s": "rad/s, rpm, deg/s, Hz",
    "m/s": "m/s, mm/s, km/h", "m/s^2": "m/s^2, mm/s^2, g", "kg": "kg, g, t, lb", "1": "1, %", "count": "count, pulses, ticks, 1",
    "N m": "N*m, kN*m, N*mm", "m^3/s": "m^3/s, l/min, ml/min, ml/h", "m^3": "m^3, l, ml",
    "N/m": "N/m, N/mm, kN/mm", "W": "W, kW", "J": "J, kJ, W*h", "ohm": "ohm, kohm",
}  # fmt: skip


@dataclass(frozen=True)
class Conversion:
    """``si = value * factor + offset``; `unit` is the SI unit that the result has."""

    factor: float
    offset: float
    unit: str

    def __call__(self, value: Number) -> Number:
        """Return `value` in SI."""
        return value * self.factor + self.offset

    @property
    def is_identity(self) -> bool:
        """Tell whether the numbers are SI already."""
        return self.factor == 1.0 and self.offset == 0.0


_LONGEST = 60
_TOWER = re.compile(r"\d\s*(\^|\*\*)|(\^|\*\*)\s*[-+(]*\d{2}")


@cache
def _registry() -> pint.UnitRegistry[float]:
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(cache_folder=":auto:", autoconvert_offset_to_baseunit=True)
    registry.define("gauss_field = 1e-4 tesla")  # the SI gauss; pint's own belongs to the Gaussian system
    return registry


def _bare(text: str) -> str:
    """Return a unit without brackets about it; those that belong to it, as in m^3/(s Pa), stay."""
    bare = text.strip().strip("[]()").strip()
    depth, least = 0, 0
    for sign in bare:
        depth += (sign == "(") - (sign == ")")
        least = min(least, depth)
    return bare if depth == 0 and least == 0 else text.strip().strip("[]").strip()


def _spelt_for_pint(text: str) -> str:
    text = _bare(text)
    if text in _SPELLINGS:
        return _SPELLINGS[text]
    if word := symbol_of(text):
        return word
    text = text.replace("℃", "degC").replace("°C", "degC").replace("°F", "degF").replace("°", "deg")
    text = text.replace("µ", "u").replace("μ", "u").replace("Ω", "ohm").replace("Ω", "ohm")
    text = text.replace("·", "*").replace("⋅", "*").replace("×", "*").replace("−", "-")
    text = re.sub(r"(?<=[A-Za-z])(-?\d)(?=$|[^\w.])", r"^\1", text)  # m/s2 -> m/s^2
    parts = re.split(r"([/*\s^])", text)
    return "".join(_SPELLINGS.get(part) or symbol_of(part) or part if part.strip() else part for part in parts)


@cache
def _parse(text: str) -> tuple[float, float, dict[str, float], bool]:
    """Return factor and offset to SI base units, the dimension, and whether it turns (has rad)."""
    spelt = _spelt_for_pint(text)
    if len(spelt) > _LONGEST or _TOWER.search(spelt):  # pint would compute 9**9**9
        raise ValueError(f"'{spelt[:_LONGEST]}' is no unit")
    ureg = _registry()
    unit = ureg.parse_units(spelt)
    one, zero = (ureg.Quantity(value, unit).to_base_units() for value in (1.0, 0.0))
    base = {str(name): float(power) for name, power in one.units._units.items()}  # type: ignore[arg-type]
    turns = base.pop("radian", 0) != 0
    factor = float(one.magnitude) - float(zero.magnitude)
    return factor, float(zero.magnitude), base, turns


def _understood(text: str, where: str) -> tuple[float, float, dict[str, float], bool]:
    try:
        return _parse(text)
    except Exception as error:  # pint raises many kinds, from its own to tokenizer errors
        known = listing(sorted({name for units in _OFFERED.values() for name in units.split(", ")}), 60)
        hint = nearest(text, known.split(", "))
        raise InputError(f"{where}: unknown unit '{text}'.{hint} Known units are for example {known}.") from error


def conversion(unit: str, si_unit: str | None = None, where: str = "unit") -> Conversion:
    """Tell how numbers in `unit` become SI.

    Parameters
    ----------
    unit
        As found: ``kN``, ``[mm]``, ``°C``, ``m/s²``, ``rpm``, ``%``, ``-``.
    si_unit
        The declared SI unit; without it the SI unit of the same dimension.
    where
        Begins the error message: file and channel.

    Raises
    ------
    InputError
        For an unknown unit, or one of another dimension than `si_unit`.

    Examples
    --------
    >>> conversion("kN", "N")(2.0)
    2000.0
    >>> conversion("degC").unit
    'K'
    >>> round(conversion("rpm", "Hz")(60.0), 12)
    1.0
    """
    unit = _MEANT.get(si_unit or "", {}).get(unit.strip().strip("[]()"), unit)
    factor, offset, base, turns = _understood(unit, where)
    if si_unit is None:
        return Conversion(factor, offset, _si_name(base, turns))
    si_factor, _, si_base, si_turns = _understood(si_unit, where)
    if base != si_base:
        known = _OFFERED.get(si_unit, si_unit)
        raise InputError(f"{where}: unit '{unit}' does not measure the same as '{si_unit}'. Units that do: {known}.")
    if turns != si_turns and base == {"second": -1}:
        factor *= 2 * math.pi if si_turns else 1 / (2 * math.pi)
    return Conversion(_rounded(factor / si_factor), offset / si_factor, si_unit)


def _rounded(factor: float) -> float:
    """Undo the last-digit noise of pint's chain of factors: 1e-3 shall be 1e-3."""
    return float(f"{factor:.15g}")


@cache
def _si_names() -> dict[tuple[frozenset[tuple[str, float]], bool], str]:
    names: dict[tuple[frozenset[tuple[str, float]], bool], str] = {}
    for name in _SI_NAMES:
        _, _, base, turns = _parse(name)
        names.setdefault((frozenset(base.items()), turns), name)
    return names


def _si_name(base: dict[str, float], turns: bool) -> str:
    key = (frozenset(base.items()), turns)
    if key in _si_names():
        return _si_names()[key]
    symbols = {"meter": "m", "kilogram": "kg", "second": "s", "ampere": "A", "kelvin": "K", "mole": "mol",
               "candela": "cd", "radian": "rad"}  # fmt: skip
    parts = [*base.items(), *([("radian", 1)] if turns else [])]
    return " ".join(f"{symbols.get(n, n)}^{p:g}" if p != 1 else symbols.get(n, n) for n, p in parts) or "1"


def is_unit(text: str) -> bool:
    """Tell whether `text` reads as a unit."""
    try:
        _parse(text)
    except Exception:  # see _understood
        return False
    return True


_QUANTITY = re.compile(r"^\s*([-+−]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


def number_and_unit(text: str) -> tuple[float, str] | None:
    """Part ``"0,4 mm"`` or ``"2N"`` into its number and the text of its unit ('' where there is none); None where it is neither."""
    match = _QUANTITY.match(text)
    return (float(match[1].replace(",", ".").replace("−", "-")), match[2]) if match else None


def quantity(text: str | float, si_unit: str | None = None, where: str = "value") -> float:
    """Turn ``"52 kN"``, ``"0,4 mm"`` or a bare number (taken as SI) into an SI number.

    Raises
    ------
    InputError
        Where the text is no number with a unit, or its unit is unknown or of another dimension.
    """
    if isinstance(text, int | float):
        return float(text)
    parted = number_and_unit(text)
    if parted is None:
        raise InputError(f"{where}: '{text}' is not a number with a unit; write for example '6 A' or 0.4e-3.")
    value, unit = parted
    return conversion(unit, si_unit, where)(value) if unit else value
