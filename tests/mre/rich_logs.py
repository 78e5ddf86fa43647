"""Rich records of the synthetic rig for tests, made once: short ones at 2 kHz."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.rich.declaration import SHEAR_RICH, RichSettings
from pipeline.rigs.mre.synthetic import ShearTruth, rich_recording, rich_signals, shear_truth

TRUTH = ShearTruth()
Change = Callable[[np.ndarray, np.ndarray], np.ndarray]


@cache
def _signals(current: float, duration: float, rate: float) -> tuple[ShearTruth, tuple[np.ndarray, ...]]:
    truth = shear_truth({"duration": duration, "rate": rate})
    return truth, rich_signals(truth, current)


@cache
def rich(current: float = 0.0, seed: int = 2, duration: float = 20.0, rate: float = 2000.0) -> Recording:
    """Return one record."""
    truth, signals = _signals(current, duration, rate)
    return rich_recording(truth, current, seed, signals)


def samples(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, displacement, force."""
    return *recording.signal("displacement"), recording.values("force")


def true_values(current: float) -> dict[str, float]:
    """Return what is to be found at a current; k2 holds k_MR."""
    names = ("k1", "s1", "alpha_bw", "rho", "c_bw", "n_bw")
    values = {name: float(getattr(TRUTH, name)) for name in names}
    return values | {
        "tau": TRUTH.s1 / TRUTH.k1,
        "k2": TRUTH.k2 + TRUTH.k_mr_at(current),
        "s_mr": TRUTH.s_mr_at(current),
        "force_lag": TRUTH.force_lag,
    }


def identify(*recordings: Recording, **settings: object) -> Findings:
    """Identify, and see that the report can be drawn."""
    findings = SHEAR_RICH.identify(list(recordings), RichSettings(**settings), Context("test", {}))
    assert SHEAR_RICH.sections(findings)
    assert all(SHEAR_RICH.methods(findings))
    return findings


def assert_numbers_hold(findings: Findings, current: float = 0.0) -> None:
    """Every number told is within 4.5 standard errors of the truth: chance of a miss below 1e-4."""
    truth = true_values(current)
    checked = 0
    for p in findings.parameters:
        if p.name in truth and p.value is not None and p.std_error:
            assert abs(p.value - truth[p.name]) < 4.5 * p.std_error, p
            checked += 1
    assert checked > 3
