"""Published numbers of the shear tests beside what this campaign gives (mre.md section 4, Fig. 17)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.findings import Published
from pipeline.rigs.mre.paper import DIAMETER, HEIGHT, MR_EFFECT, STIFFNESS, shear_rows
from pipeline.rigs.mre.shear.preload import PreloadState, PreloadTable
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns

_DIGITS = 5e3  # N/m, half of the last digit that Fig. 17 gives


def published(runs: SortedRuns, preloads: PreloadTable | None) -> list[Published]:
    """Return the rows that make sense for these pads, none for other devices; checks of the paper alone come last."""
    pads = next((u.pads for u in runs.loops if u.pads is not None), None)
    if (
        pads is None
        or not math.isclose(pads.diameter, DIAMETER, rel_tol=0.02)
        or not math.isclose(pads.height, HEIGHT, rel_tol=0.05)
    ):
        return []
    states = {_key(state): state for state in (preloads.states if preloads else ())}
    rows = [
        _stiffness_row(states[preload, current], preload, current, value)
        for (preload, current), value in STIFFNESS.items()
        if (preload, current) in states
    ]
    return [*rows, *_effects(preloads), *shear_rows()]


def _key(state: PreloadState) -> tuple[float, float]:
    return (round(state.preload / 100) * 100.0, float(round(state.current)))


def _stiffness_row(state: PreloadState, preload: float, current: float, value: float) -> Published:
    found = state.secant.value
    half = 1.96 * (state.secant.std_error or 0.0) + _DIGITS
    comparable = abs(state.force_amplitude - 200) < 10 and abs(state.frequency - 2) < 0.1
    remark = (
        ""
        if comparable
        else (
            f"not comparable: measured at {state.force_amplitude:.0f} N and {state.frequency:.3g} Hz, "
            "published at 200 N and 2 Hz"
        )
    )
    return Published(
        name=f"stiffness at {preload:.0f} N preload, {current:.0f} A",
        published=value,
        found=found,
        unit="N/m",
        where="Fig. 17",
        agrees=bool(abs(found - value) <= half) if comparable and found is not None else None,
        remark=remark,
    )


def _effects(preloads: PreloadTable | None) -> Sequence[Published]:
    rows = []
    for effect in preloads.effects if preloads else ():
        preload = round(float(effect.at["preload"]) / 100) * 100.0
        if round(float(effect.at["coil_current"])) != 6 or preload not in MR_EFFECT or effect.value is None:
            continue
        equal = "force" if effect.name == "mr_effect_force" else "amplitude"
        value = MR_EFFECT[preload]
        rows.append(
            Published(
                name=f"MR effect at {preload:.0f} N preload, 6 A, equal {equal}",
                published=value,
                found=effect.value,
                unit="%",
                where="section 5.3",
                agrees=bool(abs(effect.value - value) <= 0.015 + 1.96 * (effect.std_error or 0.0))
                if equal == "force"
                else None,
                remark="" if equal == "force" else "the paper compares at equal force; this is the material's share",
            )
        )
    return rows
