"""The alarm codes and what other words for them are understood (rap.md, 3.9 and 11; the paper's numbers are lost)."""

from __future__ import annotations

import re

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


def onsets(rows: tuple[Entry, ...], apart: float = 60.0) -> list[Entry]:
    """Return the rows at which a word begins: repeats of it, no more than `apart` seconds behind the last, are the same alarm."""
    begun: list[Entry] = []
    last: dict[str, float] = {}
    for row in rows:
        for word in re.split(r"[;|,+]", row.text):
            word = word.strip()
            if is_clear(word):
                last.clear()
                continue
            if word not in last or row.time - last[word] > apart:
                begun.append(Entry(row.time, word))
            last[word] = row.time
    return begun
