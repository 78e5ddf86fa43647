"""The paper's numbers held against its own definitions (mre.md section 4): nothing here was measured by us.

Each function returns the rows of one experiment; every row of the sheet's table stands in one of them only.
Numbers are those that Brancati, Di Massa and Pagano (2019) print, SI.
"""

from __future__ import annotations

import math

from pipeline.findings import Published
from pipeline.rigs.mre.micromechanics.dipoles import (
    MU0,
    best_fraction,
    compound_modulus,
    increment,
    young_modulus,
)

MATRIX_MODULUS, POWDER_FRACTION, POISSON_RATIO = 0.3e6, 0.25, 0.2
DIAMETER, HEIGHT = 0.05, 0.006
AREA = math.pi * DIAMETER**2 / 4
SHEAR_MODULUS, YOUNG_MODULUS = 0.66e6, 1.57e6
# Secant stiffness by preload (N) and current (A), N/m: Fig. 17, F_max 200 N, 2 Hz.
STIFFNESS = {(200.0, 0.0): 330e3, (700.0, 0.0): 500e3, (200.0, 6.0): 600e3, (700.0, 6.0): 700e3}
SHEAR_FORCE = 200.0
MR_EFFECT = {200.0: 0.82, 700.0: 0.40}
# Stiffening in compression at 2 A (Fig. 8), force increment at a fixed gap at 6 A (Fig. 10), flux there.
STIFFENING, STIFFENING_CURRENT = 0.65, 2.0
FORCE_INCREMENT, INCREMENT_CURRENT, FLUX = 0.63, 6.0, 0.8
TURNS, COIL_CURRENT, WIRE, WIRE_LENGTH, RESISTANCE, POWER = 1500, 4.0, 1.02e-3, 310.0, 6.9, 109.0
COPPER = 1.724e-8  # ohm m, 20 degrees Celsius
MEAN_COIL_DIAMETER = (0.060 + 0.108) / 2
MATRIX_DENSITY, IRON_DENSITY, DENSITY = 1080.0, 7860.0, 2590.0


def row(
    name: str, published: float | str | None, found: float | str | None, agrees: bool | None, remark: str,
    unit: str = "1", where: str = "",
) -> Published:  # fmt: skip
    """Return a row that was computed from the paper alone."""
    return Published(
        name=name, published=published, found=found, unit=unit, where=where, agrees=agrees, remark=remark, basis="paper"
    )


def modulus() -> float:
    """Return the paper's G by eq. (1), not rounded, Pa."""
    return float(compound_modulus(MATRIX_MODULUS, POWDER_FRACTION))


def young() -> float:
    """Return 2 G (1 + nu) with the paper's nu, Pa."""
    return young_modulus(modulus(), POISSON_RATIO)


def axial_rows() -> list[Published]:
    """Return the rows on compression, the material and the coil."""
    return [*_moduli(), *_micromechanics(), *_material(), *_coil()]


def shear_rows() -> list[Published]:
    """Return the rows on shear: stiffness, effect of field and preload, friction."""
    theory = 2 * modulus() * AREA / HEIGHT
    printed = [f"{value / 1e3:.0f}" for value in STIFFNESS.values()]
    amplitudes = ", ".join(f"{1e3 * SHEAR_FORCE / value:.3f}" for value in STIFFNESS.values())
    moduli = ", ".join(f"{value * HEIGHT / (2 * AREA) / 1e6:.3f}" for value in STIFFNESS.values())
    effects = [STIFFNESS[p, 6.0] / STIFFNESS[p, 0.0] - 1 for p in MR_EFFECT]
    by_preload = [STIFFNESS[700.0, current] / STIFFNESS[200.0, current] - 1 for current in (0.0, 6.0)]
    geometry = [stiffness_by_geometry(700.0, nu) / stiffness_by_geometry(200.0, nu) - 1 for nu in (0.2, 0.5)]
    friction = [SHEAR_FORCE / 2 / preload for preload in (200.0, 700.0)]
    return [
        row(
            "shear modulus without field", SHEAR_MODULUS, modulus(), agrees=bool(abs(modulus() / SHEAR_MODULUS - 1) < 0.005 / 0.66),
            remark="computed by eq. (1) from the matrix modulus 0.3 MPa and 25 % powder", unit="Pa", where="section 5.1",
        ),
        row(
            "amplitudes at the four shear stiffnesses", f"{', '.join(printed)} N/mm", f"{amplitudes} mm", None,
            f"200 N over each stiffness; two pads in parallel then have G = K h/(2A) of {moduli} MPa", where="Fig. 17",
        ),
        row(
            "2 G A/h of the two pads", None, theory, None,
            "theory without field, beside 330 to 500 N/mm measured in the paper at 200 and 700 N preload", "N/m", "section 5.1",
        ),
        row(
            "MR effect from the printed stiffness, 200 N and 700 N",
            ", ".join(f"{100 * value:.0f} %" for value in MR_EFFECT.values()),
            ", ".join(f"{100 * value:.1f} %" for value in effects),
            all(abs(e - v) < 0.005 for e, v in zip(effects, MR_EFFECT.values(), strict=True)),
            "at equal force: the amplitude shrinks with the field, so part of it is loop softening", where="section 5.3",
        ),
        row(
            "stiffness from 200 N to 700 N preload, 0 A and 6 A", "more preload, more stiffness",
            ", ".join(f"+{100 * value:.1f} %" for value in by_preload), all(value > 0 for value in by_preload),
            f"the pads' shape alone (height and area under preload, E = {young() / 1e6:.2f} MPa) gives "
            f"+{100 * geometry[0]:.0f} % with ν = 0.2 to +{100 * geometry[1]:.0f} % with 0.5: much of it is not material",
            where="Fig. 17",
        ),
        row(
            "friction that 200 N over two pads needs, at 200 N and 700 N", "no slip",
            ", ".join(f"{value:.2f}" for value in friction), None,
            "coefficient of friction; the paper measured none", where="section 5.2",
        ),
    ]  # fmt: skip


def stiffness_by_geometry(preload: float, poisson: float) -> float:
    """Return A/h of a pad squeezed by a preload (N), m: linear elastic, free to widen."""
    strain = preload / (young() * AREA)
    return AREA * (1 + poisson * strain) ** 2 / (HEIGHT * (1 - strain))


def hold_rows() -> list[Published]:
    """Return the rows on the force at a fixed gap."""
    straight = FORCE_INCREMENT * STIFFENING_CURRENT / INCREMENT_CURRENT
    pull = FLUX**2 * AREA / (2 * MU0)
    return [
        row(
            "force increment at 2 A by the straight line to 6 A, beside the stiffening there", STIFFENING, straight, agrees=False,
            remark="at a fixed gap the force is stiffness times squeeze and should rise as the stiffness does: both cannot hold "
            f"of one quantity, their ratio is {STIFFENING / straight:.1f}. Pull of the poles, relaxation or a gap that gives may explain it",
            where="Figs 8, 10",
        ),
        row(
            "pull of the poles at 0.8 T on the area of a pad", None, pull, None,
            "B^2 A/(2 μ_0): not small beside 200 N preload; a test with a rigid spacer tells it", "N", "Fig. 10",
        ),
    ]  # fmt: skip


def _moduli() -> list[Published]:
    stiffness = young() * AREA / HEIGHT
    needed = YOUNG_MODULUS / (2 * modulus()) - 1
    shape = DIAMETER / (4 * HEIGHT)
    strain = 700.0 / (stiffness * HEIGHT)
    return [
        row(
            "Young's modulus", YOUNG_MODULUS, young(), agrees=bool(abs(young() - YOUNG_MODULUS) < 0.005e6),
            remark=f"2 G (1 + ν) with ν = 0.2; the rounded G gives {young_modulus(SHEAR_MODULUS, POISSON_RATIO) / 1e6:.3f} MPa; "
            f"1.57 needs ν = {needed:.3f}, or G = {YOUNG_MODULUS / 2 / (1 + POISSON_RATIO) / 1e6:.3f} MPa", unit="Pa", where="section 5.1",
        ),
        row(
            "axial stiffness E A/h", None, stiffness, None,
            f"not printed; {YOUNG_MODULUS * AREA / HEIGHT / 1e3:.1f} kN/m with E = 1.57 MPa, "
            f"{young_modulus(SHEAR_MODULUS, POISSON_RATIO) * AREA / HEIGHT / 1e3:.1f} kN/m with G = 0.66 MPa. Faces that do not slip "
            f"would make it {1 + 2 * shape**2:.2f} times as stiff (shape factor {shape:.3f})", "N/m", "section 5.1, Fig. 9",
        ),
        row(
            "strain at 700 N preload, at most for Hooke's law", 0.1, strain, agrees=bool(strain < 0.1),
            remark="700 N over E A: outside of the range that the paper gives for Hooke's law", where="section 5.1",
        ),
    ]  # fmt: skip


def _micromechanics() -> list[Published]:
    far = 1e3  # T, saturated
    cubic, gap = (
        float(increment(POWDER_FRACTION, far, MATRIX_MODULUS, lattice="cubic")),
        float(increment(POWDER_FRACTION, 0.267, MATRIX_MODULUS)),
    )
    best = best_fraction("fixed_gap")
    return [
        row(
            "best volume fraction by eq. (8)", "0.25 to 0.30", "none below 0.52", agrees=False,
            remark="with the square of the fraction the increment rises up to the densest packing", where="section 2, Fig. 3",
        ),
        row(
            "best volume fraction by eq. (4) at a fixed gap", "0.25 to 0.30", best, agrees=bool(0.25 <= best <= 0.30),
            remark="1/√14.1, whatever the moduli are", where="section 2, Fig. 3",
        ),
        row(
            "axial stiffening at 2 A by eq. (8), at most", STIFFENING, cubic, agrees=bool(abs(cubic - STIFFENING) < 0.05),
            remark="simple cubic lattice, saturated powder", where="Fig. 8",
        ),
        row(
            "axial stiffening at 2 A by eq. (4), touching spheres", STIFFENING, gap,
            agrees=bool(abs(gap - STIFFENING) < 0.05), remark="gap ratio 1, no demagnetisation, 0.267 T; the only form that gives the printed agreement",
            where="Fig. 8",
        ),
    ]  # fmt: skip


def _material() -> list[Published]:
    nominal = POWDER_FRACTION * IRON_DENSITY + (1 - POWDER_FRACTION) * MATRIX_DENSITY
    fraction = (DENSITY - MATRIX_DENSITY) / (IRON_DENSITY - MATRIX_DENSITY)
    matrix, compound = shore_modulus(10.0), shore_modulus(33.0)
    return [
        row(
            "density of a compound with 25 % powder", DENSITY, nominal, agrees=bool(abs(nominal - DENSITY) < 5),
            remark=f"{MATRIX_DENSITY:.0f} and {IRON_DENSITY:.0f} kg/m^3 mixed; the printed density means {100 * fraction:.1f} % powder, "
            f"or {100 * (1 - DENSITY / nominal):.1f} % voids", unit="kg/m^3", where="Table 1",
        ),
        row(
            "matrix modulus G_0 from Shore A 10", MATRIX_MODULUS, matrix / 3, agrees=bool(abs(matrix / 3 / MATRIX_MODULUS - 1) < 0.2),
            remark=f"Gent's relation gives E = {matrix / 1e6:.3f} MPa, a third of it G_0", unit="Pa", where="Table 1",
        ),
        row(
            "Young's modulus from Shore A 33", YOUNG_MODULUS, compound, agrees=bool(abs(compound / YOUNG_MODULUS - 1) < 0.1),
            remark="Gent's relation for the compound", unit="Pa", where="Table 1",
        ),
        row(
            "field during curing", 0.190, 0.257, agrees=False,
            remark="190 mT in the text, 257 mT in Table 1: which one holds cannot be told", unit="T", where="section 3",
        ),
    ]  # fmt: skip


def shore_modulus(hardness: float) -> float:
    """Return Young's modulus from Shore A hardness by Gent's relation, Pa.

    Examples
    --------
    >>> round(shore_modulus(33.0) / 1e6, 3)
    1.289
    """
    return 1e6 * 0.0981 * (56 + 7.62336 * hardness) / (0.137505 * (254 - 2.54 * hardness))


def wire_diameter(gauge: int) -> float:
    """Return the diameter of an American wire gauge number, m."""
    return float(0.127e-3 * 92 ** ((36 - gauge) / 39))


def _coil() -> list[Published]:
    turn, wound = WIRE_LENGTH / TURNS, math.pi * MEAN_COIL_DIAMETER
    cold = COPPER * WIRE_LENGTH / (math.pi * WIRE**2 / 4)
    power = RESISTANCE * COIL_CURRENT**2
    gauge = min(range(10, 30), key=lambda number: abs(wire_diameter(number) - WIRE))
    gaps = [MU0 * turns / FLUX for turns in (10_000, 6_000)]
    tested = TURNS * INCREMENT_CURRENT
    return [
        row(
            "gap that 10000 and 6000 ampere-turns magnetise to 0.8 T", "10 mm (pad in the model)",
            ", ".join(f"{1e3 * gap:.1f} mm" for gap in gaps), agrees=bool(abs(gaps[1] - 0.010) < 0.0015),
            remark="μ_0 N I/B of an ideal circuit: 6000 ampere-turns fit, 10000 do not", where="section 4",
        ),
        row("ampere-turns of 1500 turns at 4 A", 6000.0, TURNS * COIL_CURRENT, agrees=bool(TURNS * COIL_CURRENT == 6000), remark="", unit="A", where="section 4"),
        row(
            "wire gauge of 1.02 mm", "AWG 17", f"AWG {gauge}", agrees=gauge == 17,
            remark=f"AWG 17 is {1e3 * wire_diameter(17):.2f} mm thick", where="section 4",
        ),
        row(
            "wire of 1500 turns", WIRE_LENGTH, TURNS * wound, agrees=bool(abs(TURNS * wound / WIRE_LENGTH - 1) < 0.1),
            remark=f"310 m is {1e3 * turn:.0f} mm a turn; a coil from 60 to 108 mm has {1e3 * wound:.0f} mm", unit="m", where="section 4",
        ),
        row(
            "coil resistance", RESISTANCE, cold, agrees=bool(abs(cold / RESISTANCE - 1) < 0.1),
            remark=f"310 m of copper, 1.02 mm thick, cold; 6.9 ohm is what it has at {20 + (RESISTANCE / cold - 1) / 0.0039:.0f} degrees Celsius",
            unit="ohm", where="section 4",
        ),
        row(
            "power at 4 A", POWER, power, agrees=bool(abs(power / POWER - 1) < 0.02),
            remark=f"6.9 ohm; {RESISTANCE * INCREMENT_CURRENT**2:.0f} W at 6 A", unit="W", where="section 4",
        ),
        row(
            "ampere-turns at 6 A", 6000.0, tested, agrees=bool(tested == 6000),
            remark="'able to' 800 mT at 6 A: with 1500 turns that is not the designed 6000 ampere-turns, so the tested coil is not clearly the designed one",
            unit="A", where="section 5.2",
        ),
    ]  # fmt: skip
