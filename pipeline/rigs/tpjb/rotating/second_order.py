"""The orbit to second order in the load, on paper: which coefficient makes which turning part.

For kxx = kyy = k without cross coupling. It explains (three lobes, the 2X line, the mean shift); it is not
fitted: at 36 % load the third order counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SecondOrder:
    """Complex amplitudes (m) of 1X forward, the mean shift, 2X forward and 2X backward (the lobes)."""

    Z1: complex
    Z0: complex
    Z2: complex
    Zm2: complex


def second_order(p: np.ndarray, size: float) -> SecondOrder:
    """Return the turning parts of the orbit under a circular load of `size` (N), to second order.

    z = A1 e^{i psi} + Z0 + Z2 e^{2 i psi} + Zm2 e^{-2 i psi}, A1 = F/k (tpjb.md section 3).

    Parameters
    ----------
    p
        The ten coefficients; k is the mean of kxx and kyy, cross coupling does not enter.

    Examples
    --------
    Without mixed terms both 2X parts are of equal size: the filtered orbit is a line.

    >>> parts = second_order(np.array([1.0, 0, 0, 1.0, 0.1, -0.2, 0.3, 0.4, 0, 0]), 0.1)
    >>> abs(parts.Z2) == abs(parts.Zm2)
    True
    """
    kxx2, kxy2, kyx2, kyy2, kxxy, kyxy = p[4:].tolist()
    k = 0.5 * float(p[0] + p[3])
    first = size / k
    forward = complex(kxx2 - kxy2 + kyxy, kyx2 - kyy2 - kxxy) / 4
    backward = complex(kxx2 - kxy2 - kyxy, kyx2 - kyy2 + kxxy) / 4
    mean = complex(kxx2 + kxy2, kyx2 + kyy2) / 2
    scale = -(first**2) / k
    return SecondOrder(complex(first), mean * scale, forward * scale, backward * scale)
