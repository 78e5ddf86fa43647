"""What one cell of a table holds: a number, nothing, or text; and how this file writes numbers.

Time stamps are in `stamps`; here nothing is known of rows and columns.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

from pipeline.errors import InputError

# How loggers, spreadsheets and C libraries write "no value", in lower case.
# fmt: off
MISSING = frozenset((
    "", "-", "--", "---", "----", "\u2013", "\u2014", "*", "?", ".", "nan", "-nan", "+nan", "nan(ind)", "-nan(ind)",
    "na", "n/a", "#n/a", "#na", "<na>", "null", "none", "nil", "missing", "1.#qnan", "-1.#qnan", "1.#snan", "1.#ind",
    "-1.#ind", "#nv", "#value!", "#wert!", "#div/0!", "#num!", "#zahl!", "#ref!", "#bezug!",
))
# fmt: on
_INFINITE = frozenset(("inf", "infinity", "1.#inf", "∞"))
_NUMBER = re.compile(r"[+\-\u2212]?(?:[0-9]+(?:\.[0-9]*|,[0-9]+)?|[.,][0-9]+)(?:[eEdD][+-]?[0-9]+)?")
_WITH_POINT = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_SIGNS = ("+", "-", "\u2212")
_LONGEST_NUMBER = 400  # the smallest double, written out
_BLANKS = " \u00a0\u2009\u202f"
# 1,234,567.8: groups of three, the first without leading zero, then perhaps another sign and decimals.
_GROUPED = re.compile(rf"[+\-\u2212]?[1-9][0-9]{{0,2}}([.,'’{_BLANKS}])[0-9]{{3}}(\1[0-9]{{3}})*((?!\1)[.,][0-9]+)?")
_SIGNIFICANT = re.compile(r"[0-9][,'’.\u00a0\u2009\u202f ][0-9]")


def is_missing(text: str) -> bool:
    """Tell whether a trimmed cell says that there is no value."""
    return text == "" or text.lower() in MISSING


@lru_cache(maxsize=1 << 15)  # the cells of a file's head are asked by everyone who looks at it
def is_number(text: str) -> bool:
    """Tell whether a trimmed cell is a number in any of the notations that labs use."""
    text = _sign_joined(text)
    return len(text) <= _LONGEST_NUMBER and (
        _NUMBER.fullmatch(text) is not None
        or _GROUPED.fullmatch(text) is not None
        or text.lstrip("+-\u2212").lower() in _INFINITE
    )


def _sign_joined(text: str) -> str:
    """Return ``+ 1.5``, as some loggers write it, without the blank."""
    return text[0] + text[1:].lstrip() if text[:1] in _SIGNS and text[1:2] == " " else text


@dataclass(frozen=True)
class Notation:
    """How a file writes numbers: the decimal sign, and the sign between thousands ('' for none)."""

    decimal: str = "."
    grouping: str = ""

    def number(self, text: str) -> float | None:
        """Read one trimmed cell: NaN where it says that there is no value, None where it is no number."""
        text = plain = _sign_joined(text)
        if self.grouping and (match := _GROUPED.fullmatch(text)) and self._groups(match[1]):
            plain = text.replace(match[1], "")
        if self.decimal == ",":
            plain = plain.replace(",", ".") if "." not in plain else "x"
        plain = plain.replace("\u2212", "-").replace("D", "e").replace("d", "e")
        if _WITH_POINT.fullmatch(plain):
            return float(plain)
        if is_missing(text):
            return math.nan
        if text.lstrip("+-\u2212").lower() in _INFINITE:
            return -math.inf if text[0] in "-\u2212" else math.inf
        return None

    def numbers(self, texts: Sequence[str]) -> list[float | None]:
        """Read a column of trimmed cells as `number` does."""
        if self.decimal == "." and not self.grouping:
            joined = "\n".join(texts)
            # Python takes 1_000 and other scripts' digits for numbers; logs do not write them.
            if joined.isascii() and "_" not in joined:
                try:
                    return [float(text) for text in texts]
                except ValueError:
                    pass
        return [self.number(text) for text in texts]

    def _groups(self, sign: str) -> bool:
        return sign == self.grouping or (sign in _BLANKS and self.grouping in _BLANKS)


def notation(texts: Iterable[str], where: str) -> tuple[Notation, str | None]:
    """Tell how the numbers among `texts` are written, and an example where that stays doubtful.

    A sign with other than three digits behind it, or behind a zero, is the decimal one; repeated signs, and those
    before the decimal sign, part thousands. ``1,234`` alone could be both: it is read as a decimal and returned.

    Raises
    ------
    InputError
        If some numbers have a decimal point and others a decimal comma.
    """
    decimals: dict[str, str] = {}
    groups: dict[str, str] = {}
    doubtful: dict[str, str] = {}
    for text in texts:
        if not _SIGNIFICANT.search(text):
            if text[:1] in (".", ",") and _NUMBER.fullmatch(text):
                decimals.setdefault(text[0], text)
            continue
        if match := _GROUPED.fullmatch(text):
            if match[3] or match[2] or match[1] not in ".,":
                groups.setdefault(" " if match[1] in _BLANKS else match[1], text)
                if match[3]:
                    decimals.setdefault(match[3][0], text)
            else:
                doubtful.setdefault(match[1], text)
        elif _NUMBER.fullmatch(text):
            decimals.setdefault("," if "," in text else ".", text)
    clash = list(decimals.values()) + [groups[sign] for sign in decimals if sign in groups]
    if len(clash) > 1:
        raise InputError(
            f"{where}: some numbers have a decimal point and others a decimal comma ('{clash[0]}' and '{clash[1]}'); "
            "which is meant is unclear. Write all numbers of the file alike."
        )
    if len(doubtful) > 1 and not decimals and not groups:
        raise InputError(
            f"{where}: holds numbers such as '{doubtful['.']}' and '{doubtful[',']}'; which sign is the decimal one "
            "is unclear. Write all numbers of the file alike."
        )
    if decimals:
        (decimal,) = decimals
    elif groups:
        decimal = "," if "." in groups else "."
    else:
        decimal = "," if "," in doubtful else "."
    other = "," if decimal == "." else "."
    grouping = next(iter(groups), other if decimals and other in doubtful else "")
    doubt = doubtful.get(",") if not decimals and not groups else None
    return Notation(decimal, grouping), doubt


def doubtful_points(columns: Iterable[Sequence[str]]) -> str | None:
    """Return a number whose point may part thousands, None where none may: for files without any other decimal sign.

    In such a column each point has one to three digits before it, no leading zero, and exactly three behind, and
    whole numbers without a point stand beside them. With three decimals all of them would have a point.
    """
    doubtful = None
    for texts in columns:
        with_point = [text for text in texts if "." in text]
        without = [text for text in texts if "." not in text and is_number(text)]
        if not all((match := _GROUPED.fullmatch(text)) and match[1] == "." and not match[3] for text in with_point):
            return None
        if with_point and without and all(len(text.lstrip("+-\u2212")) <= 3 for text in without):
            doubtful = doubtful or with_point[0]
    return doubtful
