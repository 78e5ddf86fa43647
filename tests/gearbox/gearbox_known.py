"""Runs of the synthetic gearbox with their true stages and events, for tests of the numbers alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.recording import Recording
from pipeline.rigs.gearbox.aligned_run import AlignedRun, ZeroOffset
from pipeline.rigs.gearbox.synthetic import KnownRun, known_runs, synthesize
from pipeline.rigs.gearbox.torques.nominal import Level, level
from pipeline.rigs.gearbox.truth import gearbox_truth

RAMP_END = 4.08
A, J_L, D0, D1 = 0.5443, 0.0195, 0.2467, 0.004244


@dataclass(frozen=True, eq=False)
class Known:
    """A run, its truth, and what the stages before the numbers would give."""

    truth: KnownRun
    recording: Recording
    run: AlignedRun

    def true(self, name: str, time: float) -> float:
        """Return a quantity of the motion at `time`."""
        return float(np.interp(time, self.truth.motion.time, getattr(self.truth.motion, name)))

    def level(self, side: str, stage: str) -> Level:
        """Return the nominal torque of a stage."""
        time, torque_in, torque_out = self.run.slow
        speed = self.truth.speed if stage != "sos" else (self.true("w1", 15.0) if side == "in" else 0.0)
        values, offset = (torque_in, self.run.offset_in) if side == "in" else (torque_out, self.run.offset_out)
        found = level(time, values, self.run.stages[stage], speed, offset)
        assert found is not None
        return found

    @property
    def steady(self) -> list[tuple[float, float]]:
        """Settled locked stretches."""
        return [self.level("in", "fos").span, self.level("in", "fos_after").span]


@cache
def known(name: str, seed: int) -> Known:
    """Return run `name` (g1-g8) of the synthetic campaign with this seed."""
    options = {"runs": [name], "vibration": False}
    truth, _ = next(iter(known_runs(gearbox_truth(options), seed)))
    (recording,) = synthesize(options, seed)
    time, torque_in = recording.signal("torque_in")
    torque_out = recording.signal("torque_out")[1]
    angle_time, counts = recording.signal("encoder_count_out")
    zeros = [_zero(values[time < 1.9]) for values in (torque_in, torque_out)]
    ev = truth.events
    relocked = ev["relock"] + 0.2
    stages = {
        "standstill": (0.0, ev["startup"]),
        "startup": (ev["startup"], RAMP_END),
        "fos": (RAMP_END, ev["brake_onset"]),
        "brake": (ev["brake_onset"], ev["sos_start"]),
        "sos": (ev["sos_start"], ev["sos_end"]),
        "release": (ev["sos_end"], relocked),
        "fos_after": (relocked, ev["rundown"]),
    }
    run = AlignedRun(
        truth.name,
        time,
        torque_in - zeros[0].value,
        torque_out - zeros[1].value,
        angle_time,
        counts * 2 * np.pi / 512,
        stages,
        ev,
        truth.speed,
        *zeros,
    )
    return Known(truth, recording, run)


def _zero(values: np.ndarray) -> ZeroOffset:
    blocks = values[: values.size // 20 * 20].reshape(-1, 20).mean(axis=1)
    count = effective_size(blocks)
    return ZeroOffset(float(blocks.mean()), float(blocks.std() / np.sqrt(count - 1)), count / 3)


def wander(rng: np.random.Generator, n: int, step: float, sd: float, memory: float = 0.05) -> np.ndarray:
    """Return first-order coloured noise."""
    from scipy.signal import lfilter

    phi = np.exp(-step / memory)
    shocks = rng.standard_normal(n) * sd * np.sqrt(1 - phi**2)
    shocks[0] = sd * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -phi], shocks))
