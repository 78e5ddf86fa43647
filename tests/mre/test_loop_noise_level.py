"""The noise of a harmonic, held against the closed form of a filtered noise with its knee among the harmonics."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from pipeline.rigs.mre.model.loop import N_F, fit_loop


@pytest.mark.parametrize("frequency", [5.0, 10.0])
def test_the_noise_of_a_harmonic_follows_the_knee_of_a_filtered_noise(frequency: float) -> None:
    rate, n, rho = 2000.0, 4000, np.exp(-1 / 20)  # memory of 10 ms: a knee at 16 Hz
    t = np.arange(n) / rate
    rng = np.random.default_rng(7)
    found = []
    for _ in range(40):
        force = rng.standard_normal(n) + 0.7 * np.sqrt(1 - rho**2) * lfilter([1.0], [1.0, -rho], rng.standard_normal(n))
        motion = 4e-4 * np.cos(2 * np.pi * frequency * t) + 1e-6 * rng.standard_normal(n)
        loop = fit_loop("run", t, motion, 100 * np.cos(2 * np.pi * frequency * t) + force, frequency=frequency)
        found.append(loop.sd_f**2)
    turn = np.exp(-2j * np.pi * frequency * np.arange(1, N_F + 1) / rate)
    true = 2 / n * (1 + 0.49 * (1 - rho**2) / np.abs(1 - rho * turn) ** 2)
    assert np.mean(found, axis=0) / true == pytest.approx(np.ones(N_F), abs=0.11)
