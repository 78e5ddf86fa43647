"""What one recording tells without the dynamic model: what identification would say of it alone (mre.md section 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.shear.declaration import ShearSettings
from pipeline.rigs.mre.shear.samples import pads_of
from pipeline.rigs.nothing_usable import nothing_usable

# Plausible shear moduli of elastomers, Pa.
MODULUS_RANGE = (0.05e6, 10e6)
# Share of the work of a block-shaped loop below which a sign of the work says nothing.
LEAST_WORK = 0.02


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for what leaves the run out, else for inverted channels and implausible stiffness.

    A passive device dissipates: the loop of F over x, F up and x right, runs clockwise, and force
    rises with displacement.

    Raises
    ------
    InputError
        If the run alone leaves nothing to identify: a dead channel, no motion.
    """
    from pipeline.rigs.mre.shear.runs import sort_runs

    alone = sort_runs([recording], ShearSettings())
    if alone.left_out:
        if not alone.faulty:
            raise InputError(nothing_usable(alone.left_out, [recording]))
        return [finding for finding in alone.quality if finding.level == "error"]
    if recording.stream_of("displacement") is not recording.stream_of("force"):
        return ()
    x, F = recording.values("displacement"), recording.values("force")
    valid = np.isfinite(x) & np.isfinite(F)
    x, F = x[valid] - x[valid].mean(), F[valid]
    found: list[QualityFinding] = []
    F = F - F.mean()
    slope = float(x @ F / (x @ x))
    correlation = float(x @ F / math.sqrt((x @ x) * (F @ F)))
    if correlation < -0.3:
        found.append(
            QualityFinding(
                "warning",
                f"force falls as displacement rises (correlation {correlation:.2f}): one of the two has the wrong "
                "sign; mend it in the recipe with 'sign: -1'.",
            )
        )
    else:
        # Work put in over the path, as a share of what a block of rms force would need.
        path = float(np.abs(np.diff(x)).sum()) * math.sqrt(float(F @ F) / F.size)
        work = float(np.trapezoid(F, x))
        if work < -LEAST_WORK * path:
            found.append(
                QualityFinding(
                    "warning",
                    "the loop of force over displacement runs the wrong way round, as if the sample gave energy, though "
                    "force rises with displacement: the force may be late (a filter, or clocks that are offset), or the two channels "
                    "swapped.",
                )
            )
    pads = pads_of(recording)
    if pads is not None and slope > 0:
        modulus = slope * pads.modulus_per_stiffness
        if not MODULUS_RANGE[0] <= modulus <= MODULUS_RANGE[1]:
            factor = 1000 if modulus < MODULUS_RANGE[0] else 0.001
            found.append(
                QualityFinding(
                    "warning",
                    f"the loop means a shear modulus of {modulus / 1e6:.3g} MPa, outside {MODULUS_RANGE[0] / 1e6:g} to "
                    f"{MODULUS_RANGE[1] / 1e6:g} MPa: check the units of displacement, force and pad size "
                    f"(mm taken as m, or N as kN, is a factor {factor:g}).",
                )
            )
    return found
