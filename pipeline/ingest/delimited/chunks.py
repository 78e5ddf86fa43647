"""A file of any size as pieces of whole lines in UTF-8, with line numbers; only one piece is held in memory."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import FileIO
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.delimited.encoding import Encoding
from pipeline.ingest.delimited.head import LONGEST_LINE

CHUNK_BYTES = 1 << 22
_LINE_FEED = 10


@dataclass(frozen=True)
class Chunk:
    """Whole lines, each ending in a line feed.

    `is_cut` tells that this is the file's last line and has no end of its own, `has_zeros` that zero bytes follow.
    """

    data: bytes | bytearray
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


def _start_of_line(data: bytes | bytearray, lines: int) -> int:
    position = 0
    for _ in range(lines):
        position = data.index(b"\n", position) + 1
    return position


def _all_chunks(path: Path, encoding: Encoding, line_end: str, size: int) -> Iterator[Chunk]:
    rest, number = b"", 1
    has_zeros = False
    with path.open("rb", buffering=0) as file:
        text = _Utf8Text(file, encoding, line_end)
        while not has_zeros and (data := text.after(rest, size)) is not None:
            zero = data.find(b"\0")
            if zero >= 0:
                _refuse_text_behind_zeros(data[zero:], file, path, number + data.count(b"\n", 0, zero))
                del data[zero:]
                has_zeros = True
            end = data.rfind(b"\n") + 1
            rest = bytes(data[end:])
            if end:
                del data[end:]
                lines = int(np.count_nonzero(np.frombuffer(data, np.uint8) == _LINE_FEED))
                yield Chunk(data, number, lines)
                number += lines
            if len(rest) > LONGEST_LINE:
                raise InputError(
                    f"{path}: line {number} has no end within {LONGEST_LINE >> 20} MiB; expected is one row of the "
                    "table a line. The file is damaged there, or is no log."
                )
    rest = rest.rstrip(b"\x1a\r ")
    if rest or has_zeros:
        yield Chunk(bytearray(rest + b"\n"), number, 1, is_cut=bool(rest), has_zeros=has_zeros)


class _Utf8Text:
    """A file's text in UTF-8, read piece by piece; what does not decode becomes the replacement character."""

    def __init__(self, file: FileIO, encoding: Encoding, line_end: str) -> None:
        self._file, self._line_end = file, line_end
        self._decoder = codecs.getincrementaldecoder(encoding.codec)("replace")
        self._is_wide = encoding.is_wide
        self._is_within = False  # a character that the last piece began
        file.seek(encoding.mark)

    def after(self, rest: bytes, size: int) -> bytearray | None:
        """Return `rest` and up to `size` bytes more, None at the end of the file."""
        data = bytearray(len(rest) + size)
        data[: len(rest)] = rest
        with memoryview(data) as view:
            got = self._file.readinto(view[len(rest) :]) or 0
        del data[len(rest) + got :]
        if not got:
            data += self._decoder.decode(b"", final=True).encode()
            return data if len(data) > len(rest) else None
        # Bytes below 128 stand for themselves in every encoding but the wide ones.
        if self._is_wide or self._is_within or not data.isascii():
            data[len(rest) :] = self._decoder.decode(bytes(data[len(rest) :])).encode()
            self._is_within = bool(self._decoder.getstate()[0])
        return data.replace(b"\r", b"\n") if self._line_end == "CR" else data


def _refuse_text_behind_zeros(rest: bytes | bytearray, file: FileIO, path: Path, line: int) -> None:
    """Raise InputError where anything but zeros follows the first zero byte."""
    while rest:
        if rest.strip(b"\0\r\n\x1a"):
            raise InputError(
                f"{path}: line {line} holds zero bytes with text behind them; the file is damaged there or is no text. "
                "Copy it again from the logger, or delete that line."
            )
        rest = file.read(CHUNK_BYTES)
