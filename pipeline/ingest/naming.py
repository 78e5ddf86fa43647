"""Names as logs have them: which of them a name means, and how messages list them and propose a recipe's line."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Protocol

from pipeline.errors import InputError, listing, nearest
from pipeline.ingest.reader import RawChannel
from pipeline.recording.units import conversion


class ChannelLike(Protocol):
    """What is asked of a channel's declaration, see `pipeline.rigs.experiment.ChannelSpec`."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def unit(self) -> str: ...  # noqa: D102
    @property
    def description(self) -> str: ...  # noqa: D102
    @property
    def required(self) -> bool: ...  # noqa: D102
    @property
    def limit(self) -> float | None: ...  # noqa: D102
    @property
    def counts_samples(self) -> bool: ...  # noqa: D102
    @property
    def lists_entries(self) -> bool: ...  # noqa: D102
    @property
    def no_value(self) -> float | None: ...  # noqa: D102
    @property
    def may_rest(self) -> bool: ...  # noqa: D102


def plain(name: str) -> str:
    """Return a name in lower case with underscores for blanks and dashes."""
    return re.sub(r"[\s\-]+", "_", name.strip()).casefold()


def _last_part(name: str) -> str:
    return plain(name.rsplit(".", 1)[-1])


def matching(wanted: str, channels: Sequence[RawChannel]) -> list[int]:
    """Return the positions of the channels that a name means.

    The first of these ways that finds any counts: the same name; the name with its unit as the log's
    heading has it; but for case; but for blanks and dashes; the last part of a dotted path.
    """
    ways: tuple[tuple[Callable[[str], str], str], ...] = (
        (str, wanted),
        (str.casefold, wanted.strip().casefold()),
        (plain, plain(wanted)),
        (_last_part, plain(wanted)),
    )
    for way, target in ways:
        found = [at for at, channel in enumerate(channels) if way(channel.name.strip()) == target]
        if not found:
            found = [at for at, channel in enumerate(channels) if target in map(way, _headings(channel))]
        if found:
            return found
    return []


def shown(channels: Sequence[RawChannel], limit: int = 40) -> str:
    """List channels with their units for a message."""
    return listing(
        (f"'{c.name}'" + (f" [{c.unit}]" if c.unit else " (text)" if c.is_text else "") for c in channels), limit
    )


def recipe_line(spec: ChannelLike, channel: RawChannel | None) -> str:
    """Return a recipe's line for a channel, with what is known filled in."""
    name = channel.name if channel else "<name in the log>"
    unit = (channel.unit if channel else None) or spec.unit
    return f'`{spec.name}: {{channel: "{name}"{f", unit: {unit}" if unit else ""}}}`'


def likely(spec: ChannelLike, channels: Sequence[RawChannel]) -> RawChannel | None:
    """Return the channel that could be meant: most like it in name, else the only one of its dimension."""
    hint = nearest(spec.name, (channel.name for channel in channels))
    named = [channel for channel in channels if f"'{channel.name}'" in hint]
    if named:
        return named[0]
    fitting = [c for c in channels if c.unit and spec.unit not in ("", "1") and _measures(c.unit, spec.unit)]
    return fitting[0] if len(fitting) == 1 else None


def _measures(unit: str, si_unit: str) -> bool:
    try:
        conversion(unit, si_unit)
    except InputError:
        return False
    return True


def _headings(channel: RawChannel) -> tuple[str, ...]:
    unit = channel.unit
    return (f"{channel.name} [{unit}]", f"{channel.name} ({unit})", f"{channel.name}/{unit}") if unit else ()
