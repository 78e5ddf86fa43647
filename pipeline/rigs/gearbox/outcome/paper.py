"""The paper's numbers held against its own definitions (gearbox.md, section 4): nothing here was measured by us.

Every figure is computed from the torques and teeth that González-Cruz and Ceccarelli (2019) print.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Published
from pipeline.rigs.gearbox.torques.torque_map import Line, straight_line

RPM = 2.0 * math.pi / 60.0
SPEEDS = (120, 210)
# Torque at the input and at the output, N m, by state and speed; printed to 0.01 N m.
STARTUP, FOS, BRAKE, SOS = "start-up peak", "FOS nominal", "brake peak", "SOS nominal"
TORQUES = {
    STARTUP: {120: (1.38, 0.54), 210: (1.75, 0.77)},
    FOS: {120: (0.94, 0.30), 210: (0.89, 0.34)},
    BRAKE: {120: (2.17, 0.97), 210: (2.40, 1.20)},
    SOS: {120: (1.41, 0.56), 210: (1.83, 0.76)},
}
# What the paper calls torque reduction (input, output), inertial mass and friction torque.
REDUCTION = {120: (0.65, 0.57), 210: (0.76, 0.63)}
INERTIAL_MASS, FRICTION_TORQUE, EFFICIENCY = 0.89, 1.23, 0.40
_ROUNDING = 0.005
# What the difference of the two sensors is in each state.
_DIFFERENCE = {
    STARTUP: "the difference accelerates the gearbox and goes to ground",
    FOS: "locked gears do not slide: the difference is drag to ground or a sensor's error, not friction between gears",
    BRAKE: "locked still: the difference is drag to ground or a sensor's error",
    SOS: "the output stands, so the ratio is that of a reaction; what the gears rub away shows in the power, not in the difference",
}
_SIDES = ("input", "output")
_SHORT = ("in", "out")
_WHERE = "sections 4, 5"


def paper_line(*speeds: int) -> Line:
    """Return the line through the paper's points (T_in, T_out) at these speeds, rpm.

    Examples
    --------
    >>> line = paper_line(120)
    >>> round(line.slope, 4), round(line.intercept, 4), line.largest_residual < 0.003
    (0.5443, -0.2104, True)
    """
    points = np.array([TORQUES[state][rpm] for rpm in speeds for state in TORQUES])
    return straight_line(points[:, 0], points[:, 1])


def paper_alone() -> list[Published]:
    """Return the checks of the paper's own numbers."""
    return [*_torques(), *_reductions(), *_excesses(), *_efficiency(), *_line(), *_lock(), *_speed()]


def row(
    name: str, published: float | str | None, found: float | str | None, agrees: bool | None, remark: str, unit: str = "1",
    where: str = _WHERE,
) -> Published:  # fmt: skip
    """Return a row that was computed from the paper alone."""
    return Published(
        name=name, published=published, found=found, unit=unit, where=where, agrees=agrees, remark=remark, basis="paper"
    )


def _torques() -> list[Published]:
    rows = []
    for rpm in SPEEDS:
        for state, values in TORQUES.items():
            t_in, t_out = values[rpm]
            rows.append(
                row(
                    f"{state}, {rpm} rpm: input and output torque", f"{t_in:.2f} and {t_out:.2f} N m",
                    f"difference {t_in - t_out:.2f} N m, ratio {t_out / t_in:.3f}", None,
                    _DIFFERENCE[state],
                )
            )  # fmt: skip
    return rows


def _reductions() -> list[Published]:
    rows = []
    for rpm in SPEEDS:
        for side in (1, 0):
            peak, level = TORQUES[BRAKE][rpm][side], TORQUES[SOS][rpm][side]
            printed, relief, residual = REDUCTION[rpm][side], 1.0 - level / peak, level / peak
            rows.append(
                row(
                    f"torque reduction, {_SIDES[side]}, {rpm} rpm", printed, relief, abs(printed - relief) < 0.01,
                    f"the definition (peak less nominal, over peak) gives {peak - level:.2f}/{peak:.2f}; the paper printed "
                    f"what is left, nominal over peak = {residual:.3f}. Reported as torque_relief_{_SHORT[side]} and "
                    f"torque_residual_{_SHORT[side]}", "%",
                )
            )  # fmt: skip
    up = [TORQUES[SOS][rpm][0] / TORQUES[FOS][rpm][0] for rpm in SPEEDS]
    rows.append(
        row(
            "what SOS relieves", "torque", f"{up[0]:.2f} and {up[1]:.2f} times the FOS level", None,
            "input torque in SOS over that in FOS at 120 and 210 rpm: SOS cuts the peak, and raises the level",
        )
    )  # fmt: skip
    return rows


def _excess(state: str, reference: str, rpm: int, side: int) -> float:
    return TORQUES[state][rpm][side] - TORQUES[reference][rpm][side]


def _excesses() -> list[Published]:
    start = {(rpm, side): _excess(STARTUP, FOS, rpm, side) for rpm in SPEEDS for side in (0, 1)}
    drop = {(rpm, side): _excess(BRAKE, SOS, rpm, side) for rpm in SPEEDS for side in (0, 1)}
    rise = _excess(BRAKE, FOS, 120, 0)
    odd = TORQUES[SOS][210][0] - TORQUES[FOS][120][0]
    rows = [
        row(
            "\"inertial mass\" M_I, input, 120 rpm", INERTIAL_MASS, start[120, 0], False,
            f"start-up peak less low-load nominal; at 210 rpm {start[210, 0]:.2f}, output {start[120, 1]:.2f} and "
            f"{start[210, 1]:.2f} N m. No pair of 120 rpm values gives 0.89: it is the FOS torque at 210 rpm "
            f"({TORQUES[FOS][210][0]:.2f}), also {TORQUES[SOS][210][0]:.2f} - {TORQUES[FOS][120][0]:.2f} = {odd:.2f}. A torque "
            "is no mass: reported as startup_excess_in; the inertia is inertia_load", "N*m",
        ),
        row(
            "friction torque T_f, input, 120 rpm", FRICTION_TORQUE, drop[120, 0], False,
            f"brake peak less high-load nominal; at 210 rpm {drop[210, 0]:.2f}, output {drop[120, 1]:.2f} and "
            f"{drop[210, 1]:.2f} N m. 1.23 is the peak less the low-load nominal ({rise:.2f}). Reported as breakaway_drop_in "
            "(definition) and breakaway_rise_in (the number)", "N*m",
        ),
    ]  # fmt: skip
    speeds = SPEEDS[1] / SPEEDS[0]
    for side in (1, 0):
        ratio = start[210, side] / start[120, side]
        low, high = _ratio_limits(start[210, side], start[120, side])
        inside = low <= speeds <= high
        told = (
            "as an inertia with equal ramp times would; J_L is then "
            + " and ".join(f"{start[rpm, side] / (rpm * RPM):.4f}" for rpm in SPEEDS)
            + " kg m2 for each second of a linear ramp"
            if inside
            else "not an inertia alone"
        )
        rows.append(
            row(
                f"start-up excess at 210 over 120 rpm, {_SIDES[side]}", speeds, ratio, inside,
                f"{low:.2f} to {high:.2f} with the rounding of the torques, the speeds have {speeds:.2f}: {told}",
            )
        )  # fmt: skip
    return rows


def _ratio_limits(upper: float, lower: float) -> tuple[float, float]:
    """Return what a ratio of two differences of printed torques can be, each torque off by half a digit at most."""
    return (upper - 2 * _ROUNDING) / (lower + 2 * _ROUNDING), (upper + 2 * _ROUNDING) / (lower - 2 * _ROUNDING)


def _efficiency() -> list[Published]:
    power = {rpm: [t * rpm * RPM for t in TORQUES[FOS][rpm]] for rpm in SPEEDS}
    eta = {rpm: power[rpm][1] / power[rpm][0] for rpm in SPEEDS}
    heat = {rpm: TORQUES[SOS][rpm][0] * rpm * RPM for rpm in SPEEDS}
    ratio = TORQUES[SOS][120][1] / TORQUES[SOS][120][0]
    return [
        row(
            "efficiency", EFFICIENCY, eta[120], False,
            f"power efficiency by eqs (7), (8) while locked: {100 * eta[120]:.1f} % at 120, {100 * eta[210]:.1f} % at 210 rpm "
            f"({power[120][0]:.1f} W in, {power[120][1]:.1f} W out; {power[210][0]:.1f} and {power[210][1]:.1f} W). The paper's 40 % "
            f"is the torque ratio in SOS ({ratio:.3f}), where the output stands. Reported as efficiency_fos and torque_ratio_sos",
            "%",
        ),
        row(
            "efficiency by eqs (7), (8) in SOS", EFFICIENCY, 0.0, False,
            "the output carrier is held, W_2 = T_C2 * 0: nothing comes out, the torque on the carrier is a reaction", "%",
        ),
        row(
            "input power in SOS", None, f"{heat[120]:.1f} W and {heat[210]:.1f} W", None,
            "at 120 and 210 rpm if the input keeps its nominal speed, which was not measured; all of it becomes heat. "
            "Reported as power_dissipated_sos",
        ),
        row(
            "cause of the low efficiency in FOS", "friction between gears", "drag to ground or a sensor's gain", False,
            "locked gears do not slide, and friction inside cannot make the two shaft torques differ: T_in - T_out is "
            "what the ground takes",
        ),
    ]  # fmt: skip


def _line() -> list[Published]:
    own, both, fast = paper_line(120), paper_line(120, 210), paper_line(210)
    (s_in, s_out), (f_in, f_out) = TORQUES[STARTUP][120], TORQUES[FOS][120]
    slope = (s_out - f_out) / (s_in - f_in)
    k = t_quantile(2 * len(TORQUES) - 2)
    return [
        row(
            "the four states at 120 rpm lie on one line", None,
            f"T_out = {own.slope:.4f} T_in - {-own.intercept:.4f} N m, residuals below {own.largest_residual:.4f} N m", None,
            "two states are locked and turn, one is an event, one stands and slips: a rigid locked box with drag that "
            "depends on speed alone cannot do that. The paper does not notice",
        ),
        row(
            "all eight states on one line", None,
            f"slope {both.slope:.3f} ± {k * both.slope_error:.3f}, intercept {both.intercept:.3f} ± {k * both.intercept_error:.3f} N m, "
            f"R2 {both.r2:.3f}", None,
            f"210 rpm alone: slope {fast.slope:.3f}, residuals up to {fast.largest_residual:.2f} N m",
        ),
        row(
            "slope of T_out over T_in within FOS", 1.0, slope, abs(slope - 1.0) < 0.05,
            f"start-up peak and nominal at 120 rpm: ({s_out} - {f_out})/({s_in} - {f_in}). A rigid box has 1: either the drag "
            f"grows by {1 - slope:.2f} N m per N m, or a torque sensor has the wrong gain. Couple both sensors shaft to shaft "
            "and hang weights on a lever to decide", where="3.3, 4.3",
        ),
    ]  # fmt: skip


def _lock() -> list[Published]:
    line = paper_line(120)
    drag, (t_in, t_out) = -line.intercept / line.slope, TORQUES[FOS][120]
    return [
        row(
            "locked drag T_0, lock torque, slip torque at 120 rpm", None,
            f"{drag:.3f}, {TORQUES[BRAKE][120][0] - drag:.3f}, {TORQUES[SOS][120][0] - drag:.3f} N m", None,
            f"T_0 where the line meets T_out = 0 (from FOS alone, T_in - T_out/a, it is {t_in - t_out / line.slope:.3f}); "
            "M = T_in - T_0 at the brake peak and in SOS. Reported as drag_locked, lock_torque, slip_torque", where="5.4",
        )
    ]  # fmt: skip


def _speed() -> list[Published]:
    return [
        row(
            "input speed in SOS", "nominal", "not measured", None,
            f"{SPEEDS[0]} and {SPEEDS[1]} rpm are {SPEEDS[0] / 60:.1f} and {SPEEDS[1] / 60:.1f} Hz of a 2-pole motor, if it is coupled "
            "directly: an uncompensated drive may slip by tens of percent there. Here it comes from the mesh lines: "
            "speed_in_sos",
        )
    ]  # fmt: skip
