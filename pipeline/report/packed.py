"""Numbers packed as text that a page's script unpacks: 24 bits each, in base64, or first and step alone.

Not for keeping results: findings.json and its arrays hold the numbers as they are.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from typing import NotRequired, TypedDict

import numpy as np

LEVELS = 0xFFFFFE  # the largest code of a number
_MISSING = 0xFFFFFF
_AS_GOOD_AS_UNIFORM = 1e-7  # of the span


class Packed(TypedDict):
    """`n` numbers ``first + step * code``: `codes` of three bytes each, 0, 1, 2, ... without; ten to their power where `log`."""

    n: int
    first: float
    step: float
    codes: NotRequired[str]
    log: NotRequired[bool]


def pack(values: np.ndarray, log: bool = False) -> Packed:
    """Pack numbers to within half of the 16 777 214th part of their span (of their logarithms' where `log`).

    Parameters
    ----------
    values
        Shape (n,); what is not finite comes back as NaN, as does what is not positive where `log`.
    """
    values = np.asarray(values, float)
    if log:
        values = np.log10(np.where(values > 0, values, np.nan))
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    packed: Packed = {"n": int(values.size), "first": low, "step": (high - low) / LEVELS}
    if log:
        packed["log"] = True
    if values.size > 1 and finite.all():
        uniform = np.linspace(values[0], values[-1], values.size)
        if np.abs(values - uniform).max() <= _AS_GOOD_AS_UNIFORM * (high - low):
            packed["first"], packed["step"] = float(values[0]), float((values[-1] - values[0]) / (values.size - 1))
            return packed
    codes = np.full(values.size, _MISSING, dtype=">u4")
    codes[finite] = np.rint((values[finite] - low) / (packed["step"] or 1.0)).astype(np.uint32)
    packed["codes"] = b64encode(codes.view(np.uint8).reshape(-1, 4)[:, 1:].tobytes()).decode()
    return packed


def unpack(packed: Packed) -> np.ndarray:
    """Return the numbers, shape (n,), as the page's script does.

    Examples
    --------
    >>> unpack(pack(np.array([1.0, np.nan, 3.0])))
    array([ 1., nan,  3.])
    """
    if "codes" in packed:
        raw = np.frombuffer(b64decode(packed["codes"]), np.uint8).reshape(-1, 3).astype(np.uint32)
        codes = (raw[:, 0] << 16) + (raw[:, 1] << 8) + raw[:, 2]
        values = np.where(codes == _MISSING, np.nan, packed["first"] + packed["step"] * codes)
    else:
        values = packed["first"] + packed["step"] * np.arange(packed["n"])
    return 10.0**values if packed.get("log") else values
