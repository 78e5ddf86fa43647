"""The therapy of 312 min, 375 000 rows of device and bench: recording to findings, against the script one would write first.

The script does less and nothing of its uncertainties, checks, alarms or report: lag window by window by cross-correlation,
strokes window by window by `minimize_scalar` over least squares, the tank by `filterpy` step by step with its smoother,
temperature and membrane by `lmfit` and `curve_fit` with a block bootstrap.

    python -m benchmarks.rap_therapy
"""

from __future__ import annotations

import os
import time
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from pipeline.recording import Recording

GOAL = 20.0
_WINDOW, _LAG_WINDOW = 10.0, 30.0


def measure() -> list[dict[str, Any]]:
    from pipeline.rigs.experiment import Context
    from pipeline.rigs.rap.synthetic.rig import synthesize_therapy
    from pipeline.rigs.rap.therapy.declaration import THERAPY

    truth = {"runs": ["rap_therapy_312"]}
    (short,) = synthesize_therapy({**truth, "duration": 1800.0}, 1)
    THERAPY.identify([short], THERAPY.settings(), Context("imports", {}))
    (run,) = synthesize_therapy(truth, 1)
    begin = time.perf_counter()
    found = THERAPY.identify([run], THERAPY.settings(), Context("therapy", {}))
    ours = time.perf_counter() - begin
    begin = time.perf_counter()
    theirs = script(run)
    their_seconds = time.perf_counter() - begin
    print(f"{'':26}{'ours':>12}{'std error':>12}{'script':>12}")
    for p in found.parameters:
        name = " ".join([p.name, *(str(p.at[key]) for key in ("source",) if key in p.at)])
        if name in theirs and p.value is not None:
            print(f"{name:26}{p.value:12.5g}{p.std_error or np.nan:12.2g}{theirs[name]:12.5g}")
    rows = run.streams["device"].size
    return [
        {
            "what": f"therapy of 312 min, {rows} rows of device and of bench, findings",
            "against": "scipy, filterpy, lmfit, window by window; fewer quantities, no errors",
            "ours": ours,
            "theirs": their_seconds,
            "goal": f"ours < {GOAL:g} s",
        }
    ]


def script(run: Recording) -> dict[str, float]:
    """Return what the straightforward script finds."""
    track_lag(run)
    strokes(run)
    volume, gain = tank(run)
    initial, decline = membrane(run, gain)
    power = run.values("battery_voltage") * run.values("battery_current")
    return {
        "uf_volume_final": volume,
        "uf_pump_gain": float(gain[-2000:].mean()),
        "k_uf_initial": initial,
        "k_uf_decline": decline,
        "energy_used": float(np.trapezoid(power, run.signal("battery_voltage")[0])),
        **{f"time_constant {source}": warming(run, source) for source in ("rap", "bench")},
    }


def track_lag(run: Recording) -> np.ndarray:
    """Return lag at the start (s) and rate of the device's clock."""
    from scipy.interpolate import CubicSpline
    from scipy.signal import correlate

    t_d, device = run.signal("pressure_prefilter_rap")
    t_b, bench = run.signal("pressure_prefilter_bench")
    as_device, as_bench = CubicSpline(t_d, device), CubicSpline(t_b, bench)
    middles, lags = [], []
    lag = 3.4
    for start in np.arange(60.0, t_d[-1] - 60.0, _LAG_WINDOW):
        fine = start + np.arange(0.0, _LAG_WINDOW, 0.005)
        a, b = as_device(fine), as_bench(fine + lag)
        c = correlate(b - b.mean(), a - a.mean(), mode="same", method="fft")
        near = slice(c.size // 2 - 30, c.size // 2 + 31)
        peak = int(np.argmax(c[near])) - 30
        lag += 0.005 * peak
        middles.append(start)
        lags.append(lag)
    return np.asarray(np.polyfit(middles, lags, 1)[::-1])


def strokes(run: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return frequency (Hz) and amplitude (Pa) of the strokes in each window of 10 s."""
    from scipy.optimize import minimize_scalar
    from scipy.signal import periodogram

    t, y = run.signal("pressure_prefilter_rap")
    found = []
    for start in np.arange(t[0], t[-1] - _WINDOW, _WINDOW):
        at = (t >= start) & (t < start + _WINDOW)
        x, z = t[at] - start, y[at]
        f, P = periodogram(z, 20.0)
        band = (f > 0.8) & (f < 3.5)
        first = f[band][np.argmax(P[band])]

        def left(f: float, x: np.ndarray = x, z: np.ndarray = z) -> float:
            return float(np.sum(_fitted(x, z, f)[1] ** 2))

        best = minimize_scalar(left, bounds=(0.92 * first, 1.08 * first), method="bounded").x
        c = _fitted(x, z, best)[0]
        found.append((best, float(np.hypot(c[2], c[3]))))
    return np.array([row[0] for row in found]), np.array([row[1] for row in found])


def _fitted(x: np.ndarray, z: np.ndarray, f: float) -> tuple[np.ndarray, np.ndarray]:
    waves = [part(2.0 * np.pi * k * f * x) for k in (1, 2, 3) for part in (np.cos, np.sin)]
    M = np.stack([np.ones(x.size), x, *waves], axis=1)
    c = np.linalg.lstsq(M, z, rcond=None)[0]
    return c, z - M @ c


def tank(run: Recording) -> tuple[float, np.ndarray]:
    """Return the volume at the end (m^3) and the pump's gain, second by second."""
    from filterpy.kalman import KalmanFilter

    stamps, D = run.signal("uf_level_distance")
    valid = run.values("uf_echo_valid") > 0.0
    u = 1e3 * run.values("uf_pump_command")
    accel = np.stack([run.values(f"tank_accel_{axis}") for axis in "xyz"], axis=1).mean(axis=0)
    n = accel / np.linalg.norm(accel)
    air_time, air = run.signal("temperature_air_rap")
    c = np.sqrt(np.interp(stamps, air_time, air) / float(run.conditions["echo_reference_temperature"]))
    area = float(run.conditions["tank_lx"]) * float(run.conditions["tank_ly"])
    offset = (n[0] * float(run.conditions["level_sensor_dx"]) + n[1] * float(run.conditions["level_sensor_dy"])) / n[2]
    h = float(run.conditions["level_sensor_z"]) - D * c + offset
    kf = KalmanFilter(dim_x=2, dim_z=1)
    kf.x, kf.P = np.array([[0.0], [1.0]]), np.diag([5e-3**2, 0.15**2])
    kf.H, kf.R = np.array([[1e-3 / area, 0.0]]), np.array([[1e-6]])
    kf.Q = np.diag([0.05e-3**2, 0.02**2 / 3600.0])
    xs, Ps, Fs = [], [], []
    for k in range(stamps.size):
        kf.F = np.array([[1.0, u[k]], [0.0, 1.0]])
        kf.predict()
        z = h[k] if valid[k] else None
        if z is not None:
            S = float((kf.H @ kf.P @ kf.H.T + kf.R)[0, 0])
            z = z if (z - float((kf.H @ kf.x)[0, 0])) ** 2 / S < 9.0 else None
        kf.update(z)
        xs.append(kf.x.copy())
        Ps.append(kf.P.copy())
        Fs.append(kf.F.copy())
    smooth = kf.rts_smoother(np.array(xs), np.array(Ps), Fs, [kf.Q] * len(Fs))[0]
    return 1e-3 * float(xs[-1][0, 0]), smooth[:, 1, 0]


def membrane(run: Recording, gain: np.ndarray) -> tuple[float, float]:
    """Return K_0 (m^3/(s Pa)) and the decline a, fitted to minutes and to 200 draws of their blocks."""
    from scipy.optimize import curve_fit

    t, pre = run.signal("pressure_prefilter_rap")
    tmp = 0.5 * (pre + run.values("pressure_return_rap")) - run.values("pressure_uf_rap")
    still = t < 15.0
    tmp = tmp - tmp[still].mean()
    stamps, u = run.signal("uf_pump_command")
    minutes = np.arange(1800.0, 18600.0, 60.0)
    K = np.array(
        [
            (gain * u)[(stamps >= m) & (stamps < m + 60.0)].mean() / tmp[(t >= m) & (t < m + 60.0)].mean()
            for m in minutes
        ]
    )

    def law(m: np.ndarray, K_0: float, a: float) -> np.ndarray:
        return np.asarray(K_0 / (1.0 + a * m / 18000.0))

    found = curve_fit(law, minutes, 1e11 * K, p0=(2.0, 0.1))[0]
    rng = np.random.default_rng(1)
    blocks = np.array_split(np.arange(minutes.size), 7)
    for _ in range(200):
        at = np.concatenate([blocks[i] for i in rng.integers(0, len(blocks), len(blocks))])
        curve_fit(law, minutes[at], 1e11 * K[at], p0=found)
    return 1e-11 * float(found[0]), float(found[1])


def warming(run: Recording, source: str) -> float:
    """Return the time constant of the housing (s)."""
    from lmfit import Model

    t, T = run.signal(f"temperature_air_{source}")

    def law(t: np.ndarray, T_0: float, T_inf: float, tau: float) -> np.ndarray:
        return np.asarray(T_inf + (T_0 - T_inf) * np.exp(-t / tau))

    return float(Model(law).fit(T, t=t, T_0=T[0], T_inf=T[-1], tau=1000.0).params["tau"].value)


if __name__ == "__main__":
    print(measure()[0])
