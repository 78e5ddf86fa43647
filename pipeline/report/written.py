"""Numbers that come written, with their unit and perhaps an error: they stand in a column as other numbers do.

Not for prose: a column is one of numbers only where every text of it is nothing but a number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from pipeline.report.numbers import MINUS, THIN, Reading, aligned_readings

_NUMBER = rf"[+{MINUS}-]?\d[\d{THIN}]*(?:\.\d+)?"
_UNIT = r"[^\W\d_]\S*|[%°‰]\S*"  # one word: 'A', '%', 'mmHg/(mL/min)'
_WRITTEN = re.compile(rf"((?:below |above )?{_NUMBER})(?: ?± ?({_NUMBER}))?(?: ({_UNIT}))?")


def written_numbers(texts: Sequence[str], nothing: str) -> tuple[list[str], str] | None:
    """Return texts with their points under each other, and the unit that all of them have.

    Parameters
    ----------
    texts
        The cells of a column.
    nothing
        What stands where there is no number.

    Returns
    -------
    None where a text is no number or units differ.

    Examples
    --------
    >>> written_numbers(["0.5 A", "10 A"], "–")[1]
    'A'
    >>> written_numbers(["0.5 A", "off"], "–") is None
    True
    """
    found = [None if text in ("", nothing) else _WRITTEN.fullmatch(text) for text in texts]
    if any(one is None and text not in ("", nothing) for one, text in zip(found, texts, strict=True)):
        return None
    units = {one[3] or "" for one in found if one}
    if len(units) != 1:
        return None
    shown = aligned_readings([Reading(one[1], one[2] or "") if one else None for one in found])
    return [text if one else nothing for one, text in zip(found, shown, strict=True)], units.pop()
