"""What the paper says of itself, computed from its own numbers and equations: nothing here was measured.

The coefficients that the examples need are assumed (tpjb.md, section 6); the paper publishes none.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.findings import Published
from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.closed_forms import polar_orbit
from pipeline.rigs.tpjb.truth import bearing

_RPM, _DIAMETERS, _PERIPHERAL = 24000.0, (0.150, 0.280, 0.300), 150.0
_GEAR_RATIO, _DYNAMIC_LIMIT = 6.0, 40e3
_T3_RPM, _SAMPLES_A_TURN = 1000.0, 100.0


def paper_alone() -> list[Published]:
    """Return the checks of the paper's own numbers and equations."""
    return [*_numbers(), *_equations(), *_models()]


def peripheral_speed(rpm: float, diameter: float) -> float:
    """Return the peripheral speed, m/s, of a journal (m) at `rpm`.

    Examples
    --------
    >>> round(peripheral_speed(24000, 0.150), 1)
    188.5
    """
    return math.pi * diameter * rpm / 60.0


def _row(name: str, published: float | str | None, found: float | str | None, where: str, agrees: bool | None,
         remark: str, unit: str = "1") -> Published:  # fmt: skip
    return Published(
        name=name,
        published=published,
        found=found,
        unit=unit,
        where=f"section {where}" if where[:1].isdigit() else where,
        agrees=agrees,
        remark=remark,
        basis="paper",
    )


def _numbers() -> list[Published]:
    shaft = _T3_RPM / 60.0
    allowed = ", ".join(f"{_PERIPHERAL * 60 / (math.pi * d):.0f}" for d in _DIAMETERS)
    largest = peripheral_speed(_RPM, _DIAMETERS[0])
    ratio = 0.6 * 2.0  # L3 = 0.6 L2, L2 = 2 L1
    return [
        _row(
            "shaft frequency", 16.67, shaft, "4", abs(shaft - 16.67) < 0.005,
            f"1000 rpm over 60; a 280 mm journal then runs at {peripheral_speed(_T3_RPM, 0.280):.2f} m/s", "Hz",
        ),
        _row(
            "rotation of the load", 0.01, 1.0 / _SAMPLES_A_TURN, "2", math.isclose(1.0 / _SAMPLES_A_TURN, 0.01),
            "one turn in 100 s at one sample a second: 100 samples a turn", "Hz",
        ),
        _row(
            "peripheral speed at the largest speed and the smallest journal", _PERIPHERAL, largest, "Table 1",
            largest <= _PERIPHERAL,
            f"24000 rpm, 150 mm and 150 m/s are not possible together: 150 m/s allow {allowed} rpm at 150, 280, 300 mm. "
            f"Check both limits; at 24000 rpm the motor turns at {_RPM / _GEAR_RATIO:.0f} rpm (ratio 6)", "m/s",
        ),
        _row(
            "turns recorded", "about 5", "4", "3.1; Fig. 9b", False,
            "two places of the paper differ; count them in the log",
        ),
        _row(
            "static load L3 over L1", "a little above 1", ratio, "3.1, 4", 1.0 < ratio < 1.3,
            "L2 about 2 L1 and L3 about 0.6 L2",
        ),
        _row(
            "largest L1 that 40 kN an actuator allow at 36 %", None, _DYNAMIC_LIMIT / 0.36, "2, Table 1", None,
            "a vector that turns has the amplitude of one actuator; in phase both give sqrt(2) of it", "N",
        ),
    ]  # fmt: skip


def _equations() -> list[Published]:
    residual = polar_residual()
    return [
        _row(
            "equations put into polar form", "(1), (2)", "(3), (4)", "3.2", False,
            "(1) and (2) are the impedance and hold no quadratic term; squared and added, (3) and (4) give (10)",
        ),
        _row(
            "squares and signs of eq. (10)", "eq. (10)", f"off by {residual:.0e} of F^2", "3.2", residual < 1e-10,
            "force of eqs (3), (4) on the orbit of eq. (10), four-pad coefficients of the synthetic rig, 36 % load",
        ),
    ]  # fmt: skip


def polar_residual() -> float:
    """Return by how much |f| of eqs (3), (4) departs from F on the orbit that eq. (10) gives, as a share of F^2."""
    made = bearing("4pad-L1")
    p = np.array([*made.stiffness, made.quadratic[0], 0.0, 0.0, made.quadratic[3], 0.0, 0.0])
    F = 0.36 * made.static_load
    direction = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    radius, _ = polar_orbit(p, direction, F)
    f = law.force(p, radius * np.stack([np.cos(direction), np.sin(direction)]))
    return float(np.abs((f**2).sum(axis=0) / F**2 - 1.0).max())


def _models() -> list[Published]:
    k, q, F, W = 0.6e9, 0.03e9, 14.4e3, 40e3
    load = _turning(F)
    circle = np.hypot(*_linear(k, 0.0, 0.0, load))
    ellipse = np.hypot(*_linear(k, q, q, load))
    skew = np.hypot(*_linear(k, q, -q, load))
    secant = load / (k * (1.0 + load[1] / W))
    centre = 0.5 * (secant[1].max() + secant[1].min())
    halves = 0.5 * np.ptp(secant, axis=1)
    p = np.array([k, 0, 0, k, 2e12, 0, 0, 2e12, 0, 0])
    plain, dependent = curvature(law.equilibrium(p, load)), curvature(_third_secant(k, 2e12, load, W))
    eta = 0.72
    return [
        _row(
            "orbit of model M1 with kxx = kyy", "circle", f"half axes {_um(circle.max())}, {_um(circle.min())} um",
            "3.2, Fig. 6a", bool(np.ptp(circle) < 1e-9 * circle.max()), "eq. (5); assumed 0.6e9 N/m and 14.4 kN",
        ),
        _row(
            "orbit of model M2", "tilted ellipse", f"half axes {_um(ellipse.max())}, {_um(ellipse.min())} um",
            "3.2, Fig. 6b", bool(np.ptp(ellipse) > 0.01 * ellipse.max() and np.ptp(skew) < 1e-9 * skew.max()),
            "eq. (6): F/(k - q) and F/(k + q) if kxy = kyx = q, long axis at -45 deg for q > 0; with kxy = -kyx it stays "
            "a circle; assumed q = 0.03e9 N/m",
        ),
        _row(
            "stiffness by load: vertical shift, ellipse, stronger lobes", "Fig. 6",
            f"centre {_um(centre)} um, half axes {_um(halves[0])}, {_um(halves[1])} um, curvature {plain[0]:.2f} to {plain[1]:.2f} "
            f"becomes {dependent[0]:.2f} to {dependent[1]:.2f}",
            "3.2, Fig. 6", bool(centre < 0 and halves[1] > halves[0] and dependent[1] > plain[1]),
            "k(W0 + fy) as the paper uses it, k in proportion to W; M1 without it: centre 0, half axes 24.00 um; M3 with "
            "2e12 N/m^2. Curvature is times the mean radius about the equilibrium. An exact ellipse, though 2X/1X is 0.19: elliptic is not linear",
        ),
        _row(
            "loss of stiffness from 5 to 30 % load", "up to 60 %", f"{100 * 3 * eta**2 / 32:.1f} %", "1, ref. 18", False,
            "softening of the 1X by a quadratic law, 3 eta^2/32 at eta = 0.72: no quadratic law explains 60 %",
        ),
    ]  # fmt: skip


def _um(value: float) -> str:
    return f"{1e6 * value:.2f}"


def _turning(F: float) -> np.ndarray:
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    return np.asarray(F * np.stack([np.cos(angle), np.sin(angle)]))


def _linear(k: float, kxy: float, kyx: float, load: np.ndarray) -> np.ndarray:
    return law.equilibrium(np.array([k, kxy, kyx, k, *[0.0] * 6]), load)


def _third_secant(k: float, k2: float, load: np.ndarray, W: float) -> np.ndarray:
    """Model M3 with k(W0 + fy) and constant quadratic terms, shape (2, n), as the paper combines them."""
    stiffness = k * (1.0 + load[1] / W)
    return np.asarray(2.0 * load / (stiffness + np.sqrt(stiffness**2 + 4.0 * k2 * load)))


def curvature(orbit: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest curvature of a closed curve, shape (2, n), times its mean radius.

    The radius counts from the origin, which is the equilibrium, and not from the middle of the curve; a
    circle about the origin has 1.
    """
    z = orbit[0] + 1j * orbit[1]
    order = np.fft.fftfreq(z.size, 1.0 / z.size)
    spectrum = np.fft.fft(z)
    first, second = (np.fft.ifft(spectrum * (1j * order) ** n) for n in (1, 2))
    value = (first.conj() * second).imag / np.abs(first) ** 3 * np.abs(z).mean()
    return float(value.min()), float(value.max())
