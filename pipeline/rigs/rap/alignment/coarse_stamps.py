"""What stamps coarser than the samples leave open of a lag: ingest spreads such rows evenly, from the first stamp on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.rigs.rap.alignment.pair import Pair


@dataclass(frozen=True)
class SpreadErrors:
    """Standard uncertainties of lag (s) and rate (1) because rows were spread between coarse stamps, and the words for it."""

    lag: float = 0.0
    rate: float = 0.0
    remark: str = ""


def spread_errors(pairs: Sequence[Pair]) -> SpreadErrors:
    """Return what the spreading may have done to lag and rate; nothing where each sample has a stamp of its own.

    The first row lies anywhere within the step of the stamps, before or behind its stamp as the logger cuts or rounds: an
    even distribution over one step to both sides. From step to step the place of the first row creeps by up to one sample.
    """
    pair = max(pairs, key=lambda one: one.rows_per_stamp)
    if pair.rows_per_stamp <= 1.0:
        return SpreadErrors()
    slow = min(pair.device, pair.bench, key=lambda one: one.rate)
    step = pair.rows_per_stamp / slow.rate
    rate = 1.0 / slow.rate / float(slow.time[-1] - slow.time[0])
    return SpreadErrors(
        step / math.sqrt(3.0),
        rate,
        f"stamps come in steps of {step:.3g} s, {pair.rows_per_stamp:.3g} rows a step: where within it the rows lie is not known (standard "
        f"uncertainty {step / math.sqrt(3.0):.2g} s of the lag, {1e6 * rate:.2g} ppm of the rate)",
    )
