"""The tables of one run that need its samples or spectra: what is drawn over time and frequency, and the work of each stage."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.rigs.gearbox.aligned_run import within
from pipeline.rigs.gearbox.model.kinematics import mesh_orders
from pipeline.rigs.gearbox.record import TORQUES
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.vibration.sos_speed import teeth_in
from pipeline.rigs.gearbox.vibration.spectral_peaks import spectral_peaks
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers

if TYPE_CHECKING:
    import pandas as pd

DRAWN = {
    "overview": ("run", "time", "torque_in", "torque_out", "speed", "vibration", "channel"),
    "orders": ("run", "stage", "order", "amplitude", "floor", "order_1", "order_2"),
    "ridge": ("run", "time", "slip", "order_1", "order_2"),
    "spectral_peaks": ("run", "time", "frequency", "contrast"),
}
"""Tables of the runs that are drawn, with their columns."""

# What is drawn over time is averaged to about that, Hz; of long runs so many samples are kept.
_RATE, _MOST = 100.0, 20_000
_LOCKED = ("startup", "fos", "fos_after", "rundown")


def drawn_of(run: RunNumbers, vibration: VibrationNumbers) -> dict[str, pd.DataFrame]:
    """Return the tables of `DRAWN` of one run with its samples; those without rows are left out."""
    import pandas as pd

    parts = {
        "overview": [_overview(run, vibration)],
        "orders": _orders(run, vibration),
        "ridge": _ridge(run, vibration),
        "spectral_peaks": _spectral_peaks(run),
    }
    return {
        name: pd.concat([pd.DataFrame(part, columns=list(DRAWN[name])) for part in found], ignore_index=True)
        for name, found in parts.items()
        if found
    }


def _overview(run: RunNumbers, vibration: VibrationNumbers) -> dict[str, Any]:
    rate = min(_RATE, _MOST / max(float(np.ptp(run.run.time)), 1e-9))
    time, t_in, t_out = run.run.means(rate)
    speed = np.interp(time, run.counts.time, run.counts.speed(), left=np.nan, right=np.nan)
    log, felt = run.record.vibration, np.full(time.size, np.nan)
    if log is not None and vibration.channel:
        half, square = 0.5 / rate, (log[vibration.channel] - log[vibration.channel].mean()) ** 2
        total = np.concatenate([[0.0], np.cumsum(square)])
        first, last = np.searchsorted(log.time, time - half), np.searchsorted(log.time, time + half)
        several = last - first
        felt = np.where(several > 0, np.sqrt((total[last] - total[first]) / np.maximum(several, 1)), np.nan)
    return {
        "run": run.name, "time": time, "torque_in": t_in, "torque_out": t_out, "speed": speed, "vibration": felt,
        "channel": vibration.channel,
    }  # fmt: skip


def _lines(run: RunNumbers) -> dict[str, float]:
    first, second = (float(order) for order in mesh_orders(teeth_in(run.record)))
    return {"order_1": first, "order_2": second}


def _orders(run: RunNumbers, vibration: VibrationNumbers) -> list[dict[str, Any]]:
    return [
        {"run": run.name, "stage": stage, "order": spectrum.order, "amplitude": spectrum.amplitude,
         "floor": spectrum.floor, **_lines(run)}
        for stage, spectrum in vibration.spectra.items()
    ]  # fmt: skip


def _ridge(run: RunNumbers, vibration: VibrationNumbers) -> list[dict[str, Any]]:
    ridge = vibration.ridge
    if ridge is None or not ridge.time.size:
        return []
    return [{"run": run.name, "time": ridge.time, "slip": ridge.slip, **_lines(run)}]


def _spectral_peaks(run: RunNumbers) -> list[dict[str, Any]]:
    log = run.record.vibration
    if log is None:
        return []
    time, frequency, contrast = spectral_peaks(log.time, next(iter(log.values.values())))
    return [{"run": run.name, "time": time, "frequency": frequency, "contrast": contrast}] if time.size else []


def work_of(run: RunNumbers) -> list[dict[str, Any]]:
    """Return the work of each stage whose input speed is known (J), a row each.

    `swing` is the change of the output speed's square, (rad/s)^2: half of it times the load's inertia went into motion.
    """
    if any(math.isnan(run.zero(name)) for name in TORQUES):
        return []
    time, t_in, t_out = run.run.slow
    speed = np.interp(time, run.counts.time, run.counts.speed())
    rows = []
    for stage, span in run.run.stages.items():
        part = within(time, span)
        t = time[part]
        if t.size < 10:
            continue
        w_out = speed[part]
        if stage == "sos" and run.speed_in is not None:
            w_in, w_out = np.full(t.size, run.speed_in.value), np.zeros(t.size)
        elif stage in _LOCKED:
            w_in = w_out
        else:
            continue
        rows.append(
            {"run": run.name, "stage": stage, "duration": float(t[-1] - t[0]),
             "work_in": float(np.trapezoid(t_in[part] * w_in, t)), "work_out": float(np.trapezoid(t_out[part] * w_out, t)),
             "swing": float(w_out[-1] ** 2 - w_out[0] ** 2)}
        )  # fmt: skip
    return rows
