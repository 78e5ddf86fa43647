"""The compiled pass over the bytes of a chunk; `quick` prepares it and takes its results apart."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.ingest.delimited.decimals import LARGEST_POWER, MOST_DIGITS, nearest_bits

NUMBER, TEXT, PASSED_OVER, EMPTY = 0, 1, 2, 3
GAVE_UP = -1

_TAB, _LINE_FEED, _RETURN, _BLANK, _QUOTE, _PLUS, _MINUS, _ZERO = 9, 10, 13, 32, 34, 43, 45, 48
_UPPER_E, _LOWER_E, _A, _N = 69, 101, 97, 110
_NONE = np.uint64(0xFFFFFFFFFFFFFFFF)
_NAN = np.uint64(0x7FF8000000000000)
_SIGN = np.uint64(1 << 63)


@numba.njit(nogil=True, cache=True)
def _number(data, i, decimal):  # type: ignore[no-untyped-def]
    """Return the bits of the double that begins at `i` and where it ends; all ones where Python must read it."""
    sign = np.uint64(0)
    if data[i] == _MINUS:
        sign = _SIGN
        i += 1
    elif data[i] == _PLUS:
        i += 1
    start = i
    w = np.uint64(0)
    while data[i] == _ZERO:
        i += 1
    first = i
    digit = np.uint8(data[i] - _ZERO)
    while digit < 10:
        w = w * np.uint64(10) + np.uint64(digit)
        i += 1
        digit = np.uint8(data[i] - _ZERO)
    n_digits, n_any, power = i - first, i - start, np.int64(0)
    if data[i] == decimal:
        i += 1
        point = i
        if w == 0:
            while data[i] == _ZERO:
                i += 1
        first = i
        digit = np.uint8(data[i] - _ZERO)
        while digit < 10:
            w = w * np.uint64(10) + np.uint64(digit)
            i += 1
            digit = np.uint8(data[i] - _ZERO)
        n_digits += i - first
        n_any += i - point
        power = np.int64(point - i)
    if n_any == 0:
        is_nan = data[i] | 32 == _N and data[i + 1] | 32 == _A and data[i + 2] | 32 == _N
        return (_NAN, i + 3) if is_nan and i == start else (_NONE, i)
    if data[i] == _LOWER_E or data[i] == _UPPER_E:
        i += 1
        minus = data[i] == _MINUS
        if minus or data[i] == _PLUS:
            i += 1
        first = i
        exponent = np.int64(0)
        digit = np.uint8(data[i] - _ZERO)
        while digit < 10 and i - first < 4:
            exponent = exponent * 10 + np.int64(digit)
            i += 1
            digit = np.uint8(data[i] - _ZERO)
        if i == first:
            return _NONE, i
        power += -exponent if minus else exponent
    if w == 0:
        return sign, i
    if n_digits > MOST_DIGITS or power > LARGEST_POWER or power < -LARGEST_POWER:
        return _NONE, i
    bits = nearest_bits(w, power)
    return (bits if bits == _NONE else bits | sign), i


@numba.njit(nogil=True, cache=True)
def scan(data, delimiter, decimal, kinds, slots, marks, numbers, spans, unusual):  # type: ignore[no-untyped-def]
    """Read rows of one width.

    Parameters
    ----------
    data : uint8 (bytes,)
        Lines, each ending in a line feed.
    delimiter, decimal : int
        Their bytes; a blank stands for runs of blanks and tabs, zero for a single column.
    kinds, slots : int8, int64 (columns,)
        What to do with each column, and its place in `numbers` or `spans`.
    marks : bool (256,)
        First bytes of lines that are not data.
    numbers : uint64 (number columns, lines)
        Out: the bits of the numbers.
    spans : int64 (text columns, 2, lines)
        Out: first and last byte of each text.
    unusual : int64 (most, 4)
        Out: slot, row, first and last byte of numbers for Python to read.

    Returns
    -------
    tuple of int
        Rows and filled lines of `unusual`; rows are `GAVE_UP` where something is odd.
    """
    i, size, row, n_unusual, width = 0, data.size, 0, 0, kinds.size
    in_blanks = delimiter == _BLANK
    while i < size:
        while data[i] == _BLANK or (in_blanks and data[i] == _TAB):
            i += 1
        if data[i] == _LINE_FEED or data[i] == _RETURN:
            i += 1
            continue
        if marks[data[i]] or (data[i] == _QUOTE and marks[data[i + 1]]):
            return GAVE_UP, 0
        is_filled = False
        for column in range(width):
            while data[i] == _BLANK:
                i += 1
            quoted = data[i] == _QUOTE
            if quoted:
                i += 1
                while data[i] == _BLANK:
                    i += 1
            start = i
            kind = kinds[column]
            is_read = False
            if kind == NUMBER:
                bits, i = _number(data, i, decimal if quoted or decimal != delimiter else -1)
                numbers[slots[column], row] = bits
                is_read = bits != _NONE
                is_filled = is_filled or is_read
                while is_read and data[i] == _BLANK and not in_blanks:
                    i += 1
            # The number ends where the cell ends; what goes on, or is none, is taken as text up to there.
            if not is_read or not _is_end(data[i], delimiter, quoted, in_blanks):
                i = start
                while not _is_end(data[i], delimiter, quoted, in_blanks):
                    if data[i] == _QUOTE or data[i] == _LINE_FEED:
                        return GAVE_UP, 0
                    i += 1
                is_filled = is_filled or i > start
                if kind == NUMBER and i == start:
                    numbers[slots[column], row] = _NAN
                elif kind == NUMBER:
                    if n_unusual == unusual.shape[0]:
                        return GAVE_UP, 0
                    unusual[n_unusual, 0], unusual[n_unusual, 1] = slots[column], row
                    unusual[n_unusual, 2], unusual[n_unusual, 3] = start, i
                    n_unusual += 1
                elif kind == TEXT:
                    spans[slots[column], 0, row], spans[slots[column], 1, row] = start, i
                elif kind == EMPTY and i > start:
                    return GAVE_UP, 0
            if quoted:
                i += 1
                if not _is_end(data[i], delimiter, False, in_blanks):
                    return GAVE_UP, 0
            if column < width - 1:
                if data[i] == _LINE_FEED or data[i] == _RETURN:
                    return GAVE_UP, 0
                i += 1
                while in_blanks and (data[i] == _BLANK or data[i] == _TAB):
                    i += 1
        while data[i] == _RETURN or (in_blanks and (data[i] == _BLANK or data[i] == _TAB)):
            i += 1
        if data[i] != _LINE_FEED or not is_filled:
            return GAVE_UP, 0
        i += 1
        row += 1
    return row, n_unusual


@numba.njit(inline="always")
def _is_end(byte, delimiter, quoted, in_blanks):  # type: ignore[no-untyped-def]
    if quoted:
        return byte == _QUOTE
    return byte == delimiter or byte in (_LINE_FEED, _RETURN) or (in_blanks and byte == _TAB)
