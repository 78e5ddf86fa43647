"""Variant B: the ring pressed on a flat rigid road by an active set on its compliance matrix (tire.md, 3.2 and 11).

`compliance` holds what depends on the ring alone; with it each load is one `pressed` (about a millisecond).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.ring.ring import Ring, Shape, curvature, grid, stiffness, tangential_displacement

MESH = 4096
_FURTHEST = 0.5 * np.pi
_MOST_PASSES = 60


@dataclass(frozen=True, eq=False)
class Compliance:
    """What a ring does under unit loads on N even angles; harmonics have shape (N/2,), n = 0..N/2 - 1.

    Attributes
    ----------
    theta, cos, sin
        Angles (rad) from straight down and their cosine and sine, shape (N,).
    inverse
        1/K_n of the radial displacement, 0 at n = 0.
    kernels
        Displacements (m) round one node that carries 1 N/m: w from a radial and from a tangential load, v from a radial
        and from a tangential one, shape (4, N); the node stands at N // 2.
    """

    ring: Ring
    theta: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    inverse: np.ndarray
    kernels: np.ndarray


@dataclass(frozen=True, eq=False)
class Contact:
    """A tire standing or rolling on a flat road.

    Attributes
    ----------
    theta, pressure
        Even angles, rad, and the vertical force per length of belt there, N/m, shape (N,) each.
    loaded_radius
        Height of the hub over the road, m.
    shape
        Curvature k, 1/m; no sensor in it.
    front, rear
        Where the contact begins (theta < 0) and ends, rad, between the nodes; NaN without load.
    length
        Contact length Lc along the belt, m.
    """

    theta: np.ndarray
    pressure: np.ndarray
    loaded_radius: float
    shape: Shape
    front: float
    rear: float
    length: float

    @property
    def active(self) -> np.ndarray:
        """Nodes that touch, bool, shape (N,): a start for a load or a ring nearby."""
        return np.asarray(self.pressure > 0.0)


def compliance(ring: Ring, N: int = MESH, speed: float = 0.0) -> Compliance:
    """Return the compliance of `ring` on N nodes (even) at `speed` (rad/s).

    With 1024 nodes the shape errs by 4e-4 of the peak, more than the noise of an averaged waveform; with 2048 by 1.4e-4,
    with 4096 by 2.5e-5.
    """
    n = np.arange(1, N // 2, dtype=float)
    inverse = np.zeros(N // 2, dtype=complex)
    inverse[1:] = 1.0 / stiffness(n, ring, speed)
    modes = np.zeros((4, N // 2 + 1), dtype=complex)
    modes[0, : N // 2] = inverse
    modes[1, 1 : N // 2] = -1j / n * inverse[1:]
    modes[2, 1 : N // 2] = 1j / n * inverse[1:]
    modes[3, 1 : N // 2] = inverse[1:] / n**2
    modes[3, 0] = 1.0 / ring.kv
    theta = grid(N)
    kernels = np.fft.fftshift(np.fft.irfft(modes, N), axes=1)
    return Compliance(ring, theta, np.cos(theta), np.sin(theta), inverse, kernels)


def pressed(
    known: Compliance, kt: float, Ro: float, Fz: float, Fx: float = 0.0, start: np.ndarray | None = None
) -> Contact:
    """Return the contact of the tire with a flat road.

    Parameters
    ----------
    known
        Compliance of the ring.
    kt, Ro
        Tread springs, N/m^2; free outer radius, m.
    Fz, Fx
        Load on the tire and longitudinal force (+ drives), N; friction is spread like the pressure.
    start
        Nodes that touch in a state nearby (`Contact.active`), for speed.

    Raises
    ------
    ValueError
        If the load is negative.
    ArithmeticError
        If the active set does not settle.
    """
    if not Fz >= 0.0:
        raise ValueError(f"a load of {Fz:g} N presses no tire")
    N = known.theta.size
    if Fz == 0.0:
        free = Shape(np.zeros(N // 2, dtype=complex))
        return Contact(known.theta, np.zeros(N), Ro, free, np.nan, np.nan, 0.0)
    mu = Fx / Fz
    lever_w = -(known.cos + mu * known.sin)
    lever_v = known.sin - mu * known.cos
    # Wide at first: the set then shrinks in a few passes, however soft the ring.
    touching = np.abs(known.theta) < 0.1 if start is None or not start.any() else start
    for _ in range(_MOST_PASSES):
        pressure, height = _pressures(known, kt, Ro, Fz, touching, lever_w, lever_v)
        w, v0 = _radial(known, pressure, lever_w, lever_v)
        gap = _penetration(known, w, v0, Ro) - height
        found = np.where(touching, pressure > 0.0, gap > 0.0) & (np.abs(known.theta) < _FURTHEST)
        if np.array_equal(found, touching):
            front, rear = _edges(known.theta, gap, touching)
            return Contact(
                known.theta,
                pressure,
                height,
                curvature(w, known.ring),
                front,
                rear,
                known.ring.R * (rear - front),
            )
        touching = found if found.any() else np.abs(known.theta) < 1.5 * np.pi / N
    raise ArithmeticError(f"the contact of {Fz:g} N does not settle within {_MOST_PASSES} passes")


def _pressures(
    known: Compliance,
    kt: float,
    Ro: float,
    Fz: float,
    touching: np.ndarray,
    lever_w: np.ndarray,
    lever_v: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Return the pressure of the touching nodes, N/m, 0 elsewhere, shape (N,), and the hub's height, m."""
    N = known.theta.size
    at = np.flatnonzero(touching)
    apart = at[:, None] - at[None, :] + N // 2
    ww, wv, vw, vv = known.kernels[:, apart]
    lw, lv, c, s = lever_w[at], lever_v[at], known.cos[at], known.sin[at]
    A = np.empty((at.size + 1, at.size + 1))
    A[:-1, :-1] = s[:, None] * (vw * lw + vv * lv) - c[:, None] * (ww * lw + wv * lv)
    A[np.arange(at.size), np.arange(at.size)] += 1.0 / kt
    A[:-1, -1] = 1.0
    A[-1, :-1] = known.ring.R * 2.0 * np.pi / N
    A[-1, -1] = 0.0
    solution = np.linalg.solve(A, np.append(Ro * c, Fz))
    pressure = np.zeros(N)
    pressure[at] = solution[:-1]
    return pressure, float(solution[-1])


def _radial(
    known: Compliance, pressure: np.ndarray, lever_w: np.ndarray, lever_v: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the harmonics of w, m, shape (N/2,), and the mean tangential load q_v,0, N/m."""
    N = pressure.size
    loads = np.fft.rfft(np.fft.ifftshift(np.stack([pressure * lever_w, pressure * lever_v]), axes=1))[:, : N // 2] / N
    n = np.arange(N // 2)
    n[0] = 1
    w = (loads[0] - 1j / n * loads[1]) * known.inverse
    return w, float(loads[1, 0].real)


def _penetration(known: Compliance, w: np.ndarray, q_v0: float, Ro: float) -> np.ndarray:
    """Return (Ro + w) cos - v sin, m, at all nodes: what the hub's height is taken from, shape (N,)."""
    N = known.theta.size
    both = np.zeros((2, N // 2 + 1), dtype=complex)
    both[0, : N // 2] = w
    both[1, : N // 2] = tangential_displacement(w, q_v0, known.ring)
    radial, tangential = np.fft.fftshift(np.fft.irfft(both, N) * N, axes=1)
    return np.asarray((Ro + radial) * known.cos - tangential * known.sin)


def _edges(theta: np.ndarray, gap: np.ndarray, touching: np.ndarray) -> tuple[float, float]:
    """Return where the penetration crosses zero before the first and behind the last touching node, rad."""
    first, last = np.flatnonzero(touching)[[0, -1]]
    step = theta[1] - theta[0]
    front = theta[first] - step * gap[first] / (gap[first] - gap[first - 1])
    rear = theta[last] + step * gap[last] / (gap[last] - gap[last + 1])
    return float(front), float(rear)
