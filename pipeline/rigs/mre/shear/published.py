"""Published numbers of the shear tests beside what this campaign gives (mre.md section 4, Fig. 17)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.findings import Published
from pipeline.rigs.mre.shear.preload import PreloadState, PreloadTable
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns

# Secant stiffness by preload (N) and current (A), N/m: Fig. 17 of Brancati 2019, F_max 200 N, 2 Hz.
STIFFNESS = {(200.0, 0.0): 330e3, (700.0, 0.0): 500e3, (200.0, 6.0): 600e3, (700.0, 6.0): 700e3}
MR_EFFECT = {200.0: 0.82, 700.0: 0.40}
MATRIX_MODULUS, POWDER_FRACTION, POISSON_RATIO = 0.3e6, 0.25, 0.2
_DIGITS = 5e3  # N/m, half of the last digit that Fig. 17 gives
_PADS = (0.05, 0.006)  # m, diameter and height of the paper's pads


def compound_modulus(matrix: float, fraction: float) -> float:
    """Return the shear modulus of the compound without field, Pa (eq. 1)."""
    return matrix * (1 + 1.25 * fraction + 14.1 * fraction**2)


def published(runs: SortedRuns, preloads: PreloadTable | None) -> list[Published]:
    """Return the rows that make sense for these pads, none for other devices; checks of the paper alone come last."""
    pads = next((u.pads for u in runs.loops if u.pads is not None), None)
    if (
        pads is None
        or not math.isclose(pads.diameter, _PADS[0], rel_tol=0.02)
        or not math.isclose(pads.height, _PADS[1], rel_tol=0.05)
    ):
        return []
    states = {_key(state): state for state in (preloads.states if preloads else ())}
    rows = [
        _stiffness_row(states[preload, current], preload, current, value)
        for (preload, current), value in STIFFNESS.items()
        if (preload, current) in states
    ]
    return [*rows, *_effects(preloads), *_paper_alone()]


def _paper_alone() -> list[Published]:
    """Return what follows from the paper's own numbers, whatever was measured here."""
    diameter, height = _PADS
    modulus = compound_modulus(MATRIX_MODULUS, POWDER_FRACTION)
    return [
        Published(
            name="shear modulus without field",
            published=0.66e6,
            found=modulus,
            unit="Pa",
            where="5.1",
            agrees=True,
            remark="computed by eq. (1) from the matrix modulus 0.3 MPa and 25 % powder",
            basis="paper",
        ),
        Published(
            name="Young's modulus",
            published=1.57e6,
            found=2 * modulus * (1 + POISSON_RATIO),
            unit="Pa",
            where="5.1",
            agrees=False,
            remark="2 G (1 + nu) with nu = 0.2 gives 1.58 MPa; 1.57 needs nu = 0.193",
            basis="paper",
        ),
        Published(
            name="MR effect from the printed stiffness, 200 N and 700 N",
            published="82 %, 40 %",
            found=f"{100 * (600 / 330 - 1):.1f} %, {100 * (700 / 500 - 1):.1f} %",
            where="5.3",
            agrees=True,
            remark="at equal force: the amplitude shrinks with the field, so part of it is loop softening",
            basis="paper",
        ),
        Published(
            name="2 G A/h of the two pads",
            published=None,
            found=2 * modulus * math.pi * diameter**2 / 4 / height,
            unit="N/m",
            where="5.1",
            agrees=None,
            remark="theory without field, beside 330 to 500 N/mm measured in the paper at 200 and 700 N preload",
            basis="paper",
        ),
    ]


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
                where="5.3",
                agrees=bool(abs(effect.value - value) <= 0.015 + 1.96 * (effect.std_error or 0.0))
                if equal == "force"
                else None,
                remark="" if equal == "force" else "the paper compares at equal force; this is the material's share",
            )
        )
    return rows
