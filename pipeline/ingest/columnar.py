"""The reader of Parquet and Feather (Arrow) logs: `READER` reads them; the file is one table.

Units stand in a field's metadata, or in the schema's under a channel's name; times as dates count from their first.
Where pandas had column names of several levels, they are joined by dots.
"""

from __future__ import annotations

import ast
import json
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import EmptyLogError, InputError
from pipeline.ingest.ahead import refuse_fatal
from pipeline.ingest.column_table import as_numbers, as_text, named, seconds_since
from pipeline.ingest.delimited.header import is_units_row, unit_in_row
from pipeline.ingest.misnamed import misnamed
from pipeline.ingest.reader import BLOCK_ROWS, RawChannel, RawLog, RawTable, Reader
from pipeline.ingest.unpacking import is_beyond_belief
from pipeline.recording import QualityFinding

if TYPE_CHECKING:
    import pyarrow as pa

_PARQUET, _ARROW, _FEATHER_1 = b"PAR1", b"ARROW1", b"FEA1"
_UNITS = ("unit", "units", "Unit")
# What libraries write about themselves into a schema.
_OF_THE_CARRIER = ("pandas", "ARROW:", "PARQUET:", "rigfit", "huggingface", "geo")
# Bytes of a column that are read at once.
_BUFFER = 1 << 20
_TRIAL_SECONDS = 0.5


class ColumnarReader(Reader):
    """Reads Parquet files, and Feather files of version 2 (Arrow's own)."""

    name = "columnar"
    version = 2
    suffixes = (".parquet", ".pq", ".feather", ".arrow", ".ipc")

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the mark at the front; a file named so is taken too, to say what is wrong with it."""
        return head.startswith((_PARQUET, _ARROW, _FEATHER_1)) or suffix in self.suffixes

    def open(self, path: Path) -> RawLog:
        """Read the schema.

        Raises
        ------
        InputError
            If the file is broken, or holds no column of numbers.
        """
        source = _source(path)
        if not source.rows:
            raise EmptyLogError(
                f"{path}: this {source.kind} file holds no rows; export or record the log again, with its samples."
            )
        table = ArrowTable(path, source)
        if not any(not channel.is_text for channel in table.channels):
            raise InputError(f"{path}: this {source.kind} file holds no column of numbers to read as a channel.")
        notes = [
            QualityFinding(
                "note",
                f"the column '{name}' ({kind}) is left out; write what is in it as columns of numbers, each with a name of its own.",
            )
            for name, kind in table.left_out
        ]
        details = {"rows": str(source.rows), "columns": str(len(source.schema))}
        return RawLog(path, source.kind, [table], _metadata(source.schema.metadata), details, tuple(notes))


class _Source:
    """An opened file: its kind, schema, number of rows, and its batches of some columns."""

    def __init__(self, path: Path, kind: str, schema: pa.Schema, rows: int) -> None:
        self.path, self.kind, self.schema, self.rows = path, kind, schema, rows

    def batches(self, names: Sequence[str]) -> Iterator[pa.RecordBatch]:
        if self.kind == "Parquet":
            import pyarrow.parquet as pq

            # Read ahead, as is the default, all of the file would stay in memory.
            with pq.ParquetFile(self.path, pre_buffer=False, buffer_size=_BUFFER) as file:
                yield from file.iter_batches(BLOCK_ROWS, columns=list(names))
            return
        import pyarrow as pa
        import pyarrow.ipc as ipc

        with pa.OSFile(str(self.path)) as opened:  # a map would stay in memory as far as it was read
            file = ipc.open_file(opened)
            for at in range(file.num_record_batches):
                batch = file.get_batch(at).select(list(names))
                batch.validate(full=True)  # offsets that lead elsewhere would end the process
                for start in range(0, batch.num_rows, BLOCK_ROWS):
                    yield batch.slice(start, BLOCK_ROWS)


class ArrowTable(RawTable):
    """The columns of numbers, truth values, dates and words; nested ones are left out."""

    def __init__(self, path: Path, source: _Source) -> None:
        import pyarrow.types as types

        self.name = ""
        self._path, self._source = path, source
        self.left_out: list[tuple[str, str]] = []
        self.channels = []
        self._dates: list[str] = []
        alike = Counter(source.schema.names)
        self.left_out += [(name, f"{count} columns have this name") for name, count in alike.items() if count > 1]
        for field in source.schema:
            kind = field.type
            if alike[field.name] > 1:
                continue
            if types.is_dictionary(kind):
                kind = kind.value_type
            if types.is_temporal(kind) and not types.is_duration(kind) and not types.is_time(kind):
                self._dates.append(field.name)
                self.channels.append(RawChannel(field.name, "s"))
            elif types.is_duration(kind) or types.is_time(kind):
                self.channels.append(RawChannel(field.name, "s"))
            elif types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind) or types.is_decimal(kind):
                self.channels.append(RawChannel(field.name, _unit(field, source.schema)))
            elif types.is_string(kind) or types.is_large_string(kind) or types.is_string_view(kind):
                self.channels.append(RawChannel(field.name, None, is_text=True))
            else:
                self.left_out.append((field.name, str(kind)))
        self._text = {channel.name for channel in self.channels if channel.is_text}
        in_file = [channel.name for channel in self.channels]
        leveled = _of_levels(in_file, source.schema.metadata)
        self.channels = named([_as_leveled(channel, leveled) for channel in self.channels])
        self._in_file = dict(zip([channel.name for channel in self.channels], in_file, strict=True))
        self._zeros = {name: self._first_date(name) for name in self._dates}
        dated = [name for name in self._dates if self._zeros[name] is not None]
        if len(dated) == 1:
            self.time_channel = self.channels[in_file.index(dated[0])].name
            self.absolute_start = str(self._zeros[dated[0]])

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        """Yield the rows; see `RawTable.blocks`."""
        wanted = {name: column for name, column in self._in_file.items() if names is None or name in names}
        if not wanted:
            return
        try:
            for batch in self._source.batches(list(wanted.values())):
                if batch.num_rows:
                    yield {name: self._plain(column, batch.column(column)) for name, column in wanted.items()}
        except (OSError, ValueError, MemoryError) as error:  # pyarrow's errors are of these kinds
            raise _broken(self._path, self._source.kind, error) from error

    def _plain(self, name: str, column: pa.Array) -> np.ndarray:
        import pyarrow.types as types

        if types.is_dictionary(column.type):
            column = column.dictionary_decode()
        if name in self._zeros:
            zero = self._zeros[name]
            return seconds_since(_dates(column), np.datetime64("1970-01-01", "ns") if zero is None else zero)
        if name in self._text:
            return as_text(np.array(column.to_pylist(), dtype=object))
        if types.is_duration(column.type) or types.is_time(column.type):
            return _lasting(column)
        if types.is_decimal(column.type) or types.is_boolean(column.type):
            column = column.cast("float64")
        return as_numbers(np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64))

    def _first_date(self, name: str) -> np.datetime64 | None:
        try:
            for batch in self._source.batches([name]):
                dates = _dates(batch.column(name))
                known = dates[~np.isnat(dates)]
                if known.size:
                    return np.datetime64(known[0], "ns")
        except (OSError, ValueError, MemoryError) as error:
            raise _broken(self._path, self._source.kind, error) from error
        return None


def _dates(column: pa.Array) -> np.ndarray:
    import pyarrow as pa

    plain = column.cast(pa.timestamp("ns", getattr(column.type, "tz", None)))
    return np.asarray(plain.to_numpy(zero_copy_only=False)).astype("datetime64[ns]")


def _lasting(column: pa.Array) -> np.ndarray:
    """Return durations and times of day in seconds."""
    import pyarrow as pa
    import pyarrow.types as types

    seconds = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[column.type.unit]
    whole = pa.int64() if types.is_duration(column.type) or column.type.bit_width == 64 else pa.int32()
    counts = column.cast(whole).to_numpy(zero_copy_only=False)
    return np.asarray(counts, dtype=np.float64) * seconds


def _source(path: Path) -> _Source:
    import pyarrow as pa
    import pyarrow.ipc as ipc
    import pyarrow.parquet as pq

    with path.open("rb") as file:
        head = file.read(8)
    kind = "Parquet" if head.startswith(_PARQUET) else "Feather (Arrow)"
    if head.startswith(_FEATHER_1):
        raise InputError(
            f"{path}: is a Feather file of version 1, which its makers gave up; read it with pandas and write it again."
        )
    if not head.startswith((_PARQUET, _ARROW)):
        raise misnamed(path, "Parquet or Feather file")
    if kind == "Parquet":
        refuse_fatal(path, kind, lambda: _tried(path))
    try:
        if kind == "Parquet":
            with pq.ParquetFile(path) as parquet:
                _refuse_bomb(path, parquet.metadata)
                return _Source(path, kind, parquet.schema_arrow, parquet.metadata.num_rows)
        with pa.OSFile(str(path)) as file:
            opened = ipc.open_file(file)
            rows = sum(opened.get_batch(at).num_rows for at in range(opened.num_record_batches))
            return _Source(path, kind, opened.schema, rows)
    except (OSError, ValueError, MemoryError) as error:
        raise _broken(path, kind, error) from error


def _tried(path: Path) -> None:
    """Read on as far as half a second goes, without threads, which a split-off process does not have."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pa.set_memory_pool(pa.system_memory_pool())  # others reserve more than they use
    until = time.monotonic() + _TRIAL_SECONDS
    with pq.ParquetFile(path, pre_buffer=False, buffer_size=_BUFFER) as parquet:
        _refuse_bomb(path, parquet.metadata)
        for _ in parquet.iter_batches(BLOCK_ROWS, use_threads=False):
            if time.monotonic() > until:
                return


def _refuse_bomb(path: Path, about: Any) -> None:
    """Refuse a file that says that it holds far more rows, or a column of far more bytes, than its own bytes can."""
    size = path.stat().st_size
    packed = [about.row_group(i).column(j) for i in range(about.num_row_groups) for j in range(about.num_columns)]
    if is_beyond_belief(size, 8 * about.num_rows) or any(
        is_beyond_belief(column.total_compressed_size, column.total_uncompressed_size) for column in packed
    ):
        raise InputError(
            f"{path}: this Parquet file says that its {size} bytes hold {about.num_rows} rows, or a column that unpacks to more than "
            "any log's does; that is refused. Write it again with the measured rows only."
        )


def _broken(path: Path, kind: str, error: Exception) -> InputError:
    return InputError(
        f"{path}: this {kind} file is broken or was cut off ({str(error).splitlines()[0][:160]}). Its list of contents stands "
        "at its end, so that nothing of it can be read; copy or write it again."
    )


def _of_levels(names: Sequence[str], metadata: Mapping[bytes, bytes] | None) -> dict[str, tuple[str, str | None]]:
    """Return names and units of columns that pandas named in several levels: it writes such a name as a tuple's text.

    A last level that holds units, as a units row that was read with the header does, gives them.
    """
    try:
        said = json.loads((metadata or {}).get(b"pandas", b"{}"))
        if len(said.get("column_indexes") or ()) < 2:
            return {}
    except (ValueError, AttributeError, TypeError, RecursionError):
        return {}
    levels: dict[str, list[str]] = {}
    for name in names:
        try:
            parts = ast.literal_eval(name)
        except (ValueError, SyntaxError, MemoryError, RecursionError):  # an index, dates as names
            continue
        if isinstance(parts, tuple):
            words = [str(part).strip() for part in parts]
            levels[name] = ["" if word.startswith("Unnamed: ") else word for word in words]
    if is_units_row([parts[-1] for parts in levels.values() if len(parts) > 1]):
        return {name: (_dotted(parts[:-1]), unit_in_row(parts[-1])) for name, parts in levels.items()}
    return {name: (_dotted(parts), None) for name, parts in levels.items()}


def _dotted(parts: Sequence[str]) -> str:
    return ".".join(part for part in parts if part)


def _as_leveled(channel: RawChannel, leveled: Mapping[str, tuple[str, str | None]]) -> RawChannel:
    name, unit = leveled.get(channel.name, ("", None))
    return RawChannel(name, channel.unit or unit, channel.is_text) if name else channel


def _unit(field: pa.Field, schema: pa.Schema) -> str | None:
    for metadata, keys in (
        (field.metadata, _UNITS),
        (schema.metadata, (*(f"{key}.{field.name}" for key in _UNITS), f"{field.name}.unit")),
    ):
        for key in keys:
            if (value := (metadata or {}).get(key.encode())) is not None:
                return str(value.decode("utf-8", "replace")).strip() or None
    return None


def _metadata(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return what the schema says of the run: entries of text, and members of an entry that is a JSON object."""
    found: dict[str, str] = {}
    for key, value in (metadata or {}).items():
        name, text = key.decode("utf-8", "replace"), value.decode("utf-8", "replace").strip()
        if name.startswith(_OF_THE_CARRIER) or name.startswith(tuple(f"{unit}." for unit in _UNITS)) or not text:
            continue
        members: Any = None
        if text.startswith("{"):
            try:
                members = json.loads(text)
            except (ValueError, RecursionError):
                members = None
        if isinstance(members, dict):
            found |= {f"{name}.{k}": str(v) for k, v in members.items() if isinstance(v, str | int | float)}
        else:
            found[name] = text
    return found


READER = ColumnarReader()
