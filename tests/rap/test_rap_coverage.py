"""Intervals of complete campaigns hold the truth: the short form of `python -m benchmarks.coverage rap.pressures ...`.

A few campaigns of less than the full length; errors that are a factor 1.5 too small or too large fail.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, chi2

from benchmarks.coverage.studies import rap_cytotoxicity, rap_flow, rap_pressures, rap_therapy
from benchmarks.coverage.study import Outcome, Study, outcome

SHORT: dict[str, dict[str, Any]] = {
    "pressures": {"duration": 320.0},
    "therapy": {
        "runs": ["rap_therapy_312"], "duration": 7500.0,
        "tables": ["device_status", "device_temperature", "bench_temperature", "scale", "events"],
    },
}  # fmt: skip
# What one campaign tells twice counts once.
INDEPENDENT = {
    "pressures": ("clock_rate", "offset access", "offset prefilter", "offset return", "offset uf", "r_access", "k_uf"),
    "flow": ("stroke_volume_mean",),
    "therapy": ("uf_volume_final", "temperature_final rap", "temperature_final bench", "time_constant bench", "energy_used"),
    "cytotoxicity": ("viability_difference", "necrosis_difference"),
}  # fmt: skip
STUDIES: dict[str, tuple[Study, int]] = {
    "pressures": (rap_pressures.STUDY, 5),
    "flow": (rap_flow.STUDY, 3),
    "therapy": (rap_therapy.STUDY, 4),
    "cytotoxicity": (rap_cytotoxicity.STUDY, 15),
}


def shortened(name: str, seeds: Sequence[int], patch: pytest.MonkeyPatch) -> list[Outcome]:
    study = STUDIES[name][0]
    if name == "pressures":
        patch.setattr(rap_pressures, "UNEVEN", {**rap_pressures.UNEVEN, **SHORT[name]})
    elif name == "therapy":
        patch.setattr(rap_therapy, "SHORT", {**rap_therapy.SHORT, **SHORT[name]})
    return [outcome(study, "standard", seed) for seed in seeds]


@pytest.mark.parametrize("name", STUDIES)
def test_intervals_hold_the_truth_as_often_as_they_say(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    count = STUDIES[name][1]
    rows = [
        row
        for one in shortened(name, range(300, 300 + count), monkeypatch)
        for row in one.rows
        if row.value is not None
    ]
    held = [
        row.ci95[0] <= row.truth <= row.ci95[1]
        for row in rows
        if row.ci95 and row.truth is not None and row.label in INDEPENDENT[name]
    ]
    assert len(held) >= count
    # Errors a factor 1.5 too small hold the truth in 81 of 100.
    assert binom.cdf(sum(held), len(held), 0.95) > 0.005
    z = np.array(
        [(row.value - row.truth) / row.std_error for row in rows if row.label in INDEPENDENT[name] and row.std_error]
    )
    assert chi2.cdf(float(z @ z) / 1.5**2, z.size) < 0.99
    assert chi2.cdf(float(z @ z) * 1.5**2, z.size) > 0.01
