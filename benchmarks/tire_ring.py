"""The ring pressed on a road, the joint fit of seven bench runs, and the features of all bench runs.

The references are what one would write: the active set on a dense compliance matrix, `least_squares` with differences
around it, and the time that the runs took on the bench.

    python -m benchmarks.tire_ring
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.tire.bench.ring_fit import fit_ring
from pipeline.rigs.tire.bench.ring_run import Known, RingRun
from pipeline.rigs.tire.passages.device import device_of
from pipeline.rigs.tire.passages.features import features
from pipeline.rigs.tire.passages.revolutions import joined, revolutions_of
from pipeline.rigs.tire.passages.waveform import averaged
from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.ring import Ring, grid, stiffness
from pipeline.rigs.tire.ring.sensor import Sensor, flex_shape, highest_order
from pipeline.rigs.tire.synthetic.rig import synthesize_bench
from pipeline.rigs.tire.synthetic.truth import bench_truth, ring_of

_KT, _RO, _LS = 1.2e8, 0.3266, 0.05
_MESH = 2048


def measure() -> list[dict[str, Any]]:
    recordings = synthesize_bench({}, 1)
    runs = _ring_runs(recordings)
    return [_contact(), _features(recordings), _fit(runs)]


def _contact() -> dict[str, Any]:
    ring = ring_of(bench_truth({}))
    known = compliance(ring, _MESH)
    near = pressed(known, _KT, _RO, 1900.0).active
    ours = _best(lambda: pressed(known, _KT, _RO, 2000.0, start=near), 20)
    theirs = _best(lambda: plain_contact(2000.0, ring, _MESH), 3)
    found, expected = pressed(known, _KT, _RO, 2000.0).loaded_radius, plain_contact(2000.0, ring, _MESH)[0]
    assert abs(found - expected) < 1e-8, (found, expected)
    return _row(f"contact solve, {_MESH} nodes", "active set on the dense compliance", ours, theirs, "about 1 ms")


def _features(recordings: list[Recording]) -> dict[str, Any]:
    def all_of_them() -> None:
        for recording in recordings:
            waveform = averaged(joined(revolutions_of(device_of(recording))))
            features(waveform, 0.3171, highest_order(_LS, 0.3171))

    all_of_them()
    duration = sum(recording.stream_of("flex_code").duration for recording in recordings)
    return _row("passages, waveforms and features of the seven bench runs", "the runs themselves", _best(all_of_them, 3), duration, "< 3 s")  # fmt: skip


def _fit(runs: list[RingRun]) -> dict[str, Any]:
    known = Known(R=0.3171, R_u=1e-4, Ro=_RO, sensor_length=_LS, belt_width=0.21)
    fit_ring(runs, known)
    ours = _best(lambda: fit_ring(runs, known), 2)
    begin = time.perf_counter()
    theirs = plain_fit(runs)
    took = time.perf_counter() - begin
    mine = fit_ring(runs, known).values
    apart = max(
        abs(one / other - 1.0)
        for one, other in zip((mine.bending_stiffness, mine.foundation_radial), theirs, strict=True)
    )
    what = f"joint ring fit of seven runs; EI and kw differ by {100 * apart:.2g} %"
    return _row(what, "least_squares with differences", ours, took, "< 15 s")


def _row(what: str, against: str, ours: float, theirs: float, goal: str) -> dict[str, Any]:
    return {"what": what, "against": against, "ours": ours, "theirs": theirs, "goal": goal}


def _best(work: Callable[[], object], repeat: int) -> float:
    seconds = []
    for _ in range(repeat):
        begin = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


def _ring_runs(recordings: list[Recording]) -> list[RingRun]:
    found = []
    for recording in recordings:
        waveform = averaged(joined(revolutions_of(device_of(recording))))
        load = recording.values("vertical_load")
        found.append(
            RingRun(
                recording.run,
                waveform.theta,
                waveform.mean,
                waveform.std_error,
                float(load.mean()),
                float(load.std()) / load.size**0.5,
                waveform.speed,
                recording.condition("inflation_pressure"),
                recording.condition("nominal_load"),
                recording.condition("nominal_speed"),
            )
        )
    return found


def plain_contact(Fz: float, ring: Ring, N: int) -> tuple[float, np.ndarray]:
    """Return loaded radius (m) and harmonics of k, by an active set on the full matrix of all nodes near the patch."""
    theta = grid(N)
    n = np.fft.fftfreq(N, 1.0 / N)
    usable = (n != 0) & (np.arange(N) != N // 2)
    order = np.where(usable, n, 1.0)
    inverse = np.where(usable, 1.0 / stiffness(order, ring), 0.0)
    v = inverse / order**2
    v[0] = 1.0 / ring.kv
    ww, wv, vw, vv = (np.fft.ifft(z).real for z in (inverse, -1j / order * inverse, 1j / order * inverse, v))
    j = np.flatnonzero(np.abs(theta) < 0.45)
    apart = (j[:, None] - j[None, :]) % N
    c, s = np.cos(theta[j]), np.sin(theta[j])
    G = c[:, None] * (-ww[apart] * c + wv[apart] * s) - s[:, None] * (-vw[apart] * c + vv[apart] * s)
    step = ring.R * 2.0 * np.pi / N
    active = np.abs(theta[j]) < 0.12
    for _ in range(100):
        a = np.flatnonzero(active)
        A = np.zeros((a.size + 1, a.size + 1))
        A[:-1, :-1] = np.eye(a.size) / _KT - G[np.ix_(a, a)]
        A[:-1, -1], A[-1, :-1] = 1.0, step
        solved = np.linalg.solve(A, np.append(_RO * c[a], Fz))
        p = np.zeros(j.size)
        p[a] = solved[:-1]
        new = np.where(active, p > 0.0, _RO * c + G @ p - solved[-1] > 0.0)
        if (new == active).all():
            break
        active = new
    pressure = np.zeros(N)
    pressure[j] = p
    load = [np.fft.fft(np.fft.ifftshift(x)) / N for x in (-pressure * np.cos(theta), pressure * np.sin(theta))]
    return float(solved[-1]), np.where(usable, (1 - n**2) / ring.R**2 * (load[0] - 1j / order * load[1]) * inverse, 0)


def plain_fit(runs: list[RingRun]) -> tuple[float, float]:
    """Return EI and kw of a joint fit with differences: nine logarithms, an angle and a resistance a run."""
    from scipy.optimize import least_squares

    R = 0.3171
    highest = highest_order(_LS, R)
    start = np.log([10.0, 0.21, 4e5, 1e5, 1e8, 4000.0, 0.05, 1e-3])

    def residual(x: np.ndarray) -> np.ndarray:
        EI, b, kw, kv, kt, c, eta, lag = np.exp(x[:8])
        parts = []
        for i, run in enumerate(runs):
            known = compliance(Ring(R, EI, run.pressure * b, kw, kv, eta), _MESH)
            shape = flex_shape(pressed(known, kt, _RO, run.load).shape, Sensor(c, 0.0, _LS, lag), R, run.rotation)
            model = shape.cut(highest).at(run.theta + x[8 + 2 * i]) + 1e4 * x[9 + 2 * i]
            parts.append((run.resistance - model) / run.std_error)
        return np.concatenate(parts)

    first = np.concatenate([start, *([0.0, 1.0] for _ in runs)])
    low = np.concatenate([start - np.log(10.0), *([-0.2, 0.5] for _ in runs)])
    high = np.concatenate([start + np.log(10.0), *([0.2, 1.5] for _ in runs)])
    found = least_squares(residual, first, bounds=(low, high), diff_step=[1e-5] * first.size, x_scale="jac")
    return float(np.exp(found.x[0])), float(np.exp(found.x[2]))


if __name__ == "__main__":
    for row in measure():
        print(row)
