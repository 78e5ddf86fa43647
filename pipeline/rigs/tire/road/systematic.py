"""What the bench leaves uncertain, carried through the fit of a revolution: type B errors of load and force.

They are common to all revolutions of a drive: averaging does not make them smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.ring import Ring, Shape, grid
from pipeline.rigs.tire.ring.sensor import averaging, lagging, voltage_slope
from pipeline.rigs.tire.road.library import UNKNOWNS, CalibratedTire, WaveformLibrary

_STEP = 0.02
_LOADS, _SPEEDS = 6, 3
_ANGLES = 256
# Fx over Fz of the second state at each load.
_PUSHED = 0.15
_LEAST_LOAD = 200.0


@dataclass(frozen=True, eq=False)
class Systematic:
    """How Fz and Fx follow what the library assumes.

    Attributes
    ----------
    names
        The p assumed numbers, `library.UNKNOWNS`.
    covariance
        Of their logarithms, shape (p, p).
    loads, speeds
        Nodes, N (a,) and rad/s (b,).
    slopes
        d(Fz, Fx)/d ln(number), N, shape (a, b, 2, 2, p): third axis Fx = 0 and Fx = 0.15 Fz, fourth Fz and Fx.
    """

    names: tuple[str, ...]
    covariance: np.ndarray
    loads: np.ndarray
    speeds: np.ndarray
    slopes: np.ndarray

    def load_sd(self, load: np.ndarray, force: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the type B standard uncertainty of Fz, N, shape (m,); NaN where the load is."""
        return self._sd(load, force, speed, 0)

    def force_sd(self, load: np.ndarray, force: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the type B standard uncertainty of Fx, N, shape (m,)."""
        return self._sd(load, force, speed, 1)

    def gain_to_load(self, load: float) -> float:
        """Return by how much the load reads higher, N, where the sensor answers 1 % more than on the bench.

        One flex sensor cannot tell the two apart: a drift of its gain is a drift of the load.
        """
        slopes = self._slopes(np.array([load]), np.zeros(1), self.speeds[:1])
        return float(-0.01 * slopes[0, 0, self.names.index("c")])

    def shares(self, load: float, speed: float) -> list[tuple[str, float, float]]:
        """Return what each number alone brings to Fz and Fx, N, at a state: name, Fz, Fx; largest first."""
        slopes = self._slopes(np.array([load]), np.zeros(1), np.array([speed]))[0]
        sd = np.sqrt(np.diag(self.covariance))
        rows = [
            (name, float(abs(slopes[0, i]) * sd[i]), float(abs(slopes[1, i]) * sd[i]))
            for i, name in enumerate(self.names)
        ]
        return sorted(rows, key=lambda row: -row[1])

    def _sd(self, load: np.ndarray, force: np.ndarray, speed: np.ndarray, which: int) -> np.ndarray:
        slopes = self._slopes(load, force, speed)[:, which]
        return np.asarray(np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", slopes, self.covariance, slopes), 0.0)))

    def _slopes(self, load: np.ndarray, force: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the slopes at each revolution, interpolated, shape (m, 2, p)."""
        i, x = _place(np.log(self.loads), np.log(np.maximum(load, 1.0)))
        j, y = _place(self.speeds, speed)
        x, y = x[:, None, None, None], y[:, None, None, None]
        near = (1.0 - x) * (1.0 - y) * self.slopes[i, j] + x * (1.0 - y) * self.slopes[i + 1, j]
        near = near + (1.0 - x) * y * self.slopes[i, j + 1] + x * y * self.slopes[i + 1, j + 1]
        with np.errstate(invalid="ignore", divide="ignore"):
            push = np.clip(force / (_PUSHED * load), -3.0, 3.0)[:, None, None]
        found = near[:, 0] + push * (near[:, 1] - near[:, 0])
        return np.where(np.isfinite(load)[:, None, None], found, np.nan)


def systematic(known: WaveformLibrary, speeds: np.ndarray, R0: float | None = None) -> Systematic:
    """Return how errors of the bench's numbers act on a drive at these rotations (rad/s, any shape).

    `R0` is the sensor's resistance in the drive, ohm; by default that of the library.

    Each number is moved by 2 % either way, the contact is solved anew at six loads, and the change of the waveform is
    put through the least squares of a revolution. Takes about half a second.
    """
    tire = known.tire
    total = np.zeros((len(UNKNOWNS), len(UNKNOWNS)))
    if tire.covariance is not None:
        rows = [UNKNOWNS.index(name) for name in tire.names]
        total[np.ix_(rows, rows)] = tire.covariance
    loads = np.geomspace(max(_LEAST_LOAD, 0.4 * tire.least_load), known.top, _LOADS)
    finite = speeds[np.isfinite(speeds)]
    slow, fast = (float(finite.min()), float(finite.max())) if finite.size else (1.0, 1.0)
    nodes = np.linspace(slow, fast + 1e-6, _SPEEDS)
    moved = {
        name: [
            waveforms(tire.scaled(name, float(np.exp(sign * _STEP))), loads, nodes, known.orders.size)
            for sign in (1, -1)
        ]
        for name in UNKNOWNS
    }
    slopes = np.zeros((_LOADS, _SPEEDS, 2, 2, len(UNKNOWNS)))
    for j, speed in enumerate(nodes):
        for push in (0, 1):
            force = push * _PUSHED * loads
            fit = _fits(known, loads, force, np.full(_LOADS, speed), known.tire.sensor.R0 if R0 is None else R0)
            for p, name in enumerate(UNKNOWNS):
                up, down = moved[name]
                change = (up[:, j, push] - down[:, j, push]) / (2.0 * _STEP)
                slopes[:, j, push, :, p] = -np.matmul(fit, change[:, :, None])[:, :2, 0]
    return Systematic(UNKNOWNS, total, loads, nodes, slopes)


def _place(nodes: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the node before each place and how far it is to the next, 0..1; held at the ends."""
    held = np.clip(np.nan_to_num(at, nan=nodes[0]), nodes[0], nodes[-1])
    i = np.clip(np.searchsorted(nodes, held, side="right") - 1, 0, nodes.size - 2)
    return i, (held - nodes[i]) / (nodes[i + 1] - nodes[i])


def waveforms(tire: CalibratedTire, loads: np.ndarray, speeds: np.ndarray, count: int) -> np.ndarray:
    """Return R2 - R0 at each load, speed and Fx (0, 0.15 Fz), ohm, shape (a, b, 2, _ANGLES)."""
    n = np.arange(count)
    seen = tire.sensor.c * averaging(n, tire.sensor.length, tire.ring.R)
    bent = _curvatures(tire.ring, tire.kt, tire.Ro, tuple(map(float, loads)))
    found = np.empty((loads.size, speeds.size, 2, _ANGLES))
    for i, push, j in np.ndindex(loads.size, 2, speeds.size):
        k = bent[i, push, :count] * seen * lagging(n, float(speeds[j]), tire.sensor.lag)
        found[i, j, push] = Shape(k).on_grid(_ANGLES)[1]
    return found


@lru_cache(maxsize=64)
def _curvatures(ring: Ring, kt: float, Ro: float, loads: tuple[float, ...]) -> np.ndarray:
    """Return the harmonics of the curvature at each load (N) and Fx (0, 0.15 Fz), shape (a, 2, n): sensors share them."""
    sprung, start = compliance(ring), None
    found = []
    for Fz in loads:
        for push in (0, 1):
            contact = pressed(sprung, kt, Ro, Fz, push * _PUSHED * Fz, start)
            start = contact.active
            found.append(contact.shape.harmonics)
    return np.array(found).reshape(len(loads), 2, -1)


def _fits(known: WaveformLibrary, load: np.ndarray, force: np.ndarray, speed: np.ndarray, R0: float) -> np.ndarray:
    """Return what the least squares of a revolution make of a change of R2, shape (m, 4, _ANGLES)."""
    sensor, n, theta = known.tire.sensor, known.orders, grid(_ANGLES)
    wave = np.exp(1j * np.outer(n, theta))
    H, slope, pushed = known.harmonics(load, force, speed)

    def values(harmonics: np.ndarray) -> np.ndarray:
        return np.asarray(2.0 * (harmonics[:, 1:] @ wave[1:]).real)

    g = voltage_slope(R0 + values(H), sensor.VIN, sensor.R1)
    J = np.stack([g * values(slope), g * values(pushed), g * values(1j * n * H), g], axis=1)
    square = np.matmul(J, J.swapaxes(1, 2))
    return np.asarray(np.linalg.solve(square, J) * g[:, None, :])
