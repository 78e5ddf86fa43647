"""Loops of the synthetic rig: by way of the logs, and directly with noise on the harmonics (quick)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from pipeline.recording import Recording
from pipeline.rigs.mre.model.loop import Loop, fit_loop
from pipeline.rigs.mre.synthetic import ShearRun, ShearTruth, shear_runs, shear_truth, synthesize_shear, true_loop

# Standard deviation of a harmonic: 1 N and 1.5 um over 20 000 samples.
SD_F, SD_X = 1.0 * (2 / 20000) ** 0.5, 1.5e-6 * (2 / 20000) ** 0.5


def loop_of(recording: Recording) -> Loop:
    return fit_loop(
        recording.run,
        *recording.signal("displacement"),
        recording.values("force"),
        frequency=recording.condition("frequency"),
        current=float(recording.values("current").mean()),
        preload=recording.condition("preload"),
    )


@cache
def logged(seed: int, gain_scatter: float = 0.0, preload_runs: bool = False) -> tuple[Loop, ...]:
    """The 12-run campaign by way of its logs."""
    truth = {"gain_scatter": gain_scatter, "preload_runs": preload_runs}
    return tuple(loop_of(recording) for recording in synthesize_shear(truth, seed))


def noisy(overrides: Mapping[str, Any], seed: int, mass: float = 0.0) -> list[Loop]:
    """The loops of a campaign with noise on their harmonics, late by the lag, with gain scatter."""
    truth = {"preload_runs": False, **overrides}
    return measured(shear_runs(shear_truth(truth)), truth, seed, mass)


def measured(runs: Sequence[ShearRun], overrides: Mapping[str, Any], seed: int, mass: float = 0.0) -> list[Loop]:
    """The same for runs of one's own."""
    truth = shear_truth(overrides)
    rng = np.random.default_rng(seed)
    return [_measured(truth, true_loop(truth, run), f"{run.name}_{i}", rng, mass) for i, run in enumerate(runs)]


def _measured(truth: ShearTruth, loop: Loop, name: str, rng: np.random.Generator, mass: float) -> Loop:
    def noise(n: int, sd: float) -> np.ndarray:
        return sd * (rng.normal(size=n) + 1j * rng.normal(size=n))

    fitted = np.arange(loop.X.size) < 5
    angular = loop.omega * np.arange(1, loop.F.size + 1)
    F = loop.F.copy()
    F[: loop.X.size] -= mass * angular[: loop.X.size] ** 2 * loop.X
    F = F * np.exp(-1j * angular * truth.force_lag) * (1 + truth.gain_scatter * rng.normal())
    return replace(
        loop,
        run=name,
        X=loop.X + noise(loop.X.size, SD_X) * fitted,
        F=F + noise(F.size, SD_F),
        sd_x=SD_X * fitted,
        sd_f=np.full(F.size, SD_F),
        n_samples=20000,
        duration=4.0,
    )
