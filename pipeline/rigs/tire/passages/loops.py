"""The loops over all samples, compiled: fits of a passage, bins of angle (tire.md, 5.3-5.4).

Positions are in samples from the beginning of a stretch. Numba is imported here.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np

# Half a fit's window, in revolutions.
WINDOW = 0.12


@nb.njit(cache=True)
def _phase(i: float, knots: np.ndarray, slopes: np.ndarray, k: int) -> Any:
    """Return the phase, revolutions, at position i between knots k and k + 1 (cubic Hermite), straight beyond the ends."""
    last = knots.size - 1
    if k < 0:
        return slopes[0] * (i - knots[0])
    if k >= last:
        return last + slopes[last] * (i - knots[last])
    h = knots[k + 1] - knots[k]
    u = (i - knots[k]) / h
    return k + u * (
        h * slopes[k] + u * (3.0 - h * (2.0 * slopes[k] + slopes[k + 1]) + u * (h * (slopes[k] + slopes[k + 1]) - 2.0))
    )


@nb.njit(cache=True)
def _read(table: np.ndarray, place: float) -> Any:
    """Return a periodic table at a place counted in its own steps, straight between them."""
    n = table.size
    low = math.floor(place)
    share = place - low
    j = int(low) % n
    return table[j] + share * (table[(j + 1) % n] - table[j])


@nb.njit(cache=True)
def passage_sums(
    values: np.ndarray, knots: np.ndarray, slopes: np.ndarray, T: np.ndarray, dT: np.ndarray
) -> np.ndarray:
    """Return, for each knot, the sums of the least squares of [T, T', 1] on the valid samples round it.

    T, T' are the template and its derivative by angle on an even periodic grid that begins at angle -pi. Columns:
    TT, TD, T1, DD, D1, valid samples, yT, yD, y1, yy, samples of the window, and WT, WD, W1 with W = angle T'; shape
    (m, 14).
    """
    m, N = knots.size, T.size
    out = np.zeros((m, 14))
    for k in range(m):
        before = knots[k] - knots[k - 1] if k > 0 else knots[1] - knots[0]
        after = knots[k + 1] - knots[k] if k < m - 1 else before
        first = math.ceil(knots[k] - WINDOW * before)
        last = math.floor(knots[k] + WINDOW * after)
        s = out[k]
        origin, known = 0.0, False
        s[10] = last - first + 1
        for i in range(max(first, 0), min(last, values.size - 1) + 1):
            y = values[i]
            if y != y:
                continue
            if not known:
                origin, known = y, True
            y -= origin
            p = _phase(float(i), knots, slopes, k - 1 if i < knots[k] else k) - k
            place = (p + 0.5) * N
            t, d = _read(T, place), _read(dT, place)
            s[0] += t * t
            s[1] += t * d
            s[2] += t
            s[3] += d * d
            s[4] += d
            s[5] += 1.0
            s[6] += y * t
            s[7] += y * d
            s[8] += y
            s[9] += y * y
            w = 2.0 * math.pi * p * d
            s[11] += w * t
            s[12] += w * d
            s[13] += w
    return out


@nb.njit(cache=True)
def sums_by_angle(
    values: np.ndarray,
    knots: np.ndarray,
    slopes: np.ndarray,
    chosen: np.ndarray,
    total: np.ndarray,
    count: np.ndarray,
) -> None:
    """Add up sum and number of the valid samples by bins of angle, a row for each `chosen` revolution."""
    bins = count.shape[1]
    for row in range(chosen.size):
        k = chosen[row]
        first = max(math.ceil(_crossing(knots, slopes, k - 1)), 0)
        last = min(math.ceil(_crossing(knots, slopes, k)), values.size)
        for i in range(first, last):
            if values[i] == values[i]:
                p = _phase(float(i), knots, slopes, k - 1 if i < knots[k] else k) - k + 0.5
                b = int(p * bins + 0.5) % bins
                total[row, b] += values[i]
                count[row, b] += 1


@nb.njit(cache=True)
def in_bins(
    flex: np.ndarray,
    film: np.ndarray,
    knots: np.ndarray,
    slopes: np.ndarray,
    first: int,
    flex_template: np.ndarray,
    film_template: np.ndarray,
    scale: np.ndarray,
    VIN: float,
    R1: float,
    flipped: bool,
    resistance: np.ndarray,
    volts: np.ndarray,
    count: np.ndarray,
    film_count: np.ndarray,
) -> None:
    """Fill R2 of the flex sensor and volts of the film by bins of angle, and their valid samples, shape (m, bins) each.

    Rows are the revolutions round the knots from `first` on. Bin b stands round the angle (b - bins/2) 2 pi/bins; each
    sample is carried to its bin's middle along the templates (even grids from -pi), that of R2 times `scale`. An empty
    `film` is left out.
    """
    m, bins = count.shape
    N = flex_template.size
    per_bin = N // bins
    with_film = film.size > 0
    for row in range(m):
        k = first + row
        begin = max(math.ceil(_crossing(knots, slopes, k - 1)), 0)
        end = min(math.ceil(_crossing(knots, slopes, k)), flex.size)
        for i in range(begin, end):
            y = flex[i]
            z = film[i] if with_film else np.nan
            if y != y and z != z:
                continue
            p = _phase(float(i), knots, slopes, k - 1 if i < knots[k] else k) - k + 0.5
            at = p * bins
            b = int(at + 0.5)
            place = p * N
            low = int(place)
            share = place - low
            low %= N
            high = (low + 1) % N
            b %= bins
            middle = b * per_bin
            if z == z:
                T = film_template[low] + share * (film_template[high] - film_template[low])
                volts[row, b] += z - (T - film_template[middle])
                film_count[row, b] += 1
            if flipped:
                y = VIN - y
            if 0.0 < y < VIN:
                T = flex_template[low] + share * (flex_template[high] - flex_template[low])
                resistance[row, b] += R1 * y / (VIN - y) - scale[row] * (T - flex_template[middle])
                count[row, b] += 1
        for b in range(bins):
            resistance[row, b] = resistance[row, b] / count[row, b] if count[row, b] else np.nan
            if with_film:
                volts[row, b] = volts[row, b] / film_count[row, b] if film_count[row, b] else np.nan


@nb.njit(cache=True)
def _crossing(knots: np.ndarray, slopes: np.ndarray, k: int) -> Any:
    """Return where the phase is k + 1/2, by Newton's method; beyond the ends along the straight line."""
    last = knots.size - 1
    if k < 0:
        return knots[0] + (k + 0.5) / slopes[0]
    if k >= last:
        return knots[last] + (k + 0.5 - last) / slopes[last]
    low, high = knots[k], knots[k + 1]
    at = 0.5 * (low + high)
    for _ in range(40):
        middle = 0.5 * (low + high)
        if _phase(middle, knots, slopes, k) < k + 0.5:
            low = middle
        else:
            high = middle
        at = 0.5 * (low + high)
        if high - low < 1e-6:
            break
    return at
