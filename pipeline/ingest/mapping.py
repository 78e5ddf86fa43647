"""From the names of a log to the names of the rig: which raw channel is which canonical one, in which unit.

A recipe's entry wins; without one a channel that bears the canonical name is taken. What cannot be
told is asked for with the line that the recipe lacks. Time is found by `pipeline.ingest.timebase`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.errors import InputError, listing, nearest
from pipeline.ingest.naming import ChannelLike, likely, matching, plain, recipe_line, shown
from pipeline.ingest.reader import RawChannel, RawLog, RawTable
from pipeline.recording import QualityFinding
from pipeline.recording.units import Conversion, conversion


@dataclass(frozen=True)
class ChannelMap:
    """How a canonical channel is found in a log and becomes SI.

    The logged number x stands for ``sign * (scale * x + offset)`` in `unit`. Without `channel` the
    canonical name is looked for, without `unit` the one that the log declares counts. `table` is the
    topic, file or table, needed where several hold that name. `rate` (Hz) is for ``time`` only: the
    samples are counted, with `channel` by the one that numbers them; so is `stamp`: which sample of a block under one stamp that is, ``first`` or ``last``.
    """

    channel: str | None = None
    unit: str | None = None
    sign: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    table: str | None = None
    rate: float | None = None
    stamp: str | None = None


@dataclass(frozen=True)
class Source:
    """A table of one of a run's files: `shown` is the file as messages name it, `stream` what it is called here."""

    log: RawLog
    table: RawTable
    shown: str
    stream: str = ""

    @property
    def where(self) -> str:
        """The file, and the table where it has several."""
        return f"{self.shown}, table '{self.table.name}'" if len(self.log.tables) > 1 else self.shown


@dataclass(frozen=True)
class SelectedChannel:
    """A raw channel that is taken: its canonical name, and ``si = raw * factor + offset`` in `unit` ('' for text).

    `taken_as` is the unit that the logged numbers were taken to have.
    """

    name: str
    raw: RawChannel
    unit: str
    taken_as: str = ""
    factor: float = 1.0
    offset: float = 0.0
    required: bool = False
    limit: float | None = None
    counts_samples: bool = False
    lists_entries: bool = False
    no_value: float | None = None
    may_rest: bool = False

    def si(self, raw: np.ndarray) -> np.ndarray:
        """Return samples (n,) in SI; words stay words, numbers of a text channel become words."""
        if self.unit == "" and not self.raw.is_text:
            return np.array([f"{value:g}" for value in raw], dtype=object)
        if self.unit == "" or (self.factor == 1.0 and self.offset == 0.0):
            return raw
        return raw * self.factor + self.offset if self.offset else raw * self.factor


@dataclass(frozen=True)
class Selection:
    """What is taken of one table, in the order of the declarations; `left_out` are raw names nobody asked for."""

    source: Source
    channels: tuple[SelectedChannel, ...]
    left_out: tuple[str, ...] = ()
    notes: tuple[QualityFinding, ...] = ()


class _Column(NamedTuple):
    place: int
    source: Source
    channel: RawChannel


def resolve(
    sources: Sequence[Source], specs: Sequence[ChannelLike], maps: Mapping[str, ChannelMap]
) -> tuple[Selection, ...]:
    """Find the declared channels in the tables of a run.

    Parameters
    ----------
    specs
        The declared channels.
    maps
        The recipe's entries by canonical name; ``time`` is not looked at.

    Returns
    -------
    selections
        One for each table that holds a declared channel, in the order of `sources`.

    Raises
    ------
    InputError
        If a required channel, or one that the recipe names, is not there or not unique, is text, or
        its unit is missing or wrong: the text names the file, lists what it has and shows the line
        that the recipe needs.
    """
    columns = [_Column(place, s, channel) for place, s in enumerate(sources) for channel in s.table.channels]
    if specs:
        refuse_time_alone(sources)
    taken: dict[int, list[SelectedChannel]] = {}
    notes: dict[int, list[QualityFinding]] = {}
    used: set[tuple[int, str]] = set()
    for spec in specs:
        entry = maps.get(spec.name, ChannelMap())
        column = _column_for(spec, entry, columns, sources, notes)
        if column is None:
            continue
        selected = _selected(spec, entry, column, notes.setdefault(column.place, []))
        if selected is not None:
            taken.setdefault(column.place, []).append(selected)
            used.add((column.place, column.channel.name))
    return tuple(
        Selection(
            sources[place],
            tuple(taken[place]),
            tuple(c.name for c in sources[place].table.channels if (place, c.name) not in used),
            tuple(notes.get(place, ())),
        )
        for place in sorted(taken)
    )


def refuse_time_alone(sources: Sequence[Source]) -> None:
    """Raise InputError where logs have no more than one column, and that is time."""
    channels = [channel for source in sources for channel in source.table.channels]
    if len(channels) == len(sources) and all(_is_time(channel.name) for channel in channels):
        files = listing(dict.fromkeys(source.shown for source in sources))
        raise InputError(
            f"{files}: holds only a time column ('{channels[0].name}') and nothing that was measured. Expected is a "
            "column a channel beside it: export the log again with its channels, or check how its columns are parted."
        )


def _is_time(name: str) -> bool:
    return name.strip() == "t" or plain(name) in ("time", "log_time")


def columns_listing(sources: Sequence[Source]) -> str:
    """List the channels of tables with their units for a message."""
    if len(sources) == 1:
        return shown(sources[0].table.channels)
    return "; ".join(f"in '{source.stream or source.table.name}': {shown(source.table.channels)}" for source in sources)


def _column_for(
    spec: ChannelLike,
    entry: ChannelMap,
    columns: Sequence[_Column],
    sources: Sequence[Source],
    notes: dict[int, list[QualityFinding]],
) -> _Column | None:
    """Return the column that is `spec`, None where an optional one is missing or not to be told."""
    files = listing(dict.fromkeys(source.shown for source in sources))
    if entry.table is not None:
        columns = [column for column in columns if is_table(entry.table, column.source)]
        if not columns:
            known = [source.stream or source.table.name for source in sources]
            raise InputError(
                f"{files}: the recipe takes '{spec.name}' from the table '{entry.table}', which is not there."
                f"{nearest(entry.table, known)} Tables are: {listing(f'{name!r}' for name in known)}."
            )
    wanted = entry.channel or spec.name
    found = [columns[at] for at in matching(wanted, [column.channel for column in columns])]
    if len(found) > 1:
        message = _ambiguous(spec, wanted, found, files)
        if spec.required or entry != ChannelMap():
            raise InputError(message)
        warning = QualityFinding("warning", f"{message} It is left out.", channel=spec.name)
        notes.setdefault(found[0].place, []).append(warning)
        return None
    if found:
        return found[0]
    if entry.channel is None and not spec.required:
        return None
    guess = likely(spec, [column.channel for column in columns])
    if entry.channel is not None:
        raise InputError(
            f"{files}: the recipe says that '{spec.name}' is the channel '{entry.channel}', which the log lacks."
            f"{nearest(entry.channel, (c.channel.name for c in columns))} The log has: {columns_listing(sources)}. "
            f"Mend the recipe's line, under 'channels': {recipe_line(spec, guess)}."
        )
    unit = f" ({spec.description}; in {spec.unit})" if spec.unit else f" ({spec.description}; text)"
    raise InputError(
        f"{files}: the channel '{spec.name}'{unit} is missing. The log has: {columns_listing(sources)}. "
        f"Say in the recipe which of them it is, under 'channels': {recipe_line(spec, guess)}."
    )


def _selected(
    spec: ChannelLike, entry: ChannelMap, column: _Column, notes: list[QualityFinding]
) -> SelectedChannel | None:
    """Return the channel with its way to SI; None for an optional one that holds words instead of numbers."""
    raw, where = column.channel, f"{column.source.where}, channel '{column.channel.name}'"
    if spec.unit == "":
        return SelectedChannel(spec.name, raw, "", required=spec.required, lists_entries=spec.lists_entries)
    if raw.is_text:
        place, text = _first_text(column)
        said = f"holds text and not numbers: '{text[:40]}' in {place}" if place else "holds no numbers"
        if spec.required or entry.channel is not None:
            raise InputError(
                f"{where}: {said}; '{spec.name}' ({spec.description}) needs numbers. "
                f"Mend the log, or name another channel in the recipe: {recipe_line(spec, None)}."
            )
        notes.append(
            QualityFinding("warning" if place else "note", f"{where} {said}; it is left out.", channel=spec.name)
        )
        return None
    unit = _unit(spec, entry, raw, where, notes)
    to_si = _conversion(unit, spec, entry, where)
    return SelectedChannel(
        spec.name,
        raw,
        spec.unit,
        unit,
        entry.sign * entry.scale * to_si.factor,
        entry.sign * (entry.offset * to_si.factor + to_si.offset),
        spec.required,
        spec.limit,
        spec.counts_samples,
        spec.lists_entries,
        spec.no_value,
        spec.may_rest,
    )


def _unit(spec: ChannelLike, entry: ChannelMap, raw: RawChannel, where: str, notes: list[QualityFinding]) -> str:
    """Return the unit of the logged numbers: by the recipe, by the log, or SI for a canonical name."""
    if entry.unit is not None:
        calibrated = entry.scale != 1.0 or entry.offset != 0.0
        if raw.unit and raw.unit.strip() != entry.unit.strip() and not calibrated:
            notes.append(
                QualityFinding(
                    "warning",
                    f"{where}: the log gives the unit '{raw.unit}', the recipe '{entry.unit}'; the recipe's is used.",
                    channel=spec.name,
                )
            )
        return entry.unit
    if raw.unit:
        return raw.unit
    if spec.unit in ("1", "count"):
        return spec.unit
    if entry.channel is not None and not matching(spec.name, [raw]):
        raise InputError(
            f"{where}: has no unit, neither in the log nor in the recipe. Add it to the recipe's line, under "
            f"'channels': {recipe_line(spec, raw)}."
        )
    notes.append(
        QualityFinding(
            "warning",
            f"{where}: no unit is given, so its numbers are taken as {spec.unit}. If they are not, say so in the "
            f"recipe, under 'channels': `{spec.name}: {{unit: ...}}`.",
            channel=spec.name,
        )
    )
    return spec.unit


def _conversion(unit: str, spec: ChannelLike, entry: ChannelMap, where: str) -> Conversion:
    if unit == spec.unit:
        return Conversion(1.0, 0.0, unit)
    try:
        return conversion(unit, spec.unit, where)
    except InputError as error:
        if entry.unit is not None:
            raise
        raise InputError(
            f"{error} If the log's unit is wrong, give the right one in the recipe: "
            f"`{spec.name}: {{unit: {spec.unit}}}`."
        ) from error


def _first_text(column: _Column) -> tuple[str, str]:
    """Return the place of the first word of a text column, and the word; empty texts where there is none."""
    row = 0
    for block in column.source.table.blocks([column.channel.name]):
        for value in block[column.channel.name]:
            if value is not None and str(value).strip():
                return column.source.table.place_of(row), str(value).strip()
            row += 1
    return "", ""


def _ambiguous(spec: ChannelLike, wanted: str, found: Sequence[_Column], files: str) -> str:
    tables = list(dict.fromkeys(column.source.stream or column.source.table.name for column in found))
    names = listing(f"'{column.channel.name}'" for column in found)
    if len(tables) == len(found):
        return (
            f"{files}: '{wanted}' stands in {len(tables)} tables: {listing(repr(table) for table in tables)}. "
            f"Say in the recipe which one is meant, under 'channels': "
            f'`{spec.name}: {{channel: "{found[0].channel.name}", table: "{tables[0]}"}}`.'
        )
    return (
        f"{files}: {names} could all be '{spec.name}'. Say in the recipe which one is meant, under 'channels': "
        f"{recipe_line(spec, found[0].channel)}."
    )


def is_table(wanted: str, source: Source) -> bool:
    """Tell whether a recipe's ``table`` names this table or its stream."""
    names = {source.table.name, source.stream, source.table.name.strip("/")}
    return wanted in names or plain(wanted) in {plain(name) for name in names}
