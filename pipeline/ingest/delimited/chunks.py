"""A file of any size as pieces of whole lines in UTF-8, with line numbers; only one piece is held in memory."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from pipeline.errors import InputError
from pipeline.ingest.delimited.encoding import Encoding
from pipeline.ingest.delimited.head import LONGEST_LINE

CHUNK_BYTES = 1 << 22


@dataclass(frozen=True)
class Chunk:
    """Whole lines, each ending in a line feed.

    `is_cut` tells that this is the file's last line and has no end of its own, `has_zeros` that zero bytes follow.
    """

    data: bytes
    first_line: int
    lines: int
    is_cut: bool = False
    has_zeros: bool = False


def chunks(path: Path, encoding: Encoding, line_end: str, first_line: int, size: int = CHUNK_BYTES) -> Iterator[Chunk]:
    """Yield the lines from `first_line` on; a last line without line end comes alone.

    Raises
    ------
    InputError
        Where a line is longer than `LONGEST_LINE`, or zero bytes stand among the text. Zeros from some place to the
        end of the file, as a power cut leaves them, end the text.
    """
    for chunk in _all_chunks(path, encoding, line_end, size):
        if chunk.first_line >= first_line:
            yield chunk
        elif chunk.first_line + chunk.lines > first_line:
            above = first_line - chunk.first_line
            yield replace(
                chunk,
                data=chunk.data[_start_of_line(chunk.data, above) :],
                first_line=first_line,
                lines=chunk.lines - above,
            )


def _start_of_line(data: bytes, lines: int) -> int:
    position = 0
    for _ in range(lines):
        position = data.index(b"\n", position) + 1
    return position


def _all_chunks(path: Path, encoding: Encoding, line_end: str, size: int) -> Iterator[Chunk]:
    rest, number = b"", 1
    has_zeros = False
    with path.open("rb") as file:
        file.seek(encoding.mark)
        for piece in _utf8(file, encoding, line_end, size):
            zero = piece.find(b"\0")
            if zero >= 0:
                _refuse_text_behind_zeros(piece[zero:], file, path, number + (rest + piece[:zero]).count(b"\n"))
                piece, has_zeros = piece[:zero], True
            if end := piece.rfind(b"\n") + 1:
                data = rest + piece[:end] if rest else piece[:end]
                lines = data.count(b"\n")
                yield Chunk(data, number, lines)
                rest, number = piece[end:], number + lines
            else:
                rest += piece
            if len(rest) > LONGEST_LINE:
                raise InputError(
                    f"{path}: line {number} has no end within {LONGEST_LINE >> 20} MiB; expected is one row of the "
                    "table a line. The file is damaged there, or is no log."
                )
            if has_zeros:
                break
    rest = rest.rstrip(b"\x1a\r ")
    if rest or has_zeros:
        yield Chunk(rest + b"\n", number, 1, is_cut=bool(rest), has_zeros=has_zeros)


def _utf8(file: BinaryIO, encoding: Encoding, line_end: str, size: int) -> Iterator[bytes]:
    """Yield the text in UTF-8; what does not decode becomes the replacement character."""
    decoder = codecs.getincrementaldecoder(encoding.codec)("replace")
    is_pure = not encoding.is_wide
    while data := file.read(size):
        # Bytes below 128 stand for themselves in every encoding but the wide ones.
        if not (is_pure and data.isascii()):
            data = decoder.decode(data).encode()
            is_pure = not encoding.is_wide and not decoder.getstate()[0]
        yield data.replace(b"\r", b"\n") if line_end == "CR" else data
    if tail := decoder.decode(b"", final=True):
        yield tail.encode()


def _refuse_text_behind_zeros(rest: bytes, file: BinaryIO, path: Path, line: int) -> None:
    """Raise InputError where anything but zeros follows the first zero byte."""
    while rest:
        if rest.strip(b"\0\r\n\x1a"):
            raise InputError(
                f"{path}: line {line} holds zero bytes with text behind them; the file is damaged there or is no text. "
                "Copy it again from the logger, or cut it off before that line."
            )
        rest = file.read(CHUNK_BYTES)
