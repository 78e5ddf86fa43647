"""Conditions of the bearing rig that need reading: lists of numbers, static load, operating point."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Condition, Recording
from pipeline.recording.units import conversion
from pipeline.rigs.tpjb.axes import pad_directions

_ITEM = re.compile(r"([-+−]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s,;+−.-][^\s,;]*)?")


def numbers_of(text: Condition, unit: str, *, run: str = "", name: str = "list of numbers") -> tuple[float, ...]:
    """Return the numbers of a condition such as ``"7 11 13 Hz"``, in SI.

    Parameters
    ----------
    text
        Numbers parted by blanks, commas or semicolons, in brackets or not, with a unit after the
        last or after each; a bare number is taken as it is.
    unit
        SI unit of the result and of numbers without one.
    run, name
        For the message.

    Raises
    ------
    InputError
        If the text holds no numbers, something else beside them, or a unit of another dimension.

    Examples
    --------
    >>> numbers_of("7, 11, 13 Hz", "Hz")
    (7.0, 11.0, 13.0)
    >>> [round(a, 4) for a in numbers_of("45deg 135deg", "rad")]
    [0.7854, 2.3562]
    """
    where = f"run '{run}', {name}" if run else name
    if isinstance(text, int | float) and not isinstance(text, bool):
        return (float(text),)
    stripped = re.sub(r"[\[\](){}]", " ", str(text)).strip()
    parts = [part for part in re.split(r"[;\s]+|,\s+", stripped) if part[:1] in "+-−.0123456789"]
    if len(parts) > 1 and all(part.count(",") <= 1 for part in parts):
        # A comma between digits beside another separator is a decimal comma: 7,5 11,2 Hz.
        stripped = re.sub(r"(?<=\d),(?=\d)", ".", stripped)
    items = _ITEM.findall(stripped)
    if not items or _ITEM.sub("", stripped).strip(" ,;\t\n"):
        raise InputError(f"{where}: '{text}' is no list of numbers; write for example '7 11 13 {unit}'.")
    units = {found for _, found in items if found}
    if len(units) > 1:
        raise InputError(f"{where}: '{text}' mixes the units {', '.join(sorted(units))}; write all in one.")
    to_si = conversion(units.pop(), unit, where) if units else conversion(unit, unit, where)
    return tuple(float(to_si(float(number.replace("−", "-")))) for number, _ in items)


def pad_angles_of(recording: Recording, n_pads: int | None = None) -> np.ndarray | None:
    """Return the directions of the pads, rad from x, shape (N,), in the order in which they are numbered.

    From the condition `pad_angles`, else with the load between two of `n_pads` pads; None where
    neither is given.

    Raises
    ------
    InputError
        If the angles are not N directions all round, or bare numbers beyond a turn.
    """
    text = recording.conditions.get("pad_angles")
    if text is None or text == "":
        n_pads = n_pads or n_pads_of(recording)
        return None if n_pads is None else pad_directions(n_pads)
    angles = np.array(numbers_of(text, "rad", run=recording.run, name="pad_angles"))
    where = f"run '{recording.run}', pad_angles '{text}'"
    if np.abs(angles).max() > 4 * math.pi:
        raise InputError(f"{where}: numbers without a unit are rad, these are beyond two turns; write '{text} deg'.")
    turned = np.sort(angles % (2 * math.pi))
    steps = np.diff(np.append(turned, turned[0] + 2 * math.pi))
    if angles.size < 3 or steps.min() < 0.2 or steps.max() >= math.pi:
        raise InputError(
            f"{where}: expected the directions of at least three different pads all round, for example "
            "'45 135 225 315 deg'."
        )
    stated = n_pads_of(recording)
    if stated is not None and stated != angles.size:
        raise InputError(f"{where}: {angles.size} angles, but n_pads is {stated}; mend one of them.")
    return np.asarray(angles % (2 * math.pi))


def n_pads_of(recording: Recording) -> int | None:
    """Return the number of pads that the run states; None where it states none.

    Raises
    ------
    InputError
        If it is no whole number from 3 to 12.
    """
    value = recording.conditions.get("n_pads")
    if value is None or value == "":
        return None
    number = recording.condition("n_pads")
    if number != round(number) or not 3 <= number <= 12:
        raise InputError(f"run '{recording.run}': n_pads is {value!r}; expected a whole number from 3 to 12.")
    return round(number)


def static_load_of(recording: Recording) -> float | None:
    """Return the static load, N: the condition, else the mean of `force_static`, else None."""
    value = recording.conditions.get("static_load")
    if value is not None and value != "":
        return recording.condition("static_load")
    return mean_of(recording, "force_static")


def shaft_speed_of(recording: Recording) -> float | None:
    """Return the shaft speed, rad/s: as set (`shaft_speed_nominal`), else the mean of `speed`, else None."""
    value = recording.conditions.get("shaft_speed_nominal")
    if value is not None and value != "":
        return recording.condition("shaft_speed_nominal")
    return mean_of(recording, "speed")


def mean_of(recording: Recording, channel: str) -> float | None:
    """Return the mean of a channel, block by block; None where there is none, or no number in it."""
    if channel not in recording:
        return None
    total, count = 0.0, 0
    for _, (values,) in recording.stream_of(channel).blocks([channel]):
        finite = values[np.isfinite(values)]
        total, count = total + float(finite.sum()), count + finite.size
    return total / count if count else None


def rounded(value: float, digits: int = 4) -> float:
    """Return `value` to so many significant digits, so that operating points can be compared."""
    return float(f"{value:.{digits}g}")


def operating_point(recording: Recording) -> dict[str, float | str | bool]:
    """Return the run group ``{"static_load": N, "shaft_speed": rad/s}``, what is known of it, to 4 digits."""
    load, speed = static_load_of(recording), shaft_speed_of(recording)
    known = {"static_load": load, "shaft_speed": speed}
    return {name: rounded(value) for name, value in known.items() if value is not None}


def run_groups(
    recordings: Sequence[Recording], tolerance: float = 0.02
) -> list[tuple[dict[str, float | str | bool], list[Recording]]]:
    """Gather runs at the same bearing, static load and shaft speed, in the order of their first run.

    Loads and speeds within the relative `tolerance` are the same: measured ones never repeat to the
    last digit. The group bears the operating point of its first run.
    """
    groups: list[tuple[dict[str, float | str | bool], list[Recording]]] = []
    for recording in recordings:
        here = operating_point(recording)
        for at, members in groups:
            bearing = recording.conditions.get("bearing") == members[0].conditions.get("bearing")
            if bearing and here.keys() == at.keys() and all(_close(here[k], at[k], tolerance) for k in here):
                members.append(recording)
                break
        else:
            groups.append((here, [recording]))
    return groups


def _close(a: float | str | bool, b: float | str | bool, tolerance: float) -> bool:
    return abs(float(a) - float(b)) <= tolerance * max(abs(float(a)), abs(float(b)), 1e-9)
