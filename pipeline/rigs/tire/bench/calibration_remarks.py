"""Sentences on a calibration: few loads, lack of fit, friction of the guide, offset of the load cell."""

from __future__ import annotations

import math

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.in_words import chance
from pipeline.rigs.tire.bench.calibration_curve import Curve
from pipeline.rigs.tire.bench.calibration_loads import offset_of
from pipeline.rigs.tire.bench.calibration_scatter import LackOfFit

# Up against down, over the load at mid-range.
_MOST_HYSTERESIS = 0.02


def remarks_on(
    curve: Curve,
    count: int,
    lack: LackOfFit | None,
    friction: Estimate | None,
    zero: Estimate | None,
    mass: float | None,
) -> tuple[str, ...]:
    """Return the sentences; `count` loads, `mass` (kg) of beam and axle where known."""
    middle = 0.5 * (curve.least + curve.most)
    said = []
    if count < 5:
        reading = curve.load_of(float(curve.at(middle)), math.inf)
        said.append(
            f"The calibration rests on {count} loads ({curve.dof} degree{'s' * (curve.dof != 1)} of freedom); a load at "
            f"mid-range is known to +-{0.5 * (reading.high - reading.low):.0f} N. Five loads or more are advised."
        )
    if lack is not None and lack.found:
        said.append(
            f"The peaks miss a {'parabola' if curve.degree == 2 else 'straight line'} by {lack.size:.1f} N rms, more than "
            f"{lack.against} explain (as much by chance: {chance(lack.p_value)}); the intervals hold that."
        )
    if friction is not None and friction.value is not None and friction.ci95 is not None:
        share = 2.0 * abs(friction.value) / middle
        if share > _MOST_HYSTERESIS and not friction.ci95[0] <= 0.0 <= friction.ci95[1]:
            said.append(
                f"Loading up and down differ by {100.0 * share:.1f} % of the load: guide friction about {abs(friction.value):.0f} N "
                "between load cell and tire; the calibration uses loads freed of it."
            )
    offset = offset_of(curve, zero)
    if offset is not None:
        weight = f"; the moving mass weighs {mass * 9.80665:.0f} N" if mass else ""
        said.append(
            f"The curve has no peak at {offset:.0f} N instead of 0 N: the load cell seems off by that "
            f"(weight of beam and axle not tared?){weight}."
        )
    return tuple(said)
