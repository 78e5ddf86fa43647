"""What the device's unknown gains add to the circuit's errors where no bench tells them (type B)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.rap.pressures.hydraulics_fit import Hydraulics


def with_unknown_gains(found: Hydraulics, u: float) -> Hydraulics:
    """Return the constants with the errors that gains of relative standard uncertainty `u`, one a tap, add to them."""
    shares = _shares(found)
    widened = {name: _widened(one, u * shares.get(name, 1.0), u) for name, one in found.estimates.items()}
    return replace(found, estimates=widened)


def _shares(found: Hydraulics) -> dict[str, float]:
    """Return by how much more than one tap's gain each constant is off: differences of pressures magnify it."""
    p = {
        tap: float(np.nanmean(values[found.means.turning])) - found.zero.get(tap, 0.0)
        for tap, values in found.means.mean.items()
        if tap != "flow" and np.isfinite(values[found.means.turning]).any()
    }
    shares: dict[str, float] = {}
    if {"prefilter", "return"} <= set(p) and p["prefilter"] != p["return"]:
        shares["r_filter"] = math.hypot(p["prefilter"], p["return"]) / abs(p["prefilter"] - p["return"])
        # Ratio of two gains, and the resistances that are held fixed.
        both = math.sqrt(2.0 + 1.0 + shares["r_filter"] ** 2)
        shares |= {"c_return": both, "l_return": both}
    return shares


def _widened(one: Estimate, type_b: float, u: float) -> Estimate:
    if one.value is None or one.std_error is None:
        return one
    added = type_b * abs(one.value)
    sd, whole = math.hypot(one.std_error, added), math.hypot(one.type_b or 0.0, added)
    told = f"{one.reason.split('; gain of')[0]}; the device's own gains, {100 * u:g} % each (type B), as no bench tells them: {100 * type_b:.2g} % of it"
    logarithmic = one.name in ("c_return", "l_return", "c_uf")
    return estimate(one.name, one.value, sd, dof=one.dof, at=one.at, logarithmic=logarithmic, reason=told, type_b=whole)
