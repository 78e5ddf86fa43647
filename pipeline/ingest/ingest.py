"""One run from its log files to a recording on disk: opened, mapped, timed, checked, written block by block."""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

from pipeline import __version__
from pipeline.errors import EmptyLogError, InputError, listing
from pipeline.ingest.clock import align, said_made_relative
from pipeline.ingest.mapping import ChannelMap, Selection, Source, resolve
from pipeline.ingest.naming import ChannelLike
from pipeline.ingest.passage import Passage
from pipeline.ingest.quality import of_run, summed
from pipeline.ingest.reader import RawLog
from pipeline.ingest.registry import open_log, reader_for
from pipeline.ingest.stream import StreamInSI
from pipeline.ingest.timebase import find_times
from pipeline.recording import Condition, Provenance, QualityFinding, Recording, SourceFile
from pipeline.recording.storage import (
    add_quality,
    description,
    file_names,
    read,
    run_of,
    sha256_of,
    whole_or_not,
)

# Raise it whenever the same log would become another recording.
VERSION = 6


def ingest_run(
    run: str,
    files: Sequence[tuple[str, Path | RawLog]],
    specs: Sequence[ChannelLike],
    maps: Mapping[str, ChannelMap],
    conditions: Mapping[str, Condition],
    condition_sources: Mapping[str, str],
    folder: Path,
    *,
    check: Callable[[Recording], Sequence[QualityFinding]] | None = None,
    notes: Sequence[QualityFinding] = (),
    shown: Mapping[str, str] | None = None,
) -> list[Path]:
    """Read the logs of one run and write its recording into `folder`.

    Parameters
    ----------
    files
        (stream, path) of each log, or the log itself where it is open; the stream is ``''`` where there is only one file.
    specs
        The channels that the experiment declares.
    maps
        The recipe's entries by canonical name, and ``time``.
    conditions, condition_sources
        In SI, and where each came from.
    check
        Findings of the rig's own on the finished recording, which reads channels as they are used.
    notes
        Findings that the caller has on this run already.
    shown
        By stream, the path as messages and provenance give it; the file's name without.

    Returns
    -------
    paths
        One Parquet file a stream. The same input gives the same bytes.

    Raises
    ------
    InputError
        If a log cannot be read, a needed channel or the time is not there, or has no values. Nothing
        is written then.
    """
    _check_name(run)
    sources = opened(files, shown)
    paths = [(stream, file.path if isinstance(file, RawLog) else file) for stream, file in files]
    selections = _named(resolve(sources, specs, maps))
    if not selections:
        names = listing(spec.name for spec in specs)
        raise InputError(f"{sources[0].shown}: holds none of the channels {names}; map them in the recipe.")
    times = find_times([selection.source for selection in selections], maps.get("time"))
    several = len(sources) > 1
    streams = [StreamInSI(selection, time, several) for selection, time in zip(selections, times, strict=True)]
    begins = align([stream.clock for stream in streams])
    origin = [] if begins is None else [said_made_relative(begins)]
    targets = file_names(run, [selection.source.stream for selection in selections])
    _clear(folder, run, list(targets.values()))
    with ExitStack() as stack:
        hashing = stack.enter_context(ThreadPoolExecutor(1))
        hashes = [hashing.submit(sha256_of, path) for _, path in paths]
        partials = [stack.enter_context(whole_or_not(folder / name)) for name in targets.values()]
        passages = [
            stack.enter_context(Passage(selection.channels, path))
            for selection, path in zip(selections, partials, strict=True)
        ]
        for stream, passage in zip(streams, passages, strict=True):
            stream.pass_to(passage)
            passage.quality.finish()
            _refuse_empty_channels(stream, passage)
        quality = of_run([*notes, *summed(_findings(sources, streams, passages))], run)
        repairs = [repair.message for stream in streams for repair in stream.repairs]
        provenance = Provenance(
            tuple(
                _source_file(stream, path, digest.result(), shown, streams)
                for (stream, path), digest in zip(paths, hashes, strict=True)
            ),
            (*origin, *repairs, *_left_out(sources, streams)),
            condition_sources,
            __version__,
            begins,
        )
        recording = Recording(run, {}, conditions, tuple(quality), provenance)
        for passage, selection in zip(passages, selections, strict=True):
            passage.close(description(recording, selection.source.stream))
        found = check(read(partials, lazily=True)) if check else ()
        if found:
            add_quality(partials, of_run(found, run))
    written = [folder / name for name in targets.values()]
    _remove_others(folder, run, written)
    return written


def open_run(
    files: Sequence[tuple[str, Path]], shown: Mapping[str, str] | None = None
) -> tuple[list[tuple[str, RawLog]], list[QualityFinding]]:
    """Open the logs of a run but those that hold no rows: a side table may be empty, which a warning says.

    Raises
    ------
    InputError
        If one cannot be opened, or all are empty.
    """
    logs: list[tuple[str, RawLog]] = []
    notes: list[QualityFinding] = []
    empty: list[EmptyLogError] = []
    for stream, path in files:
        try:
            logs.append((stream, open_log(path)))
        except EmptyLogError as error:
            empty.append(error)
            said = str(error).replace(str(path), (shown or {}).get(stream, path.name))
            notes.append(QualityFinding("warning", f"a table of this run is left out. {said}"))
    if not logs:
        raise empty[0]
    return logs, notes


def opened(files: Sequence[tuple[str, Path | RawLog]], shown: Mapping[str, str] | None = None) -> list[Source]:
    """Return the tables of a run's logs, each with the name of the stream that it would be; a path is opened."""
    sources: list[Source] = []
    for stream, file in files:
        log = file if isinstance(file, RawLog) else open_log(file)
        for table in log.tables:
            parts = [stream] if len(log.tables) == 1 and stream else [stream, _safe(table.name)]
            name = taken = "_".join(part for part in parts if part)
            count = 1
            while taken in {source.stream for source in sources}:
                count += 1
                taken = f"{name}_{count}"
            sources.append(Source(log, table, (shown or {}).get(stream, log.path.name), taken))
    return sources


def _findings(
    sources: Sequence[Source], streams: Sequence[StreamInSI], passages: Sequence[Passage]
) -> list[QualityFinding]:
    """Gather what was found on the way: in the logs, in their tables, in the signals."""
    logs = {id(source.log): source.log for source in sources}
    found = [note for log in logs.values() for note in log.notes]
    for stream, passage in zip(streams, passages, strict=True):
        found += [*stream.notes(passage.quality.sampling), *passage.quality.findings()]
    return found


def _refuse_empty_channels(stream: StreamInSI, passage: Passage) -> None:
    for channel in passage.quality.empty_channels():
        if channel.required:
            largest = stream.beyond.get(channel.name)
            what = (
                "no number" if largest is None else f"no number that can be (they reach {largest:.3g} {channel.unit})"
            )
            raise InputError(
                f"{stream.selection.source.where}, channel '{channel.raw.name}': holds {what} in any of "
                f"{passage.quality.sampling.n} rows; '{channel.name}' needs numbers. Check the sensor, its unit and the "
                "export, or name another channel in the recipe."
            )


def _left_out(sources: Sequence[Source], streams: Sequence[StreamInSI]) -> list[str]:
    """Say which channels of the logs nobody asked for."""
    said = []
    by_table = {id(stream.selection.source.table): stream for stream in streams}
    for source in sources:
        stream = by_table.get(id(source.table))
        names = stream.selection.left_out if stream else [channel.name for channel in source.table.channels]
        others = [name for name in names if stream is None or name != stream.time.channel]
        if others:
            said.append(f"{source.where}: not taken: {listing(others, 100)}.")
    return said


def _source_file(
    stream: str, path: Path, digest: str, shown: Mapping[str, str] | None, streams: Sequence[StreamInSI]
) -> SourceFile:
    units: dict[str, str] = {}
    for one in streams:
        if one.selection.source.log.path == path:
            units.update({"time": one.time.unit} if one.time.channel is not None else {})
            units.update({channel.name: channel.taken_as for channel in one.selection.channels if channel.unit})
    reader = reader_for(path)
    name = (shown or {}).get(stream, path.name)
    return SourceFile(name, digest, path.stat().st_size, reader.named, units)


def _named(selections: Sequence[Selection]) -> list[Selection]:
    """Give the only stream of a run no name."""
    if len(selections) != 1:
        return list(selections)
    return [replace(selections[0], source=replace(selections[0].source, stream=""))]


def _safe(name: str) -> str:
    """Return a topic's or table's name as part of a file name."""
    return re.sub(r"[^\w+@=,() -]+", "_", name.strip("/ .")).strip("_ ")[:80]


def _check_name(run: str) -> None:
    """Refuse a run's name that would leave or hide in its folder."""
    if not run or run[0] in ". " or len(run.encode()) > 180 or re.search(r"[/\\:\x00-\x1f]", run):
        raise InputError(
            f"'{run}' cannot be the name of a run: it becomes a file's name, so it must not be empty, begin with a dot "
            "or a blank, hold / \\ : or be longer than 180 bytes. Rename the log."
        )


def _clear(folder: Path, run: str, names: Sequence[str]) -> None:
    """Remove what a killed ingest left, and refuse to write over another run."""
    for name in names:
        for partial in folder.glob(f".{glob.escape(name)}.*.partial"):
            partial.unlink(missing_ok=True)
        with suppress(InputError):
            other = run_of(folder / name)
            if other != run:
                break
    else:
        return
    raise InputError(f"the runs '{run}' and '{other}' would both be written to {name}; rename one of their logs.")


def _remove_others(folder: Path, run: str, written: Sequence[Path]) -> None:
    """Remove recordings of an earlier reading of this run that had other streams."""
    for path in sorted(folder.glob(f"{glob.escape(run)}.*parquet")):
        with suppress(InputError):
            if path not in written and run_of(path) == run:
                path.unlink()
