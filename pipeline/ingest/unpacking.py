"""Files that say that they unpack to far more than any log does: told by what they say, before anything is unpacked.

Gzip gains 200 to 1000 times on zeros alone, values that were never written take no bytes at all. A log of hundreds of
megabytes with one channel in fifty that is not at rest gains 60 times.
"""

from __future__ import annotations

HARMLESS = 256 << 20
LARGEST_RATIO = 100


def is_beyond_belief(stored: int, unpacked: int) -> bool:
    """Tell whether `unpacked` bytes (or more) from `stored` ones are a mistake or an attack.

    Examples
    --------
    >>> is_beyond_belief(10_000_000, 10_000_000_000), is_beyond_belief(1000, 100_000_000)
    (True, False)
    """
    return unpacked > HARMLESS and unpacked > LARGEST_RATIO * stored
