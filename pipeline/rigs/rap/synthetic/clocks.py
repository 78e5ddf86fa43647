"""Stamps of each table's own clock, and the true moments that they stand for (rap.md, sections 1 and 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.circuit.sensor_pair import bench_time, device_time


@dataclass(frozen=True)
class Clock:
    """A clock that starts `lag` seconds late and whose stamps grow `rho` slower than true time.

    They jitter (1 sigma, s): either the stamps alone, or, with `sampled`, the samples are taken when the stamps say.
    """

    lag: float = 0.0
    rho: float = 0.0
    jitter: float = 0.0
    sampled: bool = False

    def ticks(self, rate: float, end: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps (s, strictly increasing) at `rate` (Hz) up to the true moment `end`, and the samples' moments.

        A stamp jitters by no more than a third of a step.
        """
        last = device_time(end, self.lag, self.rho, 0.0)
        nominal = np.arange(max(int(np.ceil(last * rate)), 0)) / rate
        stamps = nominal
        if self.jitter:
            bound = 1.0 / (3.0 * rate)
            stamps = nominal + np.clip(self.jitter * rng.standard_normal(nominal.size), -bound, bound)
            stamps[:1] = 0.0
        return stamps, self.true(stamps if self.sampled else nominal)

    def true(self, stamps: np.ndarray) -> np.ndarray:
        """Return the true moments (s) of stamps."""
        return np.asarray(bench_time(stamps, self.lag, self.rho, 0.0))

    def stamp(self, moments: np.ndarray) -> np.ndarray:
        """Return the stamps (s) of true moments."""
        return np.asarray(device_time(moments, self.lag, self.rho, 0.0))
