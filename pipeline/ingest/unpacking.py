"""Files that say that they unpack to far more than any log does: told by what they say, before anything is unpacked.

Gzip gains 1000 times on zeros alone, values that were never written take no bytes at all; logs with many channels at rest
gain some hundred times.
"""

from __future__ import annotations

HARMLESS = 256 << 20
LARGEST_RATIO = 500


def is_beyond_belief(stored: int, unpacked: int) -> bool:
    """Tell whether `unpacked` bytes (or more) from `stored` ones are a mistake or an attack.

    Examples
    --------
    >>> is_beyond_belief(10_000_000, 10_000_000_000), is_beyond_belief(1000, 100_000_000)
    (True, False)
    """
    return unpacked > HARMLESS and unpacked > LARGEST_RATIO * stored
