"""The load equation integrated against modulating functions (Shinbrot, Trans. ASME 79, 1957, 451; fact sheet 5.6).

T_out = J_L w' + d0 + d1 w times phi = sin^4, integrated by parts: the angle is never differentiated. Rows
of the equation only; they are solved in `inertia`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.gearbox.aligned_run import AlignedRun, Span, within
from pipeline.rigs.gearbox.torques.ripple import learn

# Window and hop, s.
WINDOW, HOP = 0.8, 0.1
# After the output starts to move again the brake still rubs for a moment, s.
BRAKE_FADES = 0.15
# Integrals of phi = sin^4 over the window.
MEAN = 3 / 8


@dataclass(frozen=True, eq=False)
class Noise:
    """What the load equation leaves over in steady stretches, torque's and encoder's noise alike.

    `covariance` of two windows 0, 1, ... hops apart, (N m s)^2, shape (lags,), with its degrees of freedom.
    """

    covariance: np.ndarray
    dof: float

    @property
    def long_run(self) -> float:
        """Variance of independent windows whose mean would be as uncertain."""
        return float(max(2 * self.covariance.sum() - self.covariance[0], self.covariance[0]))


def overlaps(lags: int) -> np.ndarray:
    """Return the correlation of windows 0, 1, ... hops apart under noise without memory, shape (lags,).

    Examples
    --------
    >>> overlaps(10)[[0, 8, 9]].tolist()
    [1.0, 0.0, 0.0]
    """
    t = np.linspace(0.0, 1.0, 801)
    phi = np.sin(math.pi * t) ** 4
    found = np.array([float(phi @ np.interp(t + k * HOP / WINDOW, t, phi, right=0.0)) for k in range(lags)]) / float(
        phi @ phi
    )
    return np.where(np.arange(lags) * HOP < WINDOW * (1.0 - 1e-9), found, 0.0)


@dataclass(frozen=True, eq=False)
class Windows:
    """The integrated load equation of one run, one row a window.

    Attributes
    ----------
    run
        Name.
    columns
        Of J_L, d0, d1: shape (n, 3).
    torque
        Integral of phi T_out, N m s, shape (n,).
    time
        Centre of each window, s; `place` counts hops, so that equal differences are equal lags.
    calm
        Which windows lie inside a steady stretch, shape (n,).
    offset_error
        Standard error of the zero offset of torque_out, N m: common to all rows.
    drift
        Course of a change of this run's torque that nothing of the load explains, in any unit, shape (n,): its size is
        left free. None where there is none.
    """

    run: str
    columns: np.ndarray
    torque: np.ndarray
    time: np.ndarray
    place: np.ndarray
    calm: np.ndarray
    offset_error: float
    drift: np.ndarray | None = None

    @property
    def nuisance(self) -> np.ndarray:
        """Column of the drift, shape (n, 1), or (n, 0)."""
        return np.zeros((self.time.size, 0)) if self.drift is None else MEAN * WINDOW * self.drift[:, None]

    def drifting(self, course: np.ndarray) -> Windows:
        """Return the same windows with a drift of that course, shape (n,); one that does not change is none."""
        return replace(self, drift=course if course.size and np.ptp(course) > 0 else None)

    def part(self, span: Span) -> Windows:
        """Return the windows whose centre lies inside `span`."""
        return self.where((self.time >= span[0]) & (self.time <= span[1]))

    def where(self, kept: np.ndarray) -> Windows:
        """Return the windows for which `kept`, shape (n,), is true."""
        part = self if self.drift is None else self.drifting(self.drift[kept])
        return replace(
            part,
            columns=self.columns[kept],
            torque=self.torque[kept],
            time=self.time[kept],
            place=self.place[kept],
            calm=self.calm[kept],
        )

    def covariance(self, noise: Noise) -> np.ndarray:
        """Return the covariance of the rows, shape (n, n): stationary noise and the common offset."""
        lag = np.abs(self.place[:, None] - self.place[None, :])
        table = np.append(noise.covariance, 0.0)
        return np.asarray(table[np.minimum(lag, noise.covariance.size)] + self._common)

    def weighted(self, columns: np.ndarray, noise: Noise) -> np.ndarray:
        """Return C^-1 `columns`, shape (n, k), for the covariance C of a common offset and equal, independent noise.

        The noise is as large as the correlated one is for means; its measured correlation itself is too rough
        to be inverted (and is all but singular). A drift is projected out, so that its size does not matter.
        """
        level = noise.long_run or 1.0
        pull = self._common / (level + self.torque.size * self._common)
        found = np.asarray((columns - pull * columns.sum(axis=0)) / level)
        drift = self.nuisance
        if not drift.size:
            return found
        own = (drift - pull * drift.sum(axis=0)) / level
        return np.asarray(found - own @ np.linalg.solve(drift.T @ own, own.T @ columns))

    def residual(self, values: np.ndarray) -> np.ndarray:
        """Return what J_L, d0, d1 (shape (3,)) leave over, and the run's own drift with them, N m s, shape (n,)."""
        rest = self.torque - self.columns @ values
        drift = self.nuisance
        return np.asarray(rest - drift @ np.linalg.lstsq(drift, rest, rcond=None)[0] if drift.size else rest)

    @property
    def _common(self) -> float:
        return (self.offset_error * MEAN * WINDOW) ** 2


def free_spans(run: AlignedRun) -> dict[str, Span]:
    """Return the first stretches where the load turns forward with a free brake: `startup` and `release`, s."""
    spans: dict[str, Span] = {}
    for name, span in free_stretches(run):
        spans.setdefault(name, span)
    return spans


def free_stretches(run: AlignedRun) -> list[tuple[str, Span]]:
    """Return every stretch where the load turns forward with a free brake, in the order of time.

    Each is named after what sets the load in motion (`startup`, `release`), or `steady` where it runs on after
    another load was taken off. A stretch ends where the brake comes on: FOS under load is none.
    """
    spans = []
    for name, first, end in run.free or _free_stages(run):
        begin = first
        if name == "startup":
            # The first edge of the counter may be late by one count: start when a twentieth turn is done.
            started = run.angle - run.angle_at(np.array([first]))[0] > 2 * math.pi / 20
            moving = run.angle_time[started & (run.angle_time >= first)]
            begin = float(moving[0]) if moving.size else end
        elif name == "release":
            begin = first + BRAKE_FADES
        if end - 0.05 - begin > WINDOW:
            spans.append((name, (begin, end - 0.05)))
    return spans


def _free_stages(run: AlignedRun) -> list[tuple[str, float, float]]:
    """Return the free stretches of a run of one brake cycle from its stages alone."""
    found = []
    if run.has("startup", "fos"):
        end = run.events.get("brake_onset", run.stages["fos"][1])
        found.append(("startup", run.stages["startup"][0], min(end, run.stages["fos"][1])))
    if run.has("release"):
        found.append(("release", run.stages["release"][0], run.stages.get("fos_after", run.stages["release"])[1]))
    return found


def modulated(run: AlignedRun, steady: Sequence[Span]) -> Windows | None:
    """Integrate the load equation of a run over all its windows.

    Parameters
    ----------
    run
        With stages `startup` and `fos`, or `release` and `fos_after`.
    steady
        Settled locked stretches: ripple and noise of torque_out are learnt there.

    Returns
    -------
    None where no window fits.
    """
    time, _, torque = run.slow
    angle = run.angle_at(time)
    if steady:
        inside = np.concatenate([np.arange(time.size)[within(time, span)] for span in steady])
        torque = torque - learn(angle[inside], torque[inside]).at(angle)
    rows, torques, centres = [], [], []
    for _, span in free_stretches(run):
        for start in np.arange(span[0], span[1] - WINDOW, HOP):
            if not run.whole(start, start + WINDOW):
                continue
            row = _row(run.angle_time, run.angle, start)
            value = _weighted_torque(time, torque, start)
            if row is not None and value is not None:
                rows.append(row)
                torques.append(value)
                centres.append(start + 0.5 * WINDOW)
    if not rows:
        return None
    centre = np.array(centres)
    half = 0.5 * WINDOW
    calm = np.array([any(a + half <= at <= b - half for a, b in steady) for at in centres])
    return Windows(
        run.run,
        np.array(rows),
        np.array(torques),
        centre,
        np.rint((centre - centre[0]) / HOP).astype(int),
        calm,
        run.offset_out.std_error,
    )


def _row(time: np.ndarray, angle: np.ndarray, start: float) -> np.ndarray | None:
    """Return the integrals of phi'' theta, phi and -phi' theta over the window, None where angles are missing."""
    part = slice(
        max(int(np.searchsorted(time, start)) - 1, 0), int(np.searchsorted(time, start + WINDOW, side="right")) + 1
    )
    t, theta = time[part], angle[part]
    if t.size < 12 or t[0] > start or t[-1] < start + WINDOW or np.diff(t).max() > 0.1 * WINDOW:
        return None
    x = math.pi * (t - start) / WINDOW
    inside = (x > 0) & (x < math.pi)
    s, c = np.sin(x), np.cos(x)
    rate = math.pi / WINDOW
    first = np.where(inside, 4 * rate * s**3 * c, 0.0)
    second = np.where(inside, 4 * rate**2 * s**2 * (3 * c**2 - s**2), 0.0)
    # phi'' is orthogonal to straight lines and phi' to constants: take them off before the sum, exactly.
    centred = t - start - 0.5 * WINDOW
    speed, level = np.polyfit(centred, theta, 1)
    rest = theta - level - speed * centred
    mean = MEAN * WINDOW
    return np.array([np.trapezoid(second * rest, t), mean, speed * mean - np.trapezoid(first * rest, t)])


def _weighted_torque(time: np.ndarray, torque: np.ndarray, start: float) -> float | None:
    """Return the integral of phi T_out over the window, None where torques are missing."""
    part = within(time, (start, start + WINDOW))
    t = time[part]
    if t.size < 20 or np.diff(t).max() > 0.1 * WINDOW:
        return None
    phi = np.sin(math.pi * (t - start) / WINDOW) ** 4
    return float(np.trapezoid(phi * torque[part], t))
