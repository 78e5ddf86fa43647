"""Coverage of `gearbox.load_exchange`: six speeds in a cycle of 24 s, with one accelerometer.

The truth of levels and peaks is the noise-free motion, low-passed as the logs are; that of a vibration level the power of the
tones and of the white noise in a steady stage. Not compared: slopes and intercepts of the torque map along start-up and through
steady levels, where the drag changes and which are no parameters of the box; vibration of stages that are not steady.
There is no bound: levels, peaks and events are no parameters of a likelihood. Steady stretches are short for an error from
the autocorrelation, so that error over standard error has Student's spread, more than 1.

Peaks of the brake, relief and residual hold the truth more often than 95 times in 100 with a spread of 1: ripple of a phase that
nobody knows rules their error, and no wave is off by more than its amplitude. What noise adds to a maximum is in the interval of
a peak and not taken off its value: that is the bias of the start-up's. The slope of the torque map, slip torque and its
line carry 0.5 % for shafts that the brake slows during the rise, a model error that this rig shows with the same sign in every
run (bias, and a spread below 1). c0, c_S and b0 have tails: where the noise of six speeds draws w_S far off, the curve's linear
errors come out up to half as large as they are elsewhere, and the values lie off by up to four of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.recording import Recording, Stream
from pipeline.rigs.gearbox.cycle import locked_torques
from pipeline.rigs.gearbox.declaration import LOAD_EXCHANGE
from pipeline.rigs.gearbox.model.friction import drag_locked
from pipeline.rigs.gearbox.synthetic import ACCELEROMETERS, KnownRun, known_runs, synthesize
from pipeline.rigs.gearbox.truth import GearboxTruth, gearbox_truth
from pipeline.signals.filtering import low_pass

_CHANNEL = "acc_out_radial"
_CYCLE = {
    "runs": ("g1", "g2", "g3", "g5", "g7", "g8"), "brake_on": 9.0, "brake_off": 15.0, "rundown_start": 21.0, "duration": 24.0,
}  # fmt: skip
# Stamps of the counter, s; boards' clocks against that of the torques (1e-6, at the most); zeros, N m.
_JITTER, _PPM, _ZERO = 4e-4, 200.0, 0.02
# The brake lets go within, s.
_LETS_GO = (0.02, 0.5)
# The high-pass of the vibration, Hz, and amplitudes of the meshes' tones at a slip of 12 rad/s, g.
_HIGH_PASS, _MESHES, _GRINDING, _ONCE, _WHITE = 2.0, (0.12, 0.05, 0.18, 0.08), 0.08, 0.03, 0.03
_G0 = 9.81
CASES = {
    "standard": Case(
        "White noise, drift of first order (50 ms) and shaft-synchronous ripple of both torques, zeros off by 0.02 N m, converters of 14 bits; lock "
        "torque scattering by 1 %; counts of 512 a turn with stamps off by up to 0.4 ms; clocks of the other boards up to 200 ppm off; a brake that "
        "lets go within 0.02 to 0.5 s."
    ),
}


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of a campaign and what is true of them."""
    del case
    rng = np.random.default_rng((seed, 5))
    dirt: dict[str, Any] = {
        **_CYCLE, "offset_in": _ZERO * rng.standard_normal(), "offset_out": _ZERO * rng.standard_normal(),
        "encoder_ppm": rng.uniform(-_PPM, _PPM), "vibration_ppm": rng.uniform(-_PPM, _PPM), "encoder_jitter": _JITTER,
        "brake_fall": rng.uniform(*_LETS_GO),
    }  # fmt: skip
    known = gearbox_truth(dirt)
    truth = Truth(known, {run.name: run for run, _ in known_runs(known, seed)})
    return Campaign([_with_one(log) for log in synthesize(dirt, seed)], truth.of, label=_label)


def _with_one(log: Recording) -> Recording:
    """Return a log with one accelerometer."""
    board = log.streams["vibration"]
    one = Stream("vibration", board.time, {_CHANNEL: board.channels[_CHANNEL]})
    return replace(log, streams={**log.streams, "vibration": one})


def _label(p: Parameter) -> str:
    if p.name in ("inertia_load", "torque_transfer_slope", "torque_transfer_intercept") and p.at:
        return f"{p.name} (run)"
    return " ".join([p.name, *(str(p.at[key]) for key in ("stage", "event") if key in p.at)])


class Truth:
    """What is true of a campaign."""

    def __init__(self, known: GearboxTruth, runs: Mapping[str, KnownRun]) -> None:
        self._known, self._runs = known, runs
        self._peaks: dict[tuple[str, str, str], float] = {}

    def of(self, p: Parameter) -> float | None:
        """Return the truth of a parameter; None where none is held against it."""
        t = self._known
        constant = {
            "inertia_load": t.J_L, "drag_coulomb": t.d0, "drag_viscous": t.d1, "torque_transfer_slope": t.a, "slip_torque_slope": t.M_v,
            "slip_torque_intercept": t.M_c, "c0": t.c0, "c_s": t.c_s, "w_s": t.w_s, "b0": t.b0,
        }  # fmt: skip
        if p.at.get("phase") in ("startup", "steady"):
            return None
        if p.name in constant:
            return constant[p.name]
        if p.name == "torque_transfer_intercept" and not p.at:
            return float(np.mean([self._drag(run.speed) for run in self._runs.values()]))
        if p.name == "drag_locked":
            return self._drag(
                next(r.speed for r in self._runs.values() if abs(r.speed / float(p.at["speed"]) - 1.0) < 1e-3)
            )
        return self._of_run(p, self._runs[str(p.at["run"])])

    def _drag(self, speed: float) -> float:
        t = self._known
        return float(drag_locked(speed, t.c0, t.c_s, t.w_s, t.b0))

    def _of_run(self, p: Parameter, run: KnownRun) -> float | None:
        stage = str(p.at.get("stage", ""))
        if p.name == "event_time":
            event = run.events.get(str(p.at["event"]))
            return None if event is None else event - self._known.log_start
        if p.name == "vibration_rms":
            return self._vibration(run, stage)
        if p.name.endswith("_peak"):
            return self._peak(run, p.name.removesuffix("_peak"), stage)
        t_in, t_out = locked_torques(self._known, run.speed)
        sos_in, sos_out, sos_speed = (self._sos(run, name) for name in ("torque_in", "torque_out", "w1"))
        if p.name in ("torque_in_nominal", "torque_out_nominal"):
            fos, sos = (t_in, sos_in) if "_in_" in p.name else (t_out, sos_out)
            return sos if stage == "sos" else fos
        peak_in, peak_out = (self._peak(run, name, "brake") for name in ("torque_in", "torque_out"))
        return {
            "lock_torque": run.lock_torque, "slip_torque": sos_out / self._known.a, "speed_in_sos": sos_speed, "speed_out_nominal": run.speed,
            "torque_transfer_intercept": self._drag(run.speed), "efficiency_fos": t_out / t_in, "torque_ratio_sos": sos_out / sos_in,
            "power_dissipated_sos": sos_in * sos_speed, "breakaway_rise_in": peak_in - t_in, "breakaway_drop_in": peak_in - sos_in,
            "torque_residual_in": sos_in / peak_in, "torque_residual_out": sos_out / peak_out, "torque_relief_in": 1.0 - sos_in / peak_in,
            "torque_relief_out": 1.0 - sos_out / peak_out, "startup_excess_in": self._peak(run, "torque_in", "startup") - t_in,
            "startup_excess_out": self._peak(run, "torque_out", "startup") - t_out,
        }.get(p.name)  # fmt: skip

    def _held(self, run: KnownRun) -> np.ndarray:
        time = run.motion.time
        end = min(self._known.brake_off, self._known.rundown_start)
        return np.asarray((time > self._known.brake_on + 3.0) & (time < end - 0.1))

    def _sos(self, run: KnownRun, name: str) -> float:
        return float(getattr(run.motion, name)[self._held(run)].mean())

    def _peak(self, run: KnownRun, name: str, stage: str) -> float:
        if stage == "brake" and "sos_start" not in run.events:
            return float("nan")
        if (run.name, name, stage) not in self._peaks:
            time = run.motion.time[::5]
            smooth = low_pass(time, getattr(run.motion, name)[::5], 20.0)
            low, high = (2.0, 5.0) if stage == "startup" else (self._known.brake_on - 0.1, run.events["sos_start"])
            self._peaks[run.name, name, stage] = float(np.max(smooth[(time > low) & (time < high)]))
        return self._peaks[run.name, name, stage]

    def _vibration(self, run: KnownRun, stage: str) -> float | None:
        if stage not in ("fos", "sos", "fos_after"):
            return None
        tone, _, white = ACCELEROMETERS[_CHANNEL]
        power = (_WHITE * white) ** 2
        if stage == "sos":
            slip = self._sos(run, "w1")
            power += (tone * slip / 12.0) ** 2 * (0.5 * sum(size**2 for size in _MESHES) + _GRINDING**2)
        else:
            passed = 1.0 / (1.0 + (_HIGH_PASS / (run.speed / (2.0 * np.pi))) ** 4)
            power += 0.5 * (tone * _ONCE * passed) ** 2
        return _G0 * float(np.sqrt(power))


STUDY = Study(LOAD_EXCHANGE, CASES, campaign)
