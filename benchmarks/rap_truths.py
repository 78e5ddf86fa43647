"""What is true of the synthetic ultrafiltration device, by parameter of its findings; for `coverage_rap`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.hydraulics import outlet_impedance, steady_state
from pipeline.rigs.rap.circuit.pump import flow_at, fundamental, speed_for
from pipeline.rigs.rap.conditions import TAPS
from pipeline.rigs.rap.synthetic import rig
from pipeline.rigs.rap.synthetic.therapy_truth import TherapyTruth, therapy_truth
from pipeline.rigs.rap.synthetic.truth import FlowTruth, PressuresTruth, circuit_of, pump_of, truth_of

QUIET: dict[str, Any] = {
    "sensor_noise": 0.0, "adc_noise": 0.0, "bench_noise": 0.0, "device_lsb": 0.0, "bench_lsb": 0.0, "meter_noise": 0.0,
    "meter_gain": 1.0, "bench_gain": 1.0,
}  # fmt: skip
"""Readings without noise; the random numbers of pump and clocks stay what they are."""
QUIET_THERAPY: dict[str, Any] = {**QUIET, "scale_noise": 0.0, "scale_gain": 1.0, "battery_noise": 0.0}
_SETTLED = 4.0
Known = Callable[[Parameter], float | None]


def pressures(overrides: Mapping[str, Any], _seed: int) -> Known:
    """Return what tells the truth of a parameter of `rap.pressures`; None where it has none of its own."""
    t = truth_of(PressuresTruth(), overrides)
    rho = 1e-6 * (t.device_ppm - t.bench_ppm)
    middle = 0.5 * (max(t.device_lag, 0.0) + t.duration)
    values = {
        "lag": t.device_lag + rho * middle, "clock_rate": rho, "r_access": t.R_a, "r_filter": t.R_f, "r_return": t.R_r,
        "c_return": t.C_2, "l_return": t.L_r, "c_uf": t.C_u, "k_uf": t.K_uf,
    }  # fmt: skip

    def known(p: Parameter) -> float | None:
        tap = str(p.at.get("channel", TAPS[1]))
        if p.name == "gain":
            return float(getattr(t, f"gain_{tap}"))
        if p.name == "offset":
            return float(getattr(t, f"offset_{tap}"))
        if p.name == "sensor_pole":
            return float(getattr(t, f"pole_{tap}"))
        return values.get(p.name)

    return known


def flow(overrides: Mapping[str, Any], seed: int) -> Known:
    """Return the same for `rap.flow`: E2 as its own formula has it, E3 by the pump, flows as they were."""
    t = truth_of(FlowTruth(), overrides)
    quiet = {run.run: run for run in rig.synthesize_flow({**overrides, **QUIET}, seed)}
    f0, df = 2.0, 1e-3

    def y(f: float) -> float:
        Z = abs(outlet_impedance(circuit_of(t), 2j * math.pi * f))
        pole = 1.0 / math.hypot(1.0, 2.0 * math.pi * f * t.pole_prefilter)
        return 1.0 / (2.0 * fundamental(t.w) * Z * t.gain_prefilter * pole)

    V_0, C_p = _mean_pressure_estimator(t)
    values = {
        "stroke_volume": t.V_g, "y0": y(f0), "y1": (y(f0 + df) - y(f0 - df)) / (2.0 * df), "stroke_volume_mean": V_0,
        "pump_compliance": C_p,
    }  # fmt: skip

    def known(p: Parameter) -> float | None:
        if p.name == "flow":
            through = _mean_flow(quiet[str(p.at["run"])], float(p.at["flow_set"]), t.device_lag)
            return through + (t.uf_flow if t.flowmeter_location == "return" else 0.0)
        return values.get(p.name)

    return known


def _mean_pressure_estimator(t: FlowTruth) -> tuple[float, float]:
    """Return V_0 and C_p of E3 as the calibration has them: the gains of two sensors differ, so C_p inherits a mixture."""
    circuit, pump = circuit_of(t), pump_of(t)
    rows, flows = [], []
    for clamp in t.calibration_clamps:
        clamped = replace(circuit, R_a=circuit.R_a * float(clamp))
        for flow in t.flows:
            f = speed_for(pump, circuit, float(flow))
            Q = flow_at(pump, clamped, f)
            P_a, P_pre = steady_state(clamped, Q, 0.0)[:2]
            rows.append([f, -f * (t.gain_prefilter * P_pre - t.gain_access * P_a)])
            flows.append(Q)
    scale = np.array([1e-6, 1e-11])
    V_0, C_p = scale * np.linalg.lstsq(np.array(rows) * scale, np.array(flows), rcond=None)[0]
    return float(V_0), float(C_p)


def _mean_flow(run: Recording, flow_set: float, lag: float) -> float:
    """Return the mean of the noiseless meter (m^3/s) at a set-point, over all clamps."""
    changes, level = run.signal("blood_flow_set")
    moments, read = run.signal("blood_flow_bench")
    at = moments - lag
    now = np.searchsorted(changes, at, side="right") - 1
    set_now = level[np.maximum(now, 0)]
    edges = moments[1:][np.diff(set_now) != 0.0]
    settled = at > changes[0] + _SETTLED
    for edge in edges:
        settled &= (moments < edge - 1.0) | (moments > edge + _SETTLED)
    return float(read[settled & (np.abs(set_now - flow_set) < 1e-9)].mean())


def therapy(overrides: Mapping[str, Any], seed: int) -> Known:
    """Return the same for `rap.therapy`: volume and energy as they were in that run."""
    t = therapy_truth(overrides)
    quiet = {run.run: run for run in rig.synthesize_therapy({**overrides, **QUIET_THERAPY}, seed)}

    def known(p: Parameter) -> float | None:
        run = quiet.get(str(p.at.get("run", t.runs[0])))
        if run is None:
            return None
        if p.name.startswith("temperature_") or p.name == "time_constant":
            offset = t.temperature_offset if p.at.get("source") == "rap" else 0.0
            values = {"temperature_initial": t.temperature_initial + offset,
                      "temperature_final": t.temperature_final + offset, "time_constant": t.temperature_time}  # fmt: skip
            return values.get(p.name)
        return _of_run(p.name, run, t)

    return known


def _of_run(name: str, run: Recording, t: TherapyTruth) -> float | None:
    if name in ("k_uf_initial", "k_uf_decline"):
        return t.K_uf if name == "k_uf_initial" else t.fouling * (run.run == "rap_therapy_312")
    if name == "uf_volume_final":
        return float((run.values("uf_mass_scale")[-1] - t.scale_tare) / t.fluid_density)
    if name == "uf_pump_gain":
        return t.pump_gain
    if name in ("energy_used", "runtime_projected") and "battery_voltage" in run:
        time, volts = run.signal("battery_voltage")
        power = volts * run.values("battery_current")
        energy = float(np.trapezoid(power, time))
        full = t.battery_efficiency * t.battery_energy
        return energy if name == "energy_used" else full * float(time[-1] - time[0]) / energy
    return None


def cytotoxicity(_overrides: Mapping[str, Any], _seed: int) -> Known:
    """Return the same for `rap.cytotoxicity`: the synthetic fluid does the cells no harm."""
    return lambda p: 0.0 if p.name.endswith("_difference") else None


TRUTHS: dict[str, Callable[[Mapping[str, Any], int], Known]] = {
    "pressures": pressures,
    "flow": flow,
    "therapy": therapy,
    "cytotoxicity": cytotoxicity,
}
