"""The waveforms of all runs as a function of ring, tread and sensor, with derivatives (contact solved, variant B).

The residual of the joint fit; the search is in `ring_fit`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.rigs.tire.bench.ring_run import Known, RingRun, Scatter, weights
from pipeline.rigs.tire.ring.contact import Compliance, Contact, compliance, pressed
from pipeline.rigs.tire.ring.ring import Ring
from pipeline.rigs.tire.ring.sensor import averaging, lagging

# Order of the shared unknowns, by the names of the findings.
NAMES = (
    "bending_stiffness",
    "belt_width",
    "foundation_radial",
    "foundation_tangential",
    "tread_stiffness",
    "sensor_gain",
    "loss_factor",
    "sensor_lag",
    "sensor_length",
)
# Searched as logarithms; loss factor and lag may be zero, so they are searched as they are, in these sizes.
SIZES = {"loss_factor": 0.05, "sensor_lag": 1e-3}
SCALED = ("bending_stiffness", "belt_width", "foundation_radial", "foundation_tangential", "tread_stiffness")
_CONTACT = (*SCALED, "loss_factor")
_STEP = {name: 1e-3 if name in SCALED else 2e-2 for name in _CONTACT}
# Loads this close share one contact; the rest of the difference is taken as linear.
_SAME_LOAD = 3e-3
_LOAD_STEP = 2e-3
_LENGTH_STEP = 3e-2
# Coordinates that each run has for itself, and those that it has beside where the runs scatter.
_OWN, _SCATTERED = 4, 2
_ALIKE, _LEAST = Scatter(), 1e-6
# Rotation within a turn, unseen between two passages, is even to this share at 10 km/h; a disturbing torque moves a slow
# drum more, as one over the speed squared.
UNEVEN = 1e-4
_USUAL_ROTATION = 8.76
# Half the nominal diameter is not the free radius of this very tire, nor is the height's zero exact.
_HEIGHT_OFFSET = 1e-3


@dataclass(frozen=True)
class Unknowns:
    """Values of the shared unknowns. SI."""

    bending_stiffness: float
    belt_width: float
    foundation_radial: float
    foundation_tangential: float
    tread_stiffness: float
    sensor_gain: float
    loss_factor: float
    sensor_lag: float
    sensor_length: float

    def coordinates(self) -> np.ndarray:
        """Return logarithms, or values in their size, shape (9,)."""
        return np.array([getattr(self, n) / SIZES[n] if n in SIZES else math.log(getattr(self, n)) for n in NAMES])

    def ring(self, R: float, pressure: float) -> Ring:
        """Return the ring under `pressure` (Pa)."""
        return Ring(
            R=R,
            EI=self.bending_stiffness,
            p0b=pressure * self.belt_width,
            kw=self.foundation_radial,
            kv=self.foundation_tangential,
            eta=self.loss_factor,
        )


def unknowns_at(coordinates: np.ndarray) -> Unknowns:
    """Return the values at coordinates of shape (9,)."""
    return Unknowns(
        *(float(x * SIZES[n] if n in SIZES else np.exp(x)) for n, x in zip(NAMES, coordinates, strict=True))
    )


@dataclass(frozen=True, eq=False)
class Loaded:
    """One contact, its curvature's harmonics (M,) and what they and the hub's height change by ln load and ln pressure.

    By pressure zero unless the runs' own is asked for.
    """

    contact: Contact
    k: np.ndarray
    k_by_load: np.ndarray
    height_by_load: float
    k_by_pressure: np.ndarray
    height_by_pressure: float


class RingModel:
    """Weighted residuals of all runs and their derivatives.

    Coordinates: 9 shared ones; then for each run the angle (rad), ln of true over measured load, and two shares of a
    rotation that is not even within the turn (`own`), and with `scatter` ln of its own sensor gain and pressure over what
    all share; then, where hub heights are known, their common offset (m). R0 and a drift within the turn are solved for
    and projected out.

    `scatter` is by how much load, gain and pressure differ from run to run, unseen.
    """

    def __init__(self, runs: list[RingRun], known: Known, scatter: Scatter = _ALIKE) -> None:
        self.runs, self.known, self.scatter = runs, known, scatter
        self.owned = _OWN + (_SCATTERED if scatter.size > 0.0 else 0)
        self.orders = np.arange(runs[0].theta.size // 2, dtype=float)
        self.weights = [weights(run) for run in runs]
        self.nuisance = [_nuisance(run, w) for run, w in zip(runs, self.weights, strict=True)]
        self.groups, self.member = _groups(runs)
        self.heights = [i for i, run in enumerate(runs) if run.hub_height is not None]
        self.size = len(NAMES) + self.owned * len(runs) + bool(self.heights)
        self.priors = self.priors_of(runs, known, scatter)
        self.solves = 0
        self._active: dict[int, np.ndarray] = {}
        self._loaded: tuple[bytes, list[Loaded]] = (b"", [])
        self._derivatives: tuple[bytes, tuple[np.ndarray, np.ndarray]] = (b"", (np.zeros(0), np.zeros(0)))

    def own(self, i: int) -> slice:
        """Return where the coordinates of run i stand: angle, ln load, uneven rotation as a sine and as a cosine, ...

        and, where the runs scatter, ln of gain and pressure.
        """
        return slice(len(NAMES) + i * self.owned, len(NAMES) + (i + 1) * self.owned)

    @staticmethod
    def priors_of(runs: Sequence[RingRun], known: Known, scatter: Scatter) -> list[tuple[int, float, float]]:
        """Return coordinate, value and standard deviation of what is known beforehand of these runs."""
        owned = _OWN + (_SCATTERED if scatter.size > 0.0 else 0)
        found = [(NAMES.index("sensor_length"), math.log(known.sensor_length), known.sensor_length_u)]
        if known.belt_width is not None and known.belt_width_u is not None:
            found.append((NAMES.index("belt_width"), math.log(known.belt_width), known.belt_width_u))
        for i, run in enumerate(runs):
            at = len(NAMES) + i * owned
            uneven = scatter.uneven * UNEVEN * (_USUAL_ROTATION / run.rotation) ** 2
            found.append((at + 1, 0.0, math.hypot(max(run.load_se / run.load, _LEAST), scatter.load)))
            found += [(at + 2, 0.0, uneven), (at + 3, 0.0, uneven)]
            own = (max(scatter.gain, _LEAST), max(scatter.pressure, _LEAST))
            found += [(at + _OWN + j, 0.0, sd) for j, sd in enumerate(own[: owned - _OWN])]
        if any(run.hub_height is not None for run in runs):
            found.append((len(NAMES) + owned * len(runs), 0.0, _HEIGHT_OFFSET))
        return found

    def loaded(self, x: np.ndarray) -> list[Loaded]:
        """Return the contact of each group of loads at the coordinates x."""
        key = x[: len(NAMES)].tobytes()
        if self._loaded[0] != key:
            values, M = unknowns_at(x[: len(NAMES)]), self.orders.size
            found = []
            step = math.log1p(_LOAD_STEP)
            heres = self._solved(values)
            harder = (
                self._solved(replace(values, belt_width=values.belt_width * (1.0 + _LOAD_STEP)))
                if self.scatter.size > 0.0
                else heres
            )
            for here, more, hard in zip(heres, self._solved(values, 1.0 + _LOAD_STEP), harder, strict=True):
                k = here.shape.harmonics[:M]
                found.append(
                    Loaded(
                        here,
                        k,
                        (more.shape.harmonics[:M] - k) / step,
                        (more.loaded_radius - here.loaded_radius) / step,
                        (hard.shape.harmonics[:M] - k) / step,
                        (hard.loaded_radius - here.loaded_radius) / step,
                    )
                )
            self._loaded = (key, found)
        return self._loaded[1]

    def _solved(self, values: Unknowns, factor: float = 1.0) -> list[Contact]:
        known: dict[float, Compliance] = {}
        found = []
        for g, (pressure, load) in enumerate(self.groups):
            if pressure not in known:
                known[pressure] = compliance(values.ring(self.known.R, pressure))
            tread, Ro = values.tread_stiffness, self.known.Ro
            found.append(pressed(known[pressure], tread, Ro, factor * load, start=self._active.get(g)))
            self._active[g] = found[-1].active
            self.solves += 1
        return found

    def _slopes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return derivatives of shape, (groups, 6, M), and hub height, (groups, 6), by what the contact depends on."""
        key = x[: len(NAMES)].tobytes()
        if self._derivatives[0] != key:
            M = self.orders.size
            shapes = np.zeros((len(self.groups), len(_CONTACT), M), dtype=complex)
            heights = np.zeros((len(self.groups), len(_CONTACT)))
            for j, name in enumerate(_CONTACT):
                step, at = _STEP[name], NAMES.index(name)
                ends = []
                for sign in (1.0, -1.0):
                    moved = x[: len(NAMES)].copy()
                    moved[at] += sign * step
                    ends.append(self._solved(unknowns_at(moved)))
                for g, (up, down) in enumerate(zip(*ends, strict=True)):
                    shapes[g, j] = (up.shape.harmonics[:M] - down.shape.harmonics[:M]) / (2.0 * step)
                    heights[g, j] = (up.loaded_radius - down.loaded_radius) / (2.0 * step)
            self._derivatives = (key, (shapes, heights))
        return self._derivatives[1]

    def length_slopes(self, x: np.ndarray) -> np.ndarray:
        """Return derivatives of each group's contact length (m) by all coordinates, shape (groups, coordinates).

        By wide steps: the ends of the contact creep between the nodes of the mesh.
        """
        found = np.zeros((len(self.groups), self.size))
        for name in _CONTACT:
            step, at = _LENGTH_STEP * (1.0 if name in SCALED else 5.0), NAMES.index(name)
            ends = []
            for sign in (1.0, -1.0):
                moved = x[: len(NAMES)].copy()
                moved[at] += sign * step
                ends.append([contact.length for contact in self._solved(unknowns_at(moved))])
            found[:, at] = (np.array(ends[0]) - np.array(ends[1])) / (2.0 * step)
        return found

    def waveform(self, x: np.ndarray, i: int) -> np.ndarray:
        """Return R2 - R0 of run i at its angles, ohm, shape (n,)."""
        return np.asarray(self._run(x, i, False)[0])

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Return the weighted residual of all data, then of heights and priors."""
        return np.concatenate([*self.run_residuals(x), self._height_residual(x), self._prior_residual(x)])

    def run_residuals(self, x: np.ndarray) -> list[np.ndarray]:
        """Return (model - measured)/std_error per run, R0 and drift solved for; 0 where there is no value."""
        found = []
        for i, (run, w) in enumerate(zip(self.runs, self.weights, strict=True)):
            wave = self.waveform(x, i)
            found.append(_without(self.nuisance[i], w * (wave - np.where(w > 0.0, run.resistance, 0.0))))
        return found

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives of `residual`, shape (rows, coordinates)."""
        shared = len(NAMES)
        blocks = []
        for i, w in enumerate(self.weights):
            columns = _without(self.nuisance[i], (self._run(x, i, True)[1:] * w).T)
            block = np.zeros((w.size, self.size))
            block[:, :shared] = columns[:, :shared]
            block[:, self.own(i)] = columns[:, shared:]
            blocks.append(block)
        rows = np.zeros((len(self.priors), self.size))
        for row, (at, _, sd) in zip(rows, self.priors, strict=True):
            row[at] = 1.0 / sd
        return np.concatenate([*blocks, self._height_jacobian(x), rows])

    def _prior_residual(self, x: np.ndarray) -> np.ndarray:
        return np.array([(x[at] - value) / sd for at, value, sd in self.priors])

    def _height_residual(self, x: np.ndarray) -> np.ndarray:
        return np.array([self._height(x, i) for i in self.heights])

    def _height(self, x: np.ndarray, i: int) -> float:
        run, here = self.runs[i], self.loaded(x)[self.member[i]]
        model = here.contact.loaded_radius + here.height_by_load * self._off(x, i) + float(x[-1])
        model += here.height_by_pressure * self._of_run(x, i)[1]
        return (model - (run.hub_height or 0.0)) / _height_se(run)

    def _height_jacobian(self, x: np.ndarray) -> np.ndarray:
        rows = np.zeros((len(self.heights), self.size))
        for row, i in zip(rows, self.heights, strict=True):
            g = self.member[i]
            for name, slope in zip(_CONTACT, self._slopes(x)[1][g], strict=True):
                row[NAMES.index(name)] = slope
            row[self.own(i).start + 1] = -self._slopes(x)[1][g, : len(SCALED)].sum()
            if self.scatter.size > 0.0:
                row[self.own(i).start + _OWN + 1] = row[NAMES.index("belt_width")]
            row[-1] = 1.0
            row /= _height_se(self.runs[i])
        return rows

    def _off(self, x: np.ndarray, i: int) -> float:
        """Return ln of the true load of run i over that of its group."""
        return math.log(self.runs[i].load / self.groups[self.member[i]][1]) + float(x[self.own(i)][1])

    def _of_run(self, x: np.ndarray, i: int) -> tuple[float, float]:
        """Return ln of gain and pressure of run i over what all share."""
        own = x[self.own(i)]
        return (float(own[_OWN]), float(own[_OWN + 1])) if self.scatter.size > 0.0 else (0.0, 0.0)

    def _run(self, x: np.ndarray, i: int, derivatives: bool) -> np.ndarray:
        """Return the waveform of run i, then (if asked) its derivatives by the shared ones and its own."""
        run, n, shared = self.runs[i], self.orders, len(NAMES)
        values, here = unknowns_at(x[:shared]), self.loaded(x)[self.member[i]]
        gain, pressure = self._of_run(x, i)
        k = here.k + self._off(x, i) * here.k_by_load + pressure * here.k_by_pressure
        angle, _, sine, cosine = x[self.own(i)][:_OWN]
        turn = run.theta[0] + np.pi - angle  # the grid of the transform begins at -pi
        lag = lagging(n, run.rotation, values.sensor_lag)
        mean = averaging(n, values.sensor_length, self.known.R)
        rest = values.sensor_gain * math.exp(gain) * lag * np.exp(1j * n * turn)
        h = k * rest * mean
        wave, ahead = _on_grid(np.stack([h, 1j * n * h]), run.theta.size)
        uneven = np.stack([np.sin(run.theta), 1.0 - np.cos(run.theta)]) * ahead
        wave = wave + sine * uneven[0] + cosine * uneven[1]
        if not derivatives:
            return np.asarray(wave[None, :])
        rows = np.zeros((shared + 3, n.size), dtype=complex)
        for name, slope in zip(_CONTACT, self._slopes(x)[0][self.member[i]], strict=True):
            rows[1 + NAMES.index(name)] = slope * rest * mean
        rows[1 + NAMES.index("sensor_gain")] = h
        rows[1 + NAMES.index("sensor_lag")] = -1j * n * run.rotation * lag * h * SIZES["sensor_lag"]
        y = n * values.sensor_length / (2.0 * self.known.R)
        rows[1 + NAMES.index("sensor_length")] = k * rest * (np.cos(y) - mean)
        rows[shared + 1] = -1j * n * h
        # All loads and stiffnesses times one factor leave the shape as it is.
        rows[shared + 2] = -rows[[1 + NAMES.index(name) for name in SCALED]].sum(axis=0)
        waves = _on_grid(rows[1:], run.theta.size)
        beside = (
            waves[[NAMES.index("sensor_gain"), NAMES.index("belt_width")]] if self.scatter.size > 0.0 else waves[:0]
        )
        return np.concatenate([wave[None, :], waves, uneven, beside])

    def changed(self, **known: Any) -> RingModel:
        """Return the same model with other values of what is known (`Known`)."""
        return RingModel(self.runs, replace(self.known, **known), self.scatter)


def _on_grid(harmonics: np.ndarray, bins: int) -> np.ndarray:
    spectrum = np.zeros((harmonics.shape[0], bins // 2 + 1), dtype=complex)
    spectrum[:, : harmonics.shape[1]] = harmonics
    return np.asarray(np.fft.fftshift(np.fft.irfft(spectrum, bins, axis=1) * bins, axes=1))


def _nuisance(run: RingRun, w: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of R0 and a drift within the turn, weighted, shape (n, 2).

    What a drift of R0 over the run leaves in the mean of its turns is a straight line; unmodelled, it reads as loss.
    """
    return np.linalg.qr(np.stack([w, w * run.theta], axis=1))[0]


def _without(basis: np.ndarray, rows: np.ndarray) -> np.ndarray:
    return np.asarray(rows - basis @ (basis.T @ rows))


def _height_se(run: RingRun) -> float:
    return max(run.hub_height_se or 0.0, 1e-6)


def _groups(runs: list[RingRun]) -> tuple[list[tuple[float, float]], list[int]]:
    """Return pressure and mean load of each group of runs whose contact is one, and the group of each run."""
    order = sorted(range(len(runs)), key=lambda i: (runs[i].pressure, runs[i].load))
    sets: list[list[int]] = []
    for i in order:
        first = runs[sets[-1][0]] if sets else None
        if first and first.pressure == runs[i].pressure and runs[i].load <= first.load * (1.0 + _SAME_LOAD):
            sets[-1].append(i)
        else:
            sets.append([i])
    member = [0] * len(runs)
    for g, group in enumerate(sets):
        for i in group:
            member[i] = g
    return [(runs[s[0]].pressure, float(np.mean([runs[i].load for i in s]))) for s in sets], member
