"""`rap.flow`: calibration, hold-out and another tube with all the dirt of device and meter.

Nothing of the rig is the same twice. Largest and rms error of the flow state what windows showed, without an interval: they
are left out. E2 takes a pulsation's worth to be straight over speed, which it is not quite; how far three coefficients are off
by that is the same in each campaign. Left-out set-points tell its size and not its sign, so that intervals of `stroke_volume`,
`y0` and `y1` hold the truth more often than 95 times in 100 and cannot be made narrower from these logs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.coverage.dirt import coloured
from benchmarks.coverage.rap_logs import METER_U, QUIET, UNEVEN, label, lossy, meters_off, pressure_noise, varied
from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.hydraulics import outlet_impedance, steady_state
from pipeline.rigs.rap.circuit.pump import flow_at, fundamental, speed_for
from pipeline.rigs.rap.flow.declaration import FLOW, FlowSettings
from pipeline.rigs.rap.synthetic import rig
from pipeline.rigs.rap.synthetic.truth import FlowTruth, circuit_of, pump_of, truth_of

CASES = {
    "standard": Case(
        "another circuit, pump, other sensors and clocks in each campaign; white and coloured noise, converter steps, jitter of "
        f"2 ms on both clocks, wandering speed, lost samples; meter off by {100 * METER_U:g} % (1 sigma, stated)"
    ),
}
TUBE_U = FlowSettings().tube_u
_SETTLED = 4.0


def campaign(_case: str, seed: int) -> Campaign:
    """Return the logs of R2 and R3 and what is true of them."""
    rng = np.random.default_rng((seed, 92))
    overrides: dict[str, Any] = {**UNEVEN, **varied(rng, FlowTruth()), **meters_off(rng, "flowmeter_gain_u")}
    overrides["tube_change"] = TUBE_U * float(rng.standard_normal())
    recordings = coloured(rig.synthesize_flow(overrides, seed), rng, pressure_noise(), memory=2.0)
    recordings = lossy(recordings, rng, "device", "bench")
    return Campaign(recordings, known(overrides, seed), label=label)


def known(overrides: Mapping[str, Any], seed: int) -> Callable[[Parameter], float | None]:
    """Return the truth: E2 as its own formula has it, E3 by the pump, flows as they were."""
    t = truth_of(FlowTruth(), overrides)
    quiet = {run.run: run for run in rig.synthesize_flow({**overrides, **QUIET_FLOW}, seed)}
    f0, df = 2.0, 1e-3

    def y(f: float) -> float:
        Z = abs(outlet_impedance(circuit_of(t), 2j * math.pi * f))
        pole = 1.0 / math.hypot(1.0, 2.0 * math.pi * f * t.pole_prefilter)
        return float(1.0 / (2.0 * fundamental(t.w) * Z * t.gain_prefilter * pole))

    V_0, C_p = _mean_pressure_estimator(t)
    values = {
        "stroke_volume": t.V_g, "y0": y(f0), "y1": (y(f0 + df) - y(f0 - df)) / (2.0 * df), "stroke_volume_mean": V_0,
        "pump_compliance": C_p,
    }  # fmt: skip

    def truth(p: Parameter) -> float | None:
        if p.name == "flow":
            through = _mean_flow(quiet[str(p.at["run"])], float(p.at["flow_set"]), t.device_lag)
            return through + (t.uf_flow if t.flowmeter_location == "return" else 0.0)
        return values.get(p.name)

    return truth


QUIET_FLOW = {name: value for name, value in QUIET.items() if hasattr(FlowTruth(), name)}


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


STUDY = Study(FLOW, CASES, campaign)
