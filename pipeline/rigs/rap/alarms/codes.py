"""The alarm codes and what other words for them are understood (rap.md, 3.9 and 11; the paper's numbers are lost)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from pipeline.rigs.rap.tables import Entry

CODES = {
    "ACCESS_OCCLUDED": "access line occluded",
    "ACCESS_DISCONNECTED": "access line disconnected",
    "FILTER_COAGULATION": "filter coagulated at its inlet or fibres",
    "RETURN_OCCLUDED": "return line occluded or clotted (the two look alike)",
    "RETURN_DISCONNECTED": "return line disconnected",
    "MEMBRANE_COAGULATION": "membrane coagulated",
    "UF_LINE_OPEN": "ultrafiltrate line open",
    "PRESSURE_OUT_OF_RANGE": "pressure out of range",
    "PROLONGED_STAGNATION": "blood stands too long",
    "SENSOR_MISMATCH": "the two units read different pressures",
    "AIR": "air in the blood line",
    "BLOOD_LEAK": "blood in the ultrafiltrate",
    "EMERGENCY_STOP": "emergency button pressed",
    "WATCHDOG": "watchdog not served",
}
_NOTHING = {
    "",
    "0",
    "0.0",
    "none",
    "no",
    "ok",
    "nan",
    "null",
    "-",
    "--",
    "clear",
    "cleared",
    "normal",
    "reset",
    "off",
    "noalarm",
    "false",
}
# Stems that must all stand in the letters of a logged word; the first line that fits decides.
_STEMS = (
    ("EMERGENCY_STOP", ("emerg",)),
    ("EMERGENCY_STOP", ("estop",)),
    ("PROLONGED_STAGNATION", ("stagn",)),
    ("SENSOR_MISMATCH", ("mismatch",)),
    ("SENSOR_MISMATCH", ("redundan",)),
    ("BLOOD_LEAK", ("leak",)),
    ("AIR", ("bubble",)),
    ("WATCHDOG", ("watchdog",)),
    ("PRESSURE_OUT_OF_RANGE", ("range",)),
    ("UF_LINE_OPEN", ("uf", "open")),
    ("UF_LINE_OPEN", ("uf", "disconn")),
    ("ACCESS_DISCONNECTED", ("acc", "disc")),
    ("RETURN_DISCONNECTED", ("ret", "disc")),
    ("RETURN_DISCONNECTED", ("ven", "disc")),
    ("MEMBRANE_COAGULATION", ("membran",)),
    ("MEMBRANE_COAGULATION", ("tmp",)),
    ("ACCESS_OCCLUDED", ("acc", "occl")),
    ("ACCESS_OCCLUDED", ("arter", "occl")),
    ("ACCESS_OCCLUDED", ("acc", "clog")),
    ("RETURN_OCCLUDED", ("ret", "occl")),
    ("RETURN_OCCLUDED", ("ret", "coag")),
    ("RETURN_OCCLUDED", ("ret", "clot")),
    ("RETURN_OCCLUDED", ("ven", "occl")),
    ("FILTER_COAGULATION", ("filt",)),
)  # fmt: skip
# Rows of one word no further apart than this are one alarm, s; so many steps show how often a column repeats it.
_SAME, _OFTEN = 5.0, 10
_SEVERAL = re.compile(r"[;|,+]")
_AIR = re.compile(r"(^|[^a-z])air([^a-z]|$)")


def is_clear(word: str) -> bool:
    """Tell whether a logged word says that no alarm is on."""
    return re.sub(r"[\s_]", "", word.lower()) in _NOTHING


def understood(word: str) -> str | None:
    """Return the code of `CODES` that a logged word means; None where it names none.

    Examples
    --------
    >>> understood("Return line clotted"), understood("AIR"), understood("E17")
    ('RETURN_OCCLUDED', 'AIR', None)
    """
    plain = re.sub(r"[^a-z]", "", word.lower())
    exact = {re.sub(r"[^a-z]", "", code.lower()): code for code in CODES}
    if plain in exact:
        return exact[plain]
    if _AIR.search(word.lower().replace("_", " ")):
        return "AIR"
    return next((code for code, stems in _STEMS if all(stem in plain for stem in stems)), None)


def onsets(rows: Sequence[Entry]) -> list[Entry]:
    """Return the rows at which a word begins.

    A word written again before another one said that all is clear, and no later than three times its usual distance, is the
    same alarm: a column of codes repeats it in every row.
    """
    words = [(row.time, word.strip()) for row in rows for word in _SEVERAL.split(row.text)]
    apart = {word: _apart([time for time, other in words if other == word]) for word in {word for _, word in words}}
    begun: list[Entry] = []
    last: dict[str, float] = {}
    for time, word in words:
        if is_clear(word):
            last.clear()
            continue
        if word not in last or time - last[word] > apart[word]:
            begun.append(Entry(time, word))
        last[word] = time
    return begun


def _apart(times: Sequence[float]) -> float:
    steps = sorted(b - a for a, b in pairwise(times))
    return max(_SAME, 3.0 * steps[len(steps) // 2]) if len(steps) >= _OFTEN else _SAME
