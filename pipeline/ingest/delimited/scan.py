"""The compiled pass over the bytes of a chunk; `quick` prepares it and takes its results apart.

One long loop on purpose: called or inlined, the reading of a number takes twice the time.
"""

# Compiled code has the types that numba infers; the checker's notion of numpy scalars does not fit it.
# mypy: disable-error-code="assignment,no-untyped-def"

from __future__ import annotations

import numba
import numpy as np

from pipeline.ingest.delimited.decimals import LARGEST_POWER, MOST_DIGITS, nearest

NUMBER, TEXT, PASSED_OVER, EMPTY = 0, 1, 2, 3
GAVE_UP = -1

_TAB, _LINE_FEED, _RETURN, _BLANK, _QUOTE, _PLUS, _MINUS, _ZERO = 9, 10, 13, 32, 34, 43, 45, 48
_UPPER_E, _LOWER_E, _A, _N = 69, 101, 97, 110
_ONE, _TWO, _THREE, _FOUR, _TEN, _NOUGHT = (np.uint64(value) for value in (1, 2, 3, 4, 10, _ZERO))
# Doubles themselves, so that one division rounds once (Clinger, "How to read floating point numbers accurately", 1990).
_EXACT_WHOLE, _EXACT_POWER = np.uint64(1 << 53), 22
_TENS = np.array([10.0**power for power in range(_EXACT_POWER + 1)])


@numba.njit(inline="always")
def _is_end(byte, delimiter, quoted, in_blanks):
    if quoted:
        return byte == _QUOTE
    return byte in (delimiter, _LINE_FEED, _RETURN) or (in_blanks and byte == _TAB)


@numba.njit(nogil=True, cache=True)
def scan(data, delimiter, decimal, kinds, slots, marks, numbers, spans, unusual):
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
    numbers : float64 (number columns, lines)
        Out: the numbers, NaN for empty cells.
    spans : int64 (text columns, 2, lines)
        Out: first and last byte of each text.
    unusual : int64 (most, 4)
        Out: slot, row, first and last byte of numbers for Python to read.

    Returns
    -------
    tuple of int
        Rows and filled lines of `unusual`; rows are `GAVE_UP` where something is odd.
    """
    # Places are unsigned: with signed ones each access would first be asked whether it counts from the end.
    i, size, row, n_unusual, width = np.uint64(0), np.uint64(data.size), 0, 0, kinds.size
    in_blanks = delimiter == _BLANK
    while i < size:
        while data[i] == _BLANK or (in_blanks and data[i] == _TAB):
            i += _ONE
        if data[i] == _LINE_FEED or data[i] == _RETURN:
            i += _ONE
            continue
        if marks[data[i]] or (data[i] == _QUOTE and marks[data[i + _ONE]]):
            return GAVE_UP, 0
        is_filled = False
        for column in range(width):
            while data[i] == _BLANK:
                i += _ONE
            quoted = data[i] == _QUOTE
            if quoted:
                i += _ONE
                while data[i] == _BLANK:
                    i += _ONE
            begin = i
            kind = kinds[column]
            is_read = False
            if kind == NUMBER:
                is_negative = data[i] == _MINUS
                if is_negative or data[i] == _PLUS:
                    i += _ONE
                start = i
                while data[i] == _ZERO:
                    i += _ONE
                w, power, n_zeros = np.uint64(0), 0, np.int64(i - start)
                digit = np.uint64(data[i]) - _NOUGHT  # what is no digit becomes large
                while digit < _TEN:
                    w = w * _TEN + digit
                    i += _ONE
                    digit = np.uint64(data[i]) - _NOUGHT
                n_digits = np.int64(i - start)
                if data[i] == decimal and (quoted or decimal != delimiter):
                    i += _ONE
                    point = i
                    if n_zeros == n_digits:
                        while data[i] == _ZERO:
                            i += _ONE
                        n_zeros += np.int64(i - point)
                    digit = np.uint64(data[i]) - _NOUGHT
                    while digit < _TEN:
                        w = w * _TEN + digit
                        i += _ONE
                        digit = np.uint64(data[i]) - _NOUGHT
                    power = -np.int64(i - point)
                    n_digits -= power
                is_read = 0 < n_digits <= MOST_DIGITS + n_zeros
                if is_read and (data[i] == _LOWER_E or data[i] == _UPPER_E):
                    i += _ONE
                    is_small = data[i] == _MINUS
                    if is_small or data[i] == _PLUS:
                        i += _ONE
                    first, exponent = i, np.int64(0)
                    digit = np.uint64(data[i]) - _NOUGHT
                    while digit < _TEN and i < first + _FOUR:
                        exponent = exponent * 10 + np.int64(digit)
                        i += _ONE
                        digit = np.uint64(data[i]) - _NOUGHT
                    power += -exponent if is_small else exponent
                    is_read = i > first
                if is_read:
                    if w < _EXACT_WHOLE and -_EXACT_POWER <= power <= 0:
                        value = np.float64(w) / _TENS[-power]
                    elif w == 0:
                        value = 0.0
                    elif -LARGEST_POWER <= power <= LARGEST_POWER:
                        value = nearest(w, power)
                    else:
                        value, is_read = 0.0, False
                    numbers[slots[column], row] = -value if is_negative else value
                elif n_digits == 0 and data[i] | 32 == _N and data[i + _ONE] | 32 == _A and data[i + _TWO] | 32 == _N:
                    i += _THREE
                    is_read = i == begin + _THREE
                    numbers[slots[column], row] = np.nan
                is_filled = is_filled or is_read
                while is_read and data[i] == _BLANK and not in_blanks:
                    i += _ONE
            # A number ends where its cell ends; what goes on, or is none, is taken as text up to there.
            if not is_read or not _is_end(data[i], delimiter, quoted, in_blanks):
                i = begin
                while not _is_end(data[i], delimiter, quoted, in_blanks):
                    if data[i] == _QUOTE or data[i] == _LINE_FEED:
                        return GAVE_UP, 0
                    i += _ONE
                is_filled = is_filled or i > begin
                if kind == NUMBER and i == begin:
                    numbers[slots[column], row] = np.nan
                elif kind == NUMBER:
                    if n_unusual == unusual.shape[0]:
                        return GAVE_UP, 0
                    unusual[n_unusual, 0], unusual[n_unusual, 1] = slots[column], row
                    unusual[n_unusual, 2], unusual[n_unusual, 3] = begin, i
                    n_unusual += 1
                elif kind == TEXT:
                    spans[slots[column], 0, row], spans[slots[column], 1, row] = begin, i
                elif kind == EMPTY and i > begin:
                    return GAVE_UP, 0
            if quoted:
                i += _ONE
                if not _is_end(data[i], delimiter, False, in_blanks):
                    return GAVE_UP, 0
            if column < width - 1:
                if data[i] == _LINE_FEED or data[i] == _RETURN:
                    return GAVE_UP, 0
                i += _ONE
                while in_blanks and (data[i] == _BLANK or data[i] == _TAB):
                    i += _ONE
                if in_blanks and (data[i] == _LINE_FEED or data[i] == _RETURN):
                    return GAVE_UP, 0
        while data[i] == _RETURN or (in_blanks and (data[i] == _BLANK or data[i] == _TAB)):
            i += _ONE
        if data[i] != _LINE_FEED or not is_filled:
            return GAVE_UP, 0
        i += _ONE
        row += 1
    return row, n_unusual
