"""Which rows are the control: words of the group column, or of the run, as laboratories write them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pipeline.errors import InputError, listing

_CONTROL = {"c", "k", "control", "controls", "ctrl", "ctl", "ctr", "contr", "cntrl", "kontrolle", "controllo", "controle", "temoin",
            "untreated", "unexposed", "reference", "ref", "blank", "baseline", "neg", "negative", "nc", "0", "false"}  # fmt: skip
_POSITIVE = re.compile(r"\bpos(itive?|\.|_|\b)|lysis|triton|dmso")
_NOTHING = ("", "nan", "none")


def is_control(word: str) -> bool:
    """Tell whether a word names the (negative) control.

    Examples
    --------
    >>> is_control("CTRL 1"), is_control("Positive control"), is_control("RAP")
    (True, False, False)
    """
    if is_positive(word):
        return False
    letters = re.sub(r"[^a-z]", "", word.lower().replace("é", "e").replace("ô", "o"))
    return (
        letters in _CONTROL or word.strip().lower() in _CONTROL or "control" in letters or letters.startswith("untreat")
    )


def is_positive(word: str) -> bool:
    """Tell whether a word names a positive control: cells harmed on purpose, which are no control here."""
    return bool(_POSITIVE.search(word.lower()))


def treated_word(words: Sequence[str], control_group: str, treated_group: str, run: str) -> tuple[str | None, set[str]]:
    """Return the word of the treated group (None where there is none) and those of the control.

    Raises
    ------
    InputError
        If several groups may be the treated one, or a word that the recipe names is in no row.
    """
    present = sorted({word for word in words if word.lower() not in _NOTHING})
    for setting, word in (("control_group", control_group), ("treated_group", treated_group)):
        if word and word.lower() not in {p.lower() for p in present}:
            raise InputError(
                f"run '{run}': the recipe's {setting} is '{word}', but the groups of the log are {listing(present)}. "
                "Write the word as it stands in the log."
            )
    control = (
        {w for w in present if w.lower() == control_group.lower()}
        if control_group
        else {w for w in present if is_control(w)}
    )
    if treated_group:
        return next(w for w in present if w.lower() == treated_group.lower()), control
    others = [w for w in present if w not in control and not is_positive(w)]
    if len(others) > 1:
        raise InputError(
            f"run '{run}' has several groups that are not the control: {listing(others)}. Say in the recipe, under 'settings', "
            "which one is compared (treated_group) and, if it is one of these, which is the control (control_group)."
        )
    return (others[0] if others else None), control
