"""What is doubtful about a field map: unit, sign, misfit, remanence."""

from __future__ import annotations

import math

import numpy as np

from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.declaration import HoldSettings
from pipeline.rigs.mre.hold.field_fit import FieldFit, measured_at_zero
from pipeline.rigs.mre.hold.record import Record

_LARGEST_FLUX, _LEAST_FLUX = 3.0, 2e-3  # T; the latter for 1 A


def judge_field(fit: FieldFit, record: Record, settings: HoldSettings, doubts: Doubts) -> bool:
    """Say what is doubtful about a field map; False where its numbers are not to be used."""
    largest, top = float(np.nanmax(np.abs(fit.flux))), float(np.abs(fit.current).max())
    if largest > _LARGEST_FLUX:
        doubts.reject(
            record.run,
            f"the flux density reaches {largest:.4g} T, which no such coil gives: mT taken as T (factor 1000)?",
            channel="flux_density",
        )
        return False
    if largest < _LEAST_FLUX * min(top, 1.0):
        doubts.reject(
            record.run,
            f"the flux density reaches {1e3 * largest:.3g} mT only at {top:.3g} A: T taken as mT (factor 1000), or the probe is not in the gap.",
            channel="flux_density",
        )
        return False
    if fit.values["s0"] < 0:
        doubts.doubt(
            record.run,
            "the flux density falls as the current rises: probe turned round, or sign of the current.",
            channel="flux_density",
        )
    rise = float(np.ptp(fit.flux))
    spread = math.sqrt(float(np.mean(fit.rest**2)))
    if spread > 0.02 * rise:
        doubts.doubt(
            record.run,
            f"the field law misses the flux density by {1e3 * spread:.2g} mT (rms), {100 * spread / rise:.2g} % of its range.",
            channel="flux_density",
        )
    before, after, seen = measured_at_zero(record)
    left = after if after is not None else fit.values.get("b_down")
    if left is not None and abs(left) > settings.remanence_limit and seen > 0.5:
        was = f", {1e3 * before:.2g} mT before it" if before is not None else ""
        doubts.doubt(
            record.run,
            f"{1e3 * left:.2g} mT remain at 0 A after {seen:.2g} A{was}: remanence of the core. A test at 0 A after this one does not begin without field.",
            "Demagnetise between runs, and mind their order.",
            "flux_density",
        )
    return True
