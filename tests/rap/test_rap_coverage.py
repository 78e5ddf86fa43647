"""Intervals of complete campaigns hold the truth: the short form of `python -m benchmarks.coverage rap.pressures ...`.

A few campaigns of less than the full length; errors that are a factor 1.5 too small or too large fail.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from honest_intervals import scores, share_is_likely
from scipy.stats import chi2

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
    rows = [row for one in shortened(name, range(300, 300 + count), monkeypatch) for row in one.rows]
    z = scores(rows, INDEPENDENT[name].__contains__)
    assert z.size >= count
    # Errors a factor 1.5 too small hold the truth in 81 of 100.
    assert share_is_likely(z, chance=0.005)
    assert chi2.cdf(float(z @ z) / 1.5**2, z.size) < 0.99
    assert chi2.cdf(float(z @ z) * 1.5**2, z.size) > 0.01
