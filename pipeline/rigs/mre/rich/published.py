"""Published numbers that a rich record can be held against: Fig. 17, predicted by the identified model (mre.md section 4)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.findings import Published
from pipeline.rigs.mre.paper import DIAMETER, HEIGHT, MR_EFFECT, SHEAR_FORCE, STIFFNESS
from pipeline.rigs.mre.rich.fits import RichFit
from pipeline.rigs.mre.rich.prediction import secant_stiffness

_FREQUENCY = 2.0
_DIGITS = 5e3  # N/m, half of the last digit of Fig. 17


def published(fits: Sequence[RichFit]) -> list[Published]:
    """Return the rows that make sense for these pads, none for other devices."""
    found: dict[tuple[float, float], float] = {}
    for fit in fits:
        pads, preload = fit.usable.pads, fit.usable.preload
        if pads is None or preload is None or fit.current is None or fit.batch.inadmissible or fit.linear:
            continue
        if not math.isclose(pads.diameter, DIAMETER, rel_tol=0.02) or not math.isclose(
            pads.height, HEIGHT, rel_tol=0.05
        ):
            continue
        key = (float(round(preload / 100) * 100), float(round(fit.current)))
        stiffness = secant_stiffness(fit.batch, SHEAR_FORCE, _FREQUENCY) if key in STIFFNESS else None
        if stiffness is not None and math.isfinite(stiffness):
            found[key] = stiffness
    rows = [
        Published(
            name=f"stiffness at {preload:.0f} N preload, {current:.0f} A",
            published=STIFFNESS[preload, current],
            found=stiffness,
            unit="N/m",
            where="Fig. 17",
            agrees=bool(abs(stiffness - STIFFNESS[preload, current]) <= _DIGITS + 0.01 * stiffness),
            remark="predicted by the model of this record for 2 Hz and 200 N, which is below the record's frequencies",
        )
        for (preload, current), stiffness in sorted(found.items())
    ]
    for preload, effect in MR_EFFECT.items():
        if (preload, 0.0) in found and (preload, 6.0) in found:
            ratio = found[preload, 6.0] / found[preload, 0.0] - 1
            rows.append(
                Published(
                    name=f"MR effect at {preload:.0f} N preload, 6 A, equal force",
                    published=effect,
                    found=ratio,
                    unit="%",
                    where="section 5.3",
                    agrees=bool(abs(ratio - effect) <= 0.025),
                    remark="ratio of the predicted stiffnesses at 200 N",
                )
            )
    return rows
