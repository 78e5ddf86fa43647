"""The reader of MDF logs (CAN and vehicle loggers, INCA, CANape): `READER` reads versions 2 to 4 with asammdf.

Each channel group with samples is a table with its master as time. Frames of a bus that were not decoded are left out and
said: their signals stand in a data base that the log does not hold.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.ingest.column_table import as_numbers, as_text, is_number, named
from pipeline.ingest.extras import library
from pipeline.ingest.misnamed import misnamed
from pipeline.ingest.reader import RawChannel, RawLog, RawTable, Reader
from pipeline.recording import QualityFinding

_MARKS = (b"MDF     ", b"UnFinMF ")
_BUS = re.compile(r"^(CAN|LIN|FLX|ETH|MOST|K_LINE)_(Data|Remote|Error|Overload)?_?Frame", re.IGNORECASE)
# Members of the comment that tell about the program that wrote it; no conditions of a run.
_MOST_LEFT_OUT = 8
# Bytes of records that are unpacked at a time.
_FRAGMENT = 8 << 20
# A group's master may also be an angle, a distance or a count.
_IS_TIME = 1


class MdfReader(Reader):
    """Reads MDF files of version 2, 3 and 4, finished or not."""

    name = "mdf"
    version = 2
    suffixes = (".mf4", ".mdf", ".dat")

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the mark; a file named .mf4 or .mdf is taken too, to say what is wrong with it (.dat may be anything)."""
        return head.startswith(_MARKS) or suffix in (".mf4", ".mdf")

    def open(self, path: Path) -> RawLog:
        """Read the blocks that list groups and channels.

        Raises
        ------
        InputError
            If asammdf is not installed, or the file is broken or holds no channel of numbers.
        """
        with path.open("rb") as file:
            if not file.read(len(_MARKS[0])).startswith(_MARKS):
                raise misnamed(path, "MDF file")
        tables: list[MdfTable] = []
        left_out: list[str] = []
        with _opened(path) as mdf:
            start = mdf.header.start_time
            begins = None if start is None or start.timestamp() <= 0 else start.replace(tzinfo=None).isoformat()
            for at in range(len(mdf.groups)):
                table = _table(path, mdf, at, begins, left_out)
                if table is not None:
                    tables.append(table)
            metadata = _metadata(mdf)
            details = {"version": str(mdf.version), "groups": str(len(mdf.groups))}
        if not tables:
            more = f"; it has {listing(left_out, _MOST_LEFT_OUT)}" if left_out else ""
            raise InputError(
                f"{path}: this MDF file holds no channel of numbers with samples{more}. Frames of a bus must be decoded first, "
                "with the network's data base (DBC, ARXML), in the logger's own software or with asammdf."
            )
        notes = [QualityFinding("note", f"left out: {listing(left_out, _MOST_LEFT_OUT)}.")] if left_out else []
        _number(tables)
        return RawLog(path, "MDF", tables, metadata, details, tuple(notes))


class MdfTable(RawTable):
    """One channel group: its channels by name, each with its place in the group."""

    def __init__(
        self, path: Path, name: str, group: int, channels: Sequence[tuple[RawChannel, int]], begins: str | None
    ) -> None:
        self.name = name
        self._path, self._group = path, group
        self.channels = named([channel for channel, _ in channels])
        self._places = {c.name: place for c, (_, place) in zip(self.channels, channels, strict=True)}
        self._text = {channel.name for channel in self.channels if channel.is_text}
        self.time_channel = self.channels[0].name if self._places[self.channels[0].name] < 0 else None
        self.absolute_start = begins if self.time_channel is not None else None

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        """Yield the rows as the file's data blocks hold them; see `RawTable.blocks`."""
        wanted = {c.name: self._places[c.name] for c in self.channels if names is None or c.name in names}
        if not wanted:
            return
        with _opened(self._path) as mdf:
            for fragment in _fragments(mdf, self._group):
                block = {name: self._values(mdf, name, place, fragment) for name, place in wanted.items()}
                sizes = {values.shape for values in block.values()}
                if len(sizes) > 1:
                    raise InputError(
                        f"{self._path}: this MDF file is broken: channels of the group '{self.name}' have different numbers of "
                        "samples. Let the logger finish it, or copy it again."
                    )
                if sizes != {(0,)}:
                    yield block

    def _values(self, mdf: Any, name: str, place: int, fragment: Any) -> np.ndarray:
        if place < 0:
            return as_numbers(np.asarray(mdf.get_master(self._group, data=fragment, one_piece=True)))
        samples, invalid = mdf.get(
            group=self._group, index=place, data=fragment, samples_only=True, ignore_invalidation_bits=True
        )
        if name in self._text:
            return as_text(np.asarray(samples))
        values = as_numbers(np.asarray(samples))
        if invalid is not None:
            values[np.asarray(invalid, dtype=bool)] = np.nan
        return values


def _fragments(mdf: Any, group: int, records: int | None = None) -> Iterator[Any]:
    """Yield the records of a group, or the first of them, some megabytes at a time, for all of its channels.

    The library's own `iter_get` reads and unpacks them again for each channel, and drops the invalid samples of one channel
    while another one keeps its own.
    """
    mdf.configure(read_fragment_size=_FRAGMENT)
    inner = getattr(mdf, "_mdf", mdf)
    for fragment in inner._load_data(mdf.groups[group], record_count=records):
        yield fragment
        getattr(inner, "_invalidation_cache", {}).clear()


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file; whatever asammdf stumbles over in a broken one is an InputError."""
    asammdf = library("asammdf", "mdf", path, "an MDF log (CAN and vehicle loggers)")
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    _close_here_alone(asammdf.blocks)
    try:
        with asammdf.MDF(path) as mdf:
            yield mdf
    except InputError:
        raise
    except Exception as error:  # asammdf has no error of its own for broken files: struct, index, key, value errors
        raise InputError(
            f"{path}: this MDF file is broken or was cut off ({type(error).__name__}: {str(error)[:160]}). Let the logger "
            "finish it, or copy it again."
        ) from error


def _close_here_alone(blocks: Any) -> None:
    """Close files here alone: what asammdf failed to open it closes too, stumbles, and complains on the screen."""
    for version in (blocks.mdf_v4.MDF4, blocks.mdf_v3.MDF3):
        if hasattr(version, "__del__"):
            del version.__del__


def _table(path: Path, mdf: Any, at: int, begins: str | None, left_out: list[str]) -> MdfTable | None:
    group = mdf.groups[at]
    rows = int(group.channel_group.cycles_nr)
    called = _group_name(group) or f"group {at + 1}"
    if rows == 0:
        left_out.append(f"the empty group '{called}'")
        return None
    master = _time_of(mdf, at)
    channels: list[tuple[RawChannel, int]] = []
    if master is not None:
        channels.append((RawChannel(str(master.name) or "time", "s"), -1))
    taken = {channel.name for channel, _ in channels}
    record = next(_fragments(mdf, at, records=1))
    for place, channel in enumerate(group.channels):
        if channel is master:
            continue
        if _BUS.match(str(channel.name)):
            left_out.append(f"frames of a bus ('{called}'), not decoded")
            return None
        first = np.asarray(
            mdf.get(group=at, index=place, data=record, samples_only=True, ignore_invalidation_bits=True)[0]
        )
        if first.dtype.names is not None and any(c.name.startswith(f"{channel.name}[") for c in group.channels):
            continue  # its members are channels of their own
        if first.ndim != 1 or first.dtype.names is not None:
            left_out.append(f"'{channel.name}' (no single number a sample)")
            continue
        name = str(channel.name)
        while name in taken:
            name += "'"
        taken.add(name)
        unit = str(channel.unit or getattr(channel.conversion, "unit", "") or "").strip() or None
        channels.append((RawChannel(name, unit, is_text=not is_number(first.dtype)), place))
    if not any(place >= 0 for _, place in channels) or (master is None and all(c.is_text for c, _ in channels)):
        left_out.append(f"the group '{called}' without {'numbers' if channels else 'channels'}")
        return None
    return MdfTable(path, called, at, channels, begins)


def _time_of(mdf: Any, at: int) -> Any | None:
    """Return the channel that is the time of a group, which may stand in another group; None where the master is no time."""
    group = mdf.groups[at]
    where = getattr(group.channel_group, "cg_master_index", None)
    place = mdf.masters_db.get(at)
    if place is None and where is not None:
        group, place = mdf.groups[where], mdf.masters_db.get(where)
    if place is None:
        return None
    master = group.channels[place]
    return master if getattr(master, "sync_type", _IS_TIME) == _IS_TIME else None


def _group_name(group: Any) -> str:
    for name in (getattr(group.channel_group, "acq_name", ""), _plain(getattr(group.channel_group, "comment", ""))):
        if name:
            return str(name).strip()
    return ""


def _metadata(mdf: Any) -> dict[str, str]:
    """Return what the header says of the run: author, project, subject, remarks and their properties."""
    header = mdf.header
    found = {key: str(getattr(header, key, "") or "").strip() for key in ("author", "project", "subject", "department")}
    comment = str(getattr(header, "comment", "") or "")
    found |= {
        match[1]: match[2].strip() for match in re.finditer(r'<e\s+name="([^"]{1,80})"[^>]*>([^<]{1,200})</e>', comment)
    }
    return {key: text for key, text in found.items() if text}


def _plain(comment: str) -> str:
    """Return the text of a comment that may be XML."""
    inner = re.search(r"<TX[^>]*>([^<]*)</TX>", comment)
    return (inner[1] if inner else "" if comment.lstrip().startswith("<") else comment).strip()[:80]


def _number(tables: list[MdfTable]) -> None:
    """Number tables of one name; the only one needs none."""
    if len(tables) == 1:
        tables[0].name = ""
        return
    names = [table.name for table in tables]
    count: dict[str, int] = {}
    for table in tables:
        if names.count(table.name) > 1:
            count[table.name] = count.get(table.name, 0) + 1
            table.name = f"{table.name} {count[table.name]}"


READER = MdfReader()
