"""Intervals of complete campaigns hold the truth: the short form of `python -m benchmarks.coverage mre.shear ...`.

A few campaigns, the logs of shear and rich shorter than there. The sum of (error over standard error)^2 over n independent numbers
is about n; standard errors that are too small by a factor 1.5 would lift it to 2.25 n, errors too large by 1.5 lower it to 0.44 n.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from honest_intervals import scores, share_is_likely
from scipy.stats import chi2

from benchmarks.coverage.studies import mre_axial, mre_hold, mre_shear, mre_step
from benchmarks.coverage.study import Study, outcome

_CHANCE = 0.01


@dataclass(frozen=True)
class Short:
    """A study, how many campaigns, and which of its numbers are independent and have many degrees of freedom."""

    study: Study
    campaigns: int
    labels: tuple[str, ...]


SHORT = {
    "shear": Short(mre_shear.STUDY, 3, ("tau", "rho", "c_bw", "n_bw", "force_lag", "loss_factor")),
    "hold": Short(
        mre_hold.STUDY, 6, ("force_initial", "saturation_current", "sharpness", "flux_slope", "flux_saturation", "remanence")
    ),
    "step": Short(mre_step.STUDY, 6, ("delay rise", "t63 rise", "t63 fall", "time_constant_1 fall", "creep", "force_step fall")),
    "axial": Short(mre_axial.STUDY, 4, ("stiffness_cubic 0 A", "rho 0 A", "loss_ratio 0 A", "stiffness_cubic 2 A", "loss_ratio 2 A")),
}  # fmt: skip


@pytest.mark.parametrize("short", SHORT.values(), ids=SHORT)
def test_intervals_hold_the_truth_as_often_as_they_say(short: Short, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mre_shear, "_OVERRIDES", {**mre_shear._OVERRIDES, "duration": 1.0, "preload_runs": False})
    rows = [
        row
        for seed in range(300, 300 + short.campaigns)
        for row in outcome(short.study, "standard", seed).rows
        if row.std_error
    ]
    z = scores(rows, short.labels.__contains__)
    assert z.size > 15
    assert share_is_likely(z, chance=_CHANCE)
    assert chi2.ppf(_CHANCE, z.size) < z @ z < chi2.ppf(1 - _CHANCE, z.size)
