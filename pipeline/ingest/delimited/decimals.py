"""Decimal digits -> the nearest double, compiled: for numbers of many digits, which no single division rounds rightly.

A product of 128 bits with a table of powers of five (Lemire, "Number parsing at a gigabyte per second", Software:
Practice and Experience 51, 2021; that no case needs more bits: Mushtak and Lemire, "Fast number parsing without
fallback", 2023).
"""

from __future__ import annotations

import numba
import numpy as np

MOST_DIGITS = 19  # fit into 64 bits
LARGEST_POWER = 80  # beyond it Python must tell
_MOST_TWOS = 400  # 10^80 is below 2^266, and 64 bits of digits
_TWOS = np.array([2.0**power for power in range(-_MOST_TWOS, _MOST_TWOS + 1)])


def _five_to(power: int) -> int:
    """Return the leading 128 bits of 5^power; those that halves of doubles can meet (to -27) are rounded up."""
    value: int = 5 ** abs(power)
    if power >= 0:
        bits = value.bit_length()
        return value << (128 - bits) if bits <= 128 else value >> (bits - 128)
    bits = (value - 1).bit_length()
    if power >= -27:
        return (1 << (bits + 127)) // value + 1
    reciprocal = (1 << (2 * bits + 128)) // value + 1
    return reciprocal >> (reciprocal.bit_length() - 128)


_FIVES = [_five_to(power) for power in range(-LARGEST_POWER, LARGEST_POWER + 1)]
_FIVES_HIGH = np.array([five >> 64 for five in _FIVES], dtype=np.uint64)
_FIVES_LOW = np.array([five & (2**64 - 1) for five in _FIVES], dtype=np.uint64)


@numba.njit(inline="always")
def _high_and_low(a, b):  # type: ignore[no-untyped-def]
    """Return the upper and lower 64 bits of the product of two 64-bit numbers."""
    mask, half = np.uint64(0xFFFFFFFF), np.uint64(32)
    a0, a1, b0, b1 = a & mask, a >> half, b & mask, b >> half
    low, first, second, high = a0 * b0, a1 * b0, a0 * b1, a1 * b1
    middle = (low >> half) + (first & mask) + (second & mask)
    return high + (first >> half) + (second >> half) + (middle >> half), a * b


@numba.njit(inline="always")
def _leading_zeros(w):  # type: ignore[no-untyped-def]
    count = np.int64(0)
    for width in (32, 16, 8, 4, 2, 1):
        if w >> np.uint64(64 - width) == np.uint64(0):
            w = w << np.uint64(width)
            count += width
    return count


@numba.njit(nogil=True, cache=True)
def nearest(w, power):  # type: ignore[no-untyped-def]
    """Return the double nearest to w * 10^power.

    Parameters
    ----------
    w : uint64
        The digits as a whole number, not zero.
    power : int64
        Power of ten, at most `LARGEST_POWER` either way.
    """
    zeros = _leading_zeros(w)
    w = w << np.uint64(zeros)
    place = power + LARGEST_POWER
    high, low = _high_and_low(w, _FIVES_HIGH[place])
    if high & np.uint64(0x1FF) == np.uint64(0x1FF):
        more, _ = _high_and_low(w, _FIVES_LOW[place])
        low = low + more
        if low < more:
            high = high + np.uint64(1)
    upper = np.int64(high >> np.uint64(63))
    shift = np.uint64(upper + 9)
    mantissa = high >> shift
    exponent = ((217706 * power) >> 16) + 63 + upper - zeros  # of two, for a mantissa between 1 and 2
    is_half = low <= np.uint64(1) and -4 <= power <= 23 and mantissa & np.uint64(3) == np.uint64(1)
    if is_half and mantissa << shift == high:
        mantissa = mantissa & ~np.uint64(1)
    mantissa = (mantissa + (mantissa & np.uint64(1))) >> np.uint64(1)
    return np.float64(mantissa) * _TWOS[exponent - 52 + _MOST_TWOS]
