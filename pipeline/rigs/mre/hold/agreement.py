"""Do several sweeps of a campaign agree? Force at 0 A and increments of one run against another's."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.errors import listing
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.analysis import Analysed

_REPEAT = 0.03  # relative, by which repeats may differ
_SURE = 4.0  # standard errors


def judge_repeats(analysed: Sequence[Analysed], doubts: Doubts) -> None:
    """Say where several sweeps do not agree in the force at 0 A or in the increments."""
    for number, first in enumerate(analysed):
        for second in analysed[number + 1 :]:
            told = _differences(first, second)
            if told:
                doubts.doubt(
                    None,
                    f"runs {first.run} and {second.run} differ: {listing(told)}. Each has numbers of its own; they are not repeats of one state.",
                    "Check pad, gap, temperature and the order of the runs (Mullins effect); repeat the first run at the end.",
                )


def _differences(first: Analysed, second: Analysed) -> list[str]:
    """Return in words how two runs differ beyond their errors and a few per cent."""
    told = []
    a, b = first.fit, second.fit
    off, sd = b.F0 / a.F0 - 1, math.hypot(a.sd({"F0": 1.0}) / a.F0, b.sd({"F0": 1.0}) / b.F0)
    if abs(off) > max(_REPEAT, _SURE * sd):
        told.append(f"the force at 0 A by {100 * off:.2g} %")
    top = min(float(a.rows.current.max()), float(b.rows.current.max()))
    (one, one_sd), (two, two_sd) = a.increment(top), b.increment(top)
    if one and abs(two / one - 1) > max(_REPEAT, _SURE * math.hypot(one_sd, two_sd) / abs(one)):
        told.append(f"the increment at {top:.3g} A by {100 * (two / one - 1):.2g} %")
    return told
