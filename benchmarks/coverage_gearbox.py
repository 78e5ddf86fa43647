"""Do the 95 % intervals of gearbox.load_exchange hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_gearbox [SEEDS] [--case 120] [--first 0]

The truth of levels and peaks is the noise-free motion, low-passed as the logs are; nominal levels that the
rig's drive makes drift are taken where they are measured. That of a vibration level is the noise-free log of
the same stage with the variance of its white noise on top. The boards' clocks agree: what their unknown rates
leave open on speeds makes those intervals too wide here.
"""

from __future__ import annotations

import os
from collections import defaultdict
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.findings import Findings, Parameter
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.cycle import locked_torques
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.model.friction import drag_locked
from pipeline.rigs.gearbox.synthetic import ACCELEROMETERS, KnownRun, known_runs, synthesize
from pipeline.rigs.gearbox.truth import GearboxTruth, gearbox_truth
from pipeline.rigs.gearbox.vibration.levels import high_passed
from pipeline.signals.filtering import low_pass

CASES: dict[str, dict[str, Any]] = {
    "60": {"runs": ("g1",)},
    "120": {"runs": ("g3",)},
    "210": {"runs": ("g7",)},
    "120 noisy": {"runs": ("g3",), "noise": 3.0},
    "campaign": {},
}
_EVENTS = ("startup", "brake_onset", "unlock", "sos_start", "sos_end", "relock", "rundown")
_LEVELS = [f"torque_{side}_nominal {stage}" for side in ("in", "out") for stage in ("fos", "sos", "fos_after")]
_PEAKS = [f"torque_{side}_peak {stage}" for side in ("in", "out") for stage in ("startup", "brake")]
UNITS = {
    **dict.fromkeys([f"event_time {event}" for event in _EVENTS], (1e-3, "ms")),
    **dict.fromkeys([*_LEVELS, *_PEAKS, "drag_locked"], (0.001, "mN m")),
}


def main() -> None:
    options = parser(__doc__ or "", 30)
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    for name in arguments.case or CASES:
        print(f"\n{name}, {arguments.seeds} seeds")
        print(table(study(CASES[name], seeds_of(arguments)), UNITS), flush=True)


def study(truth: dict[str, Any], seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name, stage and event; those of all runs and channels together."""
    known = gearbox_truth(truth)
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    for seed in seeds:
        runs = {run.name: run for run, _ in known_runs(known, seed)}
        findings = identify(synthesize(truth, seed), LoadExchangeSettings(), Context("coverage", {}))
        levels = _Levels(truth, seed, runs, findings)
        for p in findings.parameters:
            true = levels.of(p) if p.name == "vibration_rms" else true_value(p, known, runs)
            if true is not None:
                found[_told(p)].append((Estimate(p.name, p.value, p.std_error, p.ci95), true))
    return found


def _told(p: Parameter) -> str:
    """Return the name of a parameter with its stage or event, and whether it is a single run's."""
    if p.name in _OF_BOTH and p.at:
        return f"{p.name} (run)"
    return " ".join([p.name, *(str(p.at[key]) for key in ("stage", "event") if key in p.at)])


class _Levels:
    """True levels of vibration by run, stage and channel."""

    def __init__(self, truth: dict[str, Any], seed: int, runs: dict[str, KnownRun], findings: Findings) -> None:
        self._quiet = {r.run: r for r in synthesize({**truth, "noise": 1e-9}, seed)}
        self._noise, self._runs = float(truth.get("noise", 1.0)), runs
        self._logs: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]] = {}
        self._stages = findings.arrays["stages"]

    def _log(self, run: str, channel: str) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps and expected square of one channel, shape (n,) each."""
        if (run, channel) not in self._logs:
            self._logs[run, channel] = self._expected(run, channel)
        return self._logs[run, channel]

    def _expected(self, run: str, channel: str) -> tuple[np.ndarray, np.ndarray]:
        time, values = self._quiet[run].signal(channel)
        motion, (tone, _, white) = self._runs[run].motion, ACCELEROMETERS[channel]
        slip = np.interp(time, motion.time, motion.slip)
        noise = (0.03 * white) ** 2 + (tone * 0.08 * slip / 12.0) ** 2
        return time, high_passed(time, values) ** 2 + noise * (9.81 * self._noise) ** 2

    def of(self, p: Parameter) -> float:
        """Return the truth of a parameter `vibration_rms`."""
        table = self._stages[(self._stages["run"] == p.at["run"]) & (self._stages["stage"] == p.at["stage"])]
        start, end = float(table["start"].iloc[0]), float(table["end"].iloc[0])
        time, square = self._log(str(p.at["run"]), str(p.at["channel"]))
        guard = 0.1 if end - start > 0.4 else 0.0
        return float(np.sqrt(square[(time >= start + guard) & (time < end - guard)].mean()))


_OF_BOTH = ("inertia_load", "torque_transfer_slope")


def true_value(p: Parameter, known: GearboxTruth, runs: dict[str, KnownRun]) -> float | None:
    """Return the truth of a parameter; None where none is held against it."""
    constant = {
        "inertia_load": known.J_L, "drag_coulomb": known.d0, "drag_viscous": known.d1, "torque_transfer_slope": known.a,
        "slip_torque_slope": known.M_v, "slip_torque_intercept": known.M_c, "c0": known.c0, "c_s": known.c_s,
        "w_s": known.w_s, "b0": known.b0,
    }  # fmt: skip
    if p.name in constant:
        return None if p.at.get("phase") in ("startup", "steady") else constant[p.name]
    if p.name == "torque_transfer_intercept" and p.at.get("phase") == "brake":
        return float(drag_locked(runs[str(p.at["run"])].speed, known.c0, known.c_s, known.w_s, known.b0))
    if p.name == "drag_locked":
        speed = next(run.speed for run in runs.values() if abs(run.speed / float(p.at["speed"]) - 1.0) < 1e-3)
        return float(drag_locked(speed, known.c0, known.c_s, known.w_s, known.b0))
    run = runs.get(str(p.at.get("run")))
    return None if run is None else _of_run(p, known, run)


def _of_run(p: Parameter, known: GearboxTruth, run: KnownRun) -> float | None:
    motion, stage = run.motion, p.at.get("stage")
    t_in, t_out = locked_torques(known, run.speed)
    held = (motion.time > 13.0) & (motion.time < 19.9)
    sos = {name: float(getattr(motion, name)[held].mean()) for name in ("torque_in", "torque_out", "w1")}
    if p.name == "event_time":
        return run.events.get(str(p.at["event"]))
    if p.name.endswith("_nominal") and p.name.startswith("torque"):
        locked = t_in if "_in_" in p.name else t_out
        return sos[p.name.removesuffix("_nominal")] if stage == "sos" else locked
    if p.name.endswith("_peak"):
        return _peak(run, p.name.removesuffix("_peak"), str(stage))
    return {
        "lock_torque": run.lock_torque, "slip_torque": sos["torque_out"] / known.a, "speed_in_sos": sos["w1"],
        "speed_out_nominal": run.speed, "efficiency_fos": t_out / t_in, "torque_ratio_sos": sos["torque_out"] / sos["torque_in"],
        "power_dissipated_sos": sos["torque_in"] * sos["w1"],
        "breakaway_rise_in": _peak(run, "torque_in", "brake") - t_in,
        "breakaway_drop_in": _peak(run, "torque_in", "brake") - sos["torque_in"],
        "torque_residual_in": sos["torque_in"] / _peak(run, "torque_in", "brake"),
        "torque_residual_out": sos["torque_out"] / _peak(run, "torque_out", "brake"),
        "startup_excess_out": _peak(run, "torque_out", "startup") - t_out,
        "torque_relief_in": 1.0 - sos["torque_in"] / _peak(run, "torque_in", "brake"),
        "torque_relief_out": 1.0 - sos["torque_out"] / _peak(run, "torque_out", "brake"),
        "startup_excess_in": _peak(run, "torque_in", "startup") - t_in,
    }.get(p.name)  # fmt: skip


def _peak(run: KnownRun, name: str, stage: str) -> float:
    time = run.motion.time[::5]
    smooth = low_pass(time, getattr(run.motion, name)[::5], 20.0)
    low, high = (2.0, 5.0) if stage == "startup" else (9.9, run.events["sos_start"])
    return float(np.max(smooth[(time > low) & (time < high)]))


if __name__ == "__main__":
    main()
