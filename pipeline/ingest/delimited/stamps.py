"""Absolute time stamps -> nanoseconds, exactly, and seconds since the first of them.

Dates of any usual order, times of day (midnight and the full hour of ``mm:ss.0`` are unwrapped) and the
counts since 1970 that loggers write. A bare number that may as well be elapsed time is no stamp.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from functools import cache, lru_cache

import numpy as np

NOT_A_TIME = int(np.iinfo(np.int64).min)
_EPOCH = date(1970, 1, 1).toordinal()
_SECOND = 1_000_000_000
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MOST_KNOWN = 100_000
_LONGEST_STEP = 600 * _SECOND

_TIME = r"(?P<h>[0-9]{1,3}):(?P<mi>[0-9]{2}):(?P<s>[0-9]{2})(?:[.,:](?P<f>[0-9]+))?"
_TO_THE_MINUTE = r"(?P<h>[0-9]{1,2}):(?P<mi>[0-9]{2})"
_MINUTES = r"(?P<mi>[0-9]{1,2}):(?P<s>[0-9]{2})[.,](?P<f>[0-9]+)"
_COMPACT_TIME = r"(?P<h>[0-9]{2})(?P<mi>[0-9]{2})(?P<s>[0-9]{2})(?:[.,]?(?P<f>[0-9]+))?"
_HALF = r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
_ZONE = r"(?:\s*(?P<z>Z|UTC|GMT|[+-][0-9]{2}:?[0-9]{2}))?"
_BETWEEN = r"(?:T|\s+|_|/|,\s*|;\s*)"
_DAY, _MONTH, _YEAR = r"(?P<d>[0-9]{1,2})", r"(?P<mo>[0-9]{1,2})", r"(?P<y>[0-9]{4})"
_ANY_YEAR = r"(?P<y>[0-9]{4}|[0-9]{2})"
_DATES = {
    "year-month-day": rf"{_YEAR}[-/.]{_MONTH}[-/.]{_DAY}",
    "day.month.year": rf"{_DAY}\.{_MONTH}\.{_ANY_YEAR}",
    "day/month/year": rf"{_DAY}[/-]{_MONTH}[/-]{_ANY_YEAR}",
    "month/day/year": rf"{_MONTH}[/-]{_DAY}[/-]{_ANY_YEAR}",
    "day-month-year": rf"{_DAY}[-/ .](?P<mo>[A-Za-z]{{3}})[a-z]*\.?[-/ ]{_YEAR}",
    "年月日": rf"{_YEAR}年{_MONTH}月{_DAY}日",
}
_DATE_ALONE = re.compile("|".join(re.sub(r"\?P<\w+>", "?:", text) for text in _DATES.values()))


@dataclass(frozen=True)
class StampFormat:
    """One way to write instants.

    `period` (ns) is when a clock without date starts again, 0 for never; `scale` (ns) the unit of a count.
    """

    name: str
    pattern: re.Pattern[str]
    has_date: bool = False
    period: int = 0
    scale: int = 0
    _known: dict[str, int] = field(default_factory=dict, compare=False, repr=False)

    def instant(self, text: str) -> int:
        """Return nanoseconds since 1970 (since midnight without a date), NOT_A_TIME if `text` is none."""
        match = self.pattern.fullmatch(text)
        if match is None:
            return NOT_A_TIME
        part = match.groupdict()
        if self.scale:
            return int(part["n"]) * self.scale + _fraction(part["f"]) * self.scale // _SECOND
        hour, minute, second = (int(part.get(name) or 0) for name in ("h", "mi", "s"))
        if half := part.get("half"):
            hour = hour % 12 + (12 if half in "Pp" else 0)
        if minute > 59 or second > 60 or (self.has_date and hour > 24):
            return NOT_A_TIME
        days = _days(part["y"], part["mo"], part["d"]) if self.has_date else 0
        if days is None:
            return NOT_A_TIME
        seconds = ((days * 24 + hour) * 60 + minute) * 60 + second - _zone(part.get("z"))
        return seconds * _SECOND + _fraction(part.get("f"))

    def has_zone(self, text: str) -> bool:
        """Tell whether a stamp says how far it is from Greenwich."""
        match = self.pattern.fullmatch(text)
        return match is not None and match.groupdict().get("z") is not None

    def instants(self, texts: Sequence[str]) -> np.ndarray:
        """Return `instant` of every cell, int64 of shape (n,).

        Stamps mostly differ in their decimals alone: what stands before them is understood once.
        """
        known, result = self._known, np.empty(len(texts), np.int64)
        if len(known) > _MOST_KNOWN:
            known.clear()
        for index, text in enumerate(texts):
            whole, _, rest = text.rpartition("." if "," not in text else ",")
            if self.scale or ":" not in whole:
                result[index] = self.instant(text)
                continue
            tail = rest.lstrip("0123456789")  # a zone, or the half of the day
            fraction = _fraction(rest[: len(rest) - len(tail)])
            start = known.get(whole + tail)
            if start is None:
                instant = self.instant(text)
                if instant == NOT_A_TIME:
                    result[index] = instant
                    continue
                start = known[whole + tail] = instant - fraction
            result[index] = start + fraction
        return result


def _fraction(digits: str | None) -> int:
    return int((digits + "000000000")[:9]) if digits else 0


@lru_cache(maxsize=4096)
def _days(year: str, month: str, day: str) -> int | None:
    """Return days since 1970, None for a day that does not exist."""
    number = int(year) + (2000 if len(year) == 2 else 0)
    named = month[:3].lower()
    try:
        which = _MONTHS.index(named) + 1 if named.isalpha() else int(month)
        return date(number, which, int(day)).toordinal() - _EPOCH if 1900 <= number <= 2200 else None
    except ValueError:
        return None


def _zone(zone: str | None) -> int:
    """Return seconds east of Greenwich."""
    if not zone or zone[0] not in "+-":
        return 0
    seconds = int(zone[1:3]) * 3600 + int(zone[-2:]) * 60
    return -seconds if zone[0] == "-" else seconds


@cache
def _formats() -> tuple[StampFormat, ...]:
    formats = [
        StampFormat(f"{name}, time of day", re.compile(f"{pattern}{_BETWEEN}{clock}{_HALF}{_ZONE}"), has_date=True)
        for name, pattern in _DATES.items()
        for clock in (_TIME, _TO_THE_MINUTE)
    ]
    compact = rf"{_YEAR}(?P<mo>[0-9]{{2}})(?P<d>[0-9]{{2}})[T _-]?{_COMPACT_TIME}{_ZONE}"
    return (
        *formats,
        StampFormat("yyyymmdd hhmmss", re.compile(compact.replace("[T _-]?", "[T _-]")), has_date=True),
        StampFormat("time of day", re.compile(f"{_TIME}{_HALF}{_ZONE}"), period=86400 * _SECOND),
        StampFormat("minutes:seconds", re.compile(_MINUTES), period=3600 * _SECOND),
    )


def looks_like_stamp(text: str) -> bool:
    """Tell whether a trimmed cell is a date, a time of day or both."""
    if not text[:1].isdigit() or len(text) > 40:
        return False
    return _DATE_ALONE.fullmatch(text) is not None or any(f.instant(text) != NOT_A_TIME for f in _formats())


def is_date_alone(text: str) -> bool:
    """Tell whether a trimmed cell is a date without a time of day."""
    return _DATE_ALONE.fullmatch(text) is not None


def stamp_format(texts: Sequence[str]) -> StampFormat | None:
    """Return the format that nine in ten of `texts` have, None where there is none.

    Where day and month could be either, the order that keeps the stamps closer together wins, then the day first.
    """
    found: list[tuple[int, int, StampFormat]] = []
    for candidate in _formats():
        if candidate.instant(texts[0]) == candidate.instant(texts[-1]) == NOT_A_TIME:
            continue
        instants = candidate.instants(texts)
        good = instants[instants != NOT_A_TIME]
        if good.size >= 0.9 * len(texts):
            month_first = candidate.name.startswith("month") and bool(re.search("[AaPp]\\.?[Mm]", texts[0]))
            found.append((int(good.max() - good.min()), -int(month_first), candidate))
    return min(found, key=lambda entry: entry[:2])[2] if found else None


def is_order_doubtful(texts: Sequence[str]) -> bool:
    """Tell whether day and month of the dates could be the other way round."""
    first, second = (f for f in _formats() if f.name in ("day/month/year, time of day", "month/day/year, time of day")
                     and "(?P<s>" in f.pattern.pattern)  # fmt: skip
    if any(re.search("[AaPp]\\.?[Mm]", text) for text in texts):
        return False
    both = [(first.instant(text), second.instant(text)) for text in texts]
    return all(NOT_A_TIME not in pair and pair[0] != pair[1] for pair in both)


_COUNT = r"(?P<n>[0-9]{%d})(?:[.,](?P<f>[0-9]+))?"
_COUNTS = {
    "seconds since 1970": StampFormat("seconds since 1970", re.compile(_COUNT % 10), True, 0, _SECOND),
    "milliseconds since 1970": StampFormat("milliseconds since 1970", re.compile(_COUNT % 13), True, 0, 10**6),
    "microseconds since 1970": StampFormat("microseconds since 1970", re.compile(_COUNT % 16), True, 0, 10**3),
    "nanoseconds since 1970": StampFormat("nanoseconds since 1970", re.compile(_COUNT % 19), True, 0, 1),
}
_COUNT_OF_UNIT = {"s": "seconds", "sec": "seconds", "ms": "milliseconds", "us": "microseconds",
                  "µs": "microseconds", "μs": "microseconds", "ns": "nanoseconds"}  # fmt: skip
_TIME_NAME = re.compile(
    r"(.*[._\s/])?(time|t|ts|stamp|time_?stamp|epoch|unix.*|zeit|zeitstempel|utc|secs|nsecs|时间|时间戳|時間)", re.I
)


def count_format(name: str, unit: str | None, texts: Sequence[str]) -> StampFormat | None:
    """Return the format of a time column that counts from 1970: instants of 2000 to 2065 in order, else None."""
    if not _TIME_NAME.fullmatch(name) or not texts:
        return None
    for count in _COUNTS.values():
        if unit is not None and _COUNT_OF_UNIT.get(unit, unit) != count.name.split()[0]:
            continue
        instants = [count.instant(text) for text in texts]
        in_window = all(946_684_800 <= instant // _SECOND < 3_000_000_000 for instant in instants)
        # Microseconds since the start can be as large as seconds since 1970, but then the steps are not those of a rig.
        is_sampled = instants[-1] - instants[0] <= _LONGEST_STEP * len(instants)
        if in_window and is_sampled and instants == sorted(instants):
            return count
    return None


def iso(instant: int, has_zone: bool) -> str:
    """Return an instant (ns since 1970) as ISO 8601 text."""
    seconds, rest = divmod(instant, _SECOND)
    text = datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return text + (f".{rest:09d}".rstrip("0") if rest else "") + ("Z" if has_zone else "")


class Clock:
    """Seconds since the first stamp, from blocks of instants in file order."""

    def __init__(self, start: int, period: int) -> None:
        self._start, self._period = start, period
        self._last, self._turns = start, 0

    def seconds(self, instants: np.ndarray) -> np.ndarray:
        """Return seconds since the start, float64 (n,), NaN for missing stamps; a clock that turned over goes on."""
        present = instants != NOT_A_TIME
        result = np.full(instants.size, np.nan)
        times = instants[present]
        if not times.size:
            return result
        turns: np.ndarray | int = 0
        if self._period:
            steps = np.diff(times, prepend=self._last)
            turns = self._turns + np.cumsum(steps < -self._period // 2)
            self._turns = int(turns[-1])
        self._last = int(times[-1])
        result[present] = (times - self._start + turns * self._period) / _SECOND
        return result
