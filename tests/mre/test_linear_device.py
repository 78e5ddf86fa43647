"""A device that is a spring and a damper, shaken without a period: its two numbers, and no others."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from pipeline.findings import Findings
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings

STIFFNESS, DAMPING, RATE = 2.0e5, 300.0, 1000.0


def chirp(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    return 4e-4 * np.sin(2 * np.pi * (0.5 * time + 0.3 * time**2) + rng.uniform(0, 6))


def noise_band(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    x = sosfiltfilt(butter(4, [0.5, 15], "band", fs=RATE, output="sos"), rng.standard_normal(time.size))
    return 2e-4 * x / x.std()


def identified(motion: str, seed: int) -> Findings:
    rng = np.random.default_rng(seed)
    time = np.arange(0, 20, 1 / RATE)
    x = {"chirp": chirp, "random": noise_band}[motion](rng, time)
    force = STIFFNESS * x + DAMPING * np.gradient(x, time) + rng.standard_normal(time.size)
    x = x + 5e-7 * rng.standard_normal(time.size)
    channels = {"displacement": Channel("displacement", x, "m"), "force": Channel("force", force, "N")}
    recording = Recording("r1", {"log": Stream("log", time, channels)})
    return SHEAR.identify([recording], ShearSettings(), Context("linear", {}))


@pytest.mark.parametrize("motion", ["chirp", "random"])
@pytest.mark.thorough
def test_spring_and_damper_are_found_and_nothing_else(motion: str) -> None:
    for seed in range(3):
        findings = identified(motion, seed)
        for name, truth in (("stiffness_storage", STIFFNESS), ("damping", DAMPING)):
            found = findings.one(name, run="r1")
            assert found.std_error is not None
            assert found.std_error < 0.005 * truth
            assert abs(float(found.value or 0.0) - truth) < 4 * found.std_error
        assert all(p.value is None for p in findings.parameters if p.name in ("k1", "tau", "alpha_bw", "force_lag"))
        assert findings.verdict == "warning"


@pytest.mark.thorough
def test_an_undetermined_k2_does_not_contradict_itself() -> None:
    for parameter in identified("chirp", 0).parameters:
        assert not (parameter.value is None and "standard error would be 0." in parameter.description)
