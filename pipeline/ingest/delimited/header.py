"""Names and units of columns from what stands above them: ``Force [kN]``, ``T/°C``, ``Kraft in N``, a units row.

A unit is only split off where it is beyond doubt; what stays doubtful stays in the name.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording.units import conversion, is_unit

_BRACKETED = re.compile(
    r"(?P<name>.*?)(?P<gap>[\s_]*)(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>(?:[^()]|\([^()]*\))*)\)|<(?P<angle>[^<>]*)>)\s*:?"
)
_SLASHED = re.compile(r"(?P<name>[^/]*[^/\s])\s*/\s*(?P<unit>\S.*)")
_IN = re.compile(r"(?P<name>.*\S)\s+in\s+(?P<unit>\S+)", re.IGNORECASE)
_SUFFIXED = re.compile(r"(?P<name>.*[^\W_])_(?P<unit>[^\W_]+)")
# Units that are no word and no index, so that they are understood behind a slash or an underscore.
# fmt: off
_UNMISTAKABLE = frozenset((
    "mm", "um", "µm", "μm", "nm", "cm", "km", "kN", "mN", "MN", "Nm", "kNm", "Nmm", "ms", "us", "µs", "μs", "ns", "sec",
    "Hz", "kHz", "MHz", "rpm", "degC", "degF", "deg", "rad", "bar", "mbar", "kPa", "MPa", "GPa", "Pa", "mV", "kV", "uV",
    "µV", "mA", "kg", "lbf", "psi", "kgf", "mT", "kW", "ohm", "%", "°C", "°F", "°",
    "mmHg", "cmH2O", "hPa", "Torr", "mL", "ml", "µL", "uL", "Wh", "kWh", "mAh", "mW", "kJ",
))
# fmt: on
# A single letter is a unit only behind a quantity that it measures.
_MEASURED_IN = {
    "s": "t time zeit temps tempo",
    "h": "t time zeit temps tempo",
    "min": "t time zeit temps tempo",
    "N": "f force load kraft force_x force_y force_z fx fy fz",
    "m": "x y z s d l u w disp displacement position pos stroke weg",
    "V": "u v voltage spannung",
    "A": "i current strom",
    "K": "t temp temperature temperatur",
    "C": "temp temperature temperatur",
    "g": "a ax ay az acc acceleration",
    "T": "b field flux",
}
_PLAUSIBLE_UNIT = re.compile(r"(?:[^\W\d_]|[°℃℉%µμΩΩ²³⁻¹·⋅*/\s().-]|\^-?[0-9]|[0-9](?![0-9]{2}|\^)|[$'\"])+")
_TIME_WORD = re.compile(r"(?i).*(time|zeit|temps|tempo|dauer|duration)|t")
_TIME_NAME = re.compile(
    r"(?i)(.*[\s_.-])?(time|zeit|prüfzeit|messzeit|laufzeit|temps|tempo|tiempo|tijd|czas|время|zeitstempel|timestamp)"
    r"([\s_.-].*)?|t|.*(时间|時間|時刻|시간).*"
)
_WIDE_BRACKETS = str.maketrans("（）［］【】", "()[][]")
_LONGEST_UNIT, _LONGEST_HEADER, _MOST_JUDGED = 16, 200, 50
_NO_UNITS = {"sequence", "index", "text", "string"}
_UNIT_LETTERS = set("sNmVAKgCWJh%°-")


def name_and_unit(text: str) -> tuple[str, str | None]:
    """Split one column's header into its name and its unit; the unit is None where there is none for sure.

    Examples
    --------
    >>> name_and_unit("Force [kN]"), name_and_unit("T/°C"), name_and_unit("Kraft in N")
    (('Force', 'kN'), ('T', '°C'), ('Kraft', 'N'))
    >>> name_and_unit("pressure_access/mmHg"), name_and_unit("flow/mL/min"), name_and_unit("t/min")
    (('pressure_access', 'mmHg'), ('flow', 'mL/min'), ('t', 'min'))
    >>> name_and_unit("Sensor (left)"), name_and_unit("stress/strain"), name_and_unit("dF/dt")
    (('Sensor (left)', None), ('stress/strain', None), ('dF/dt', None))
    """
    text = " ".join(text.translate(_WIDE_BRACKETS).split())
    if len(text) > _LONGEST_HEADER:
        return text, None
    if match := _BRACKETED.fullmatch(text):
        name, unit = match["name"].rstrip("/ "), _first(match["square"], match["round"], match["angle"])
        if unit.isdigit() and (match["square"] is None or not match["gap"]):
            return text, None  # Force (2), channel[1]
        if unit == "min" and match["round"] is not None and not _TIME_WORD.fullmatch(name):
            return text, None  # the smallest, not the minute
        return (name, unit or "-") if not unit or is_known_unit(unit) else (text, None)
    for form in (_SLASHED, _SUFFIXED):
        if (match := form.fullmatch(text)) and _is_sure(match["name"], match["unit"], slash=form is _SLASHED):
            return match["name"].strip(), match["unit"].strip("()")
    if (match := _IN.fullmatch(text)) and is_known_unit(match["unit"].strip("[]()")):
        return match["name"], match["unit"].strip("[]()")
    return text, None


def is_known_unit(text: str) -> bool:
    """Tell whether `text` is a unit; what cannot be one is not even tried: pint would compute 9**9**9."""
    return _could_be_unit(text) and any(letter.isalpha() or letter in "°℃℉%-1" for letter in text) and is_unit(text)


def _could_be_unit(text: str) -> bool:
    return len(text) <= _LONGEST_UNIT and "**" not in text and _PLAUSIBLE_UNIT.fullmatch(text) is not None


def _first(*parts: str | None) -> str:
    return next(part for part in parts if part is not None).strip()


def _is_sure(name: str, unit: str, slash: bool) -> bool:
    """Tell whether ``name/unit`` or ``name_unit`` is that, and no ratio (F/A), rate (dF/dt) or index (x_1)."""
    unit = unit.strip("()")
    if unit in _UNMISTAKABLE:
        return True
    if unit in _MEASURED_IN or len(unit) == 1:
        words = name.lower().split()
        return bool(words) and (
            words[-1] in _MEASURED_IN.get(unit, "").split() or (slash and _is_long_word(words[-1], unit))
        )
    return slash and re.search(r"[/^°²³%*·]", unit) is not None and is_known_unit(unit)


def _is_long_word(word: str, unit: str) -> bool:
    return len(word) > 2 and len(unit) == 1 and unit in _MEASURED_IN


def names_and_units(texts: Sequence[str]) -> list[tuple[str, str | None]]:
    """Split a whole header; what its columns have in common settles doubts.

    Where some names bear units in square brackets, all square brackets hold units, known or not. Where the names
    without brackets would be the same, they keep them.
    """
    split = [name_and_unit(text) for text in texts]
    if any(unit and "[" in text for text, (_, unit) in zip(texts, split, strict=True)):
        for index, text in enumerate(texts):
            match = _BRACKETED.fullmatch(" ".join(text.split())) if len(text) <= _LONGEST_HEADER else None
            if match and match["square"] and not match["square"].isdigit() and _could_be_unit(match["square"]):
                split[index] = (match["name"], match["square"].strip())
    often = Counter(name for name, _ in split)
    for name, count in often.items():
        if name and count > 1:
            same = [index for index, (other, _) in enumerate(split) if other == name]
            agree = _measure_the_same([split[index][1] for index in same])
            for index in same:
                split[index] = (" ".join(texts[index].split()), split[index][1] if agree else None)
    return split


def _measure_the_same(units: Sequence[str | None]) -> bool:
    try:
        return len({conversion(unit).unit for unit in units if unit is not None}) == 1
    except InputError:
        return False


def unit_in_row(cell: str) -> str | None:
    """Return the unit that one cell of a units row holds: ``(s)``, ``[mm]``, ``kN``."""
    text = cell.translate(_WIDE_BRACKETS).strip()
    if text[:1] + text[-1:] in ("()", "[]", "<>", "{}"):
        text = text[1:-1].strip()
    if text.lower() in _NO_UNITS:
        return None
    return (text or "-") if cell else None


def is_units_row(cells: Sequence[str]) -> bool:
    """Tell whether most cells of a row are units and the others short enough to be units misspelt.

    Of bare letters only those of the units that rigs measure in count: ``t,F,T`` are names, not tonne, farad, tesla.
    """
    filled = [cell for cell in cells if cell][:_MOST_JUDGED]
    if not filled or any(len(cell) > _LONGEST_UNIT for cell in filled):
        return False
    known = [cell for cell in filled if _is_unit_cell(cell) and (_is_word(cell) or cell in _UNIT_LETTERS)]
    words = sum(map(_is_word, known))
    return len(known) >= 0.6 * len(filled) or (words > 1 and len(known) >= 0.5 * len(filled))


def _is_word(cell: str) -> bool:
    """Tell whether a cell is more than a Latin letter; a Chinese or Cyrillic character is a word of its own."""
    return len(cell) > 1 or not cell.isascii()


def is_unknown_units_row(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Tell whether a row under `names` holds units although few or none of them are known.

    It does where all its cells stand in brackets, where units come again and names do not, and where one of the names
    is time's and none of the row's words is.
    """
    filled = [cell for cell in cells if cell]
    if not filled or any(len(cell) > _LONGEST_UNIT or looks_numbered(cell) for cell in filled):
        return False
    if all(cell[:1] + cell[-1:] in ("()", "[]", "<>", "{}") for cell in filled):
        return True
    named = [cell for cell in names if cell]
    bear_units = any(name_and_unit(cell)[1] is not None for cell in named)
    if len(named) < len(filled) or len(set(named)) < len(named) or bear_units:
        return False
    if len(set(filled)) < len(filled):
        return True
    return names_time(names) and not names_time(cells)


def looks_numbered(cell: str) -> bool:
    """Tell whether a word ends in a number of two or more digits, as serial numbers do and units do not."""
    return re.search(r"[0-9]{2}$", cell) is not None


def names_time(cells: Sequence[str]) -> bool:
    """Tell whether one of a row's cells is a name of time, in the languages that logs are written in."""
    return any(_TIME_NAME.fullmatch(name_and_unit(cell)[0].strip()) for cell in cells if cell)


def _is_unit_cell(cell: str) -> bool:
    unit = unit_in_row(cell)
    return unit is not None and not unit.isdigit() and is_known_unit(unit)


def is_underline(cells: Sequence[str]) -> bool:
    """Tell whether a row only rules a line under the names: ``---- ----``."""
    return all(re.fullmatch(r"[-=_+:]*", cell) for cell in cells) and any(len(cell) > 2 for cell in cells)
