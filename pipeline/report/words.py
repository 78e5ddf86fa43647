"""Text that comes from logs and recipes, made fit to be shown: no control signs, known width, broken into lines."""

from __future__ import annotations

import re
import unicodedata

from markupsafe import Markup

_TYPESET = {"+-": "±", "-": "−", "u": "µ", "degC": "°C", "chi2": "χ²", "^2": "²", "^3": "³"}
_TYPEWRITTEN = re.compile(
    r"\+-(?= ?\d)|(?<![^\s(±+])-(?=\d)|(?<=\d )u(?=(?:m|s|g|A|Ah|V|W|N)\b)|(?<=\d )degC\b|(?<=in )degC\b|\bchi2\b|(?<=[A-Za-z)])\^[23](?!\.?\d)"
)
_POWER_OF_TEN = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-])0*(\d+)(?!\w)")
_WRITTEN_OUT = 5  # powers of ten up to it are written out
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def clean(text: str) -> str:
    """Return `text` on one line, without control signs, lone surrogates and signs that turn the reading direction."""
    kept = (" " if _breaks(sign) else sign for sign in text if _breaks(sign) or _shows(sign))
    return "".join(kept).strip()


def typeset(text: str) -> str:
    """Return `text` with the signs that a typewriter lacks: plus-minus, minus before a number, micro, powers."""
    if isinstance(text, Markup):
        return text
    return _POWER_OF_TEN.sub(_power_of_ten, _TYPEWRITTEN.sub(lambda found: _TYPESET[found[0]], text))


def _power_of_ten(found: re.Match[str]) -> str:
    if found[2] == "+" and int(found[3]) <= _WRITTEN_OUT:
        return f"{float(found[0]):.0f}"
    exponent = found[3].translate(_RAISED)
    return f"{found[1]}×10{'⁻' if found[2] == '-' else ''}{exponent}"


def _breaks(sign: str) -> bool:
    return sign.isspace() and unicodedata.category(sign) != "Zs"


def harmless(text: str) -> str:
    """Return `text` with its line breaks, without the signs that `clean` removes."""
    return "".join(sign for sign in text if sign in "\n\t" or _shows(sign))


def _shows(sign: str) -> bool:
    return unicodedata.category(sign) not in ("Cc", "Cs", "Co", "Cn") and not (
        "\u202a" <= sign <= "\u202e" or "\u2066" <= sign <= "\u2069"
    )


def text_width(text: str, size: float) -> float:
    """Return about how wide `text` is at font `size`: on the wide side, so that nothing is clipped."""
    return size * sum(
        0.0
        if unicodedata.combining(sign)
        else 1.0
        if unicodedata.east_asian_width(sign) in "WF"
        else 0.7
        if sign.isupper()
        else 0.58
        for sign in text
    )


def shortened(text: str, width: float, size: float) -> str:
    """Return `text`, or its beginning and an ellipsis where it is wider than `width`."""
    if text_width(text, size) <= width:
        return text
    while text and text_width(text + "…", size) > width:
        text = text[:-1]
    return text.rstrip() + "…"


def wrapped(text: str, width: float, size: float, lines: int = 2) -> list[str]:
    """Break `text` between words into at most `lines` lines of `width`; what is too long ends in an ellipsis."""
    broken: list[str] = []
    for word in clean(text).split(" "):
        if broken and text_width(f"{broken[-1]} {word}", size) <= width:
            broken[-1] += f" {word}"
        else:
            broken.append(word)
    if len(broken) > lines:
        broken[lines - 1 :] = [" ".join(broken[lines - 1 :])]
    return [shortened(line, width, size) for line in broken if line]
