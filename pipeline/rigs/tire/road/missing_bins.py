"""Least squares under correlated noise with bins missing: what stands in their place so that they carry no weight.

Compiled; numba is imported here.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np


@nb.njit(cache=True)
def fill(kernel: np.ndarray, weighted: np.ndarray, missing: np.ndarray, columns: np.ndarray) -> None:
    """Set the missing bins of each column to what the noise seen beside them makes most likely.

    With Lambda the inverse covariance of a whole revolution, that of the bins seen alone is
    Lambda_ss - Lambda_sm Lambda_mm^-1 Lambda_ms: the same as Lambda with y_m = -Lambda_mm^-1 Lambda_ms y_s filled in.

    Parameters
    ----------
    kernel
        First row of the circulant Lambda of each revolution, shape (m, M).
    weighted
        Lambda times the columns with zeros in the missing bins, shape (m, p, M).
    missing
        bool, shape (m, M).
    columns
        Shape (m, p, M); filled in place.
    """
    rows, count, M = columns.shape
    at = np.empty(M, dtype=np.int64)
    L = np.empty((M, M))
    for j in range(rows):
        n = 0
        for i in range(M):
            if missing[j, i]:
                at[n] = i
                n += 1
        for a in range(n):
            for b in range(a + 1):
                total = kernel[j, at[a] - at[b]]
                if a == b:
                    total *= 1.0 + 1e-10
                for k in range(b):
                    total -= L[a, k] * L[b, k]
                if a == b:
                    L[a, a] = math.sqrt(max(total, 1e-30))
                else:
                    L[a, b] = total / L[b, b]
        for p in range(count):
            for a in range(n):
                total = -weighted[j, p, at[a]]
                for k in range(a):
                    total -= L[a, k] * columns[j, p, at[k]]
                columns[j, p, at[a]] = total / L[a, a]
            for a in range(n - 1, -1, -1):
                total = columns[j, p, at[a]]
                for k in range(a + 1, n):
                    total -= L[k, a] * columns[j, p, at[k]]
                columns[j, p, at[a]] = total / L[a, a]
