"""Campaigns of many shear runs: the same truth, odd runs named, intervals that hold, a report that can be read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from benchmarks.many_shear import Campaign, plans, recordings
from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.findings.figures import Figure, Table
from pipeline.recording import Recording
from pipeline.report.page import render_report
from pipeline.rigs.experiment import Context, in_turn
from pipeline.rigs.mre.model.fit_errors import Errors
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, identify_loops, refit
from pipeline.rigs.mre.model.leave_one_out import leave_one_out
from pipeline.rigs.mre.model.many import in_a_row, standing_for, widened
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.shear.odd_among_many import odd_among
from tests.mre.faulty_logs import assert_numbers_hold, left_out
from tests.mre.loops_of_truth import noisy

CAMPAIGN = Campaign(runs=60, bad=0.15, duration=1.2, rate=1500.0)


def identified(runs: Sequence[Recording], each: Any = in_turn) -> Findings:
    return SHEAR.identify(runs, ShearSettings(starts=2, moving_mass=0.0), Context("many", {}, each=each))


@pytest.fixture(scope="module")
def campaign() -> list[Recording]:
    return list(recordings(CAMPAIGN))


@pytest.fixture(scope="module")
def findings(campaign: list[Recording]) -> Findings:
    return identified(campaign)


def test_the_truth_is_found_although_every_seventh_run_is_faulty(findings: Findings) -> None:
    assert_numbers_hold(findings)
    assert findings.verdict == "warning"


def test_every_faulty_run_is_left_out_and_no_other(findings: Findings) -> None:
    faulty = {plan.run.name for plan in plans(CAMPAIGN) if plan.fault}
    assert set(left_out(findings)) == faulty


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("gain 6 % high", "its force is +"),
        ("force 600 us late", "us later than theirs"),
        ("another preload", "another preload"),
        ("force clipped", "is clipped"),
    ],
)
def test_a_run_left_out_is_told_with_its_cause(findings: Findings, fault: str, words: str) -> None:
    run = next(plan.run.name for plan in plans(CAMPAIGN) if plan.fault == fault)
    assert words in left_out(findings)[run]


def test_intervals_are_no_narrower_than_scatter_over_so_many_runs_allows(findings: Findings) -> None:
    stiffness = findings.one("k2")
    assert stiffness.value is not None
    assert stiffness.std_error is not None
    # k2 is common to 50 runs whose gains scatter by 0.4 %; the twelve at 0 A and less tell most of it.
    assert stiffness.std_error / stiffness.value > CAMPAIGN.scatter / np.sqrt(50)


def _in_two_processes(function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], seconds: float) -> Iterable[Any]:
    from joblib import Parallel, delayed

    del seconds
    return list(Parallel(n_jobs=2)(delayed(function)(*task) for task in tasks))


def test_two_processes_find_what_one_does_to_the_last_bit(campaign: list[Recording], findings: Findings) -> None:
    again = identified(campaign, _in_two_processes)
    assert again.model_dump(exclude={"arrays"}) == findings.model_dump(exclude={"arrays"})
    for name, table in findings.arrays.items():
        pd.testing.assert_frame_equal(table, again.arrays[name], check_exact=True)


def test_the_report_shows_trends_in_place_of_every_run(findings: Findings) -> None:
    blocks = [block for section in SHEAR.sections(findings) for block in section.blocks]
    figures = {block.name: block for block in blocks if isinstance(block, Figure)}
    assert "over_runs" in figures
    assert [panel.title.split(",")[0] for panel in figures["loops"].panels] == [
        "best", "lower quartile", "median", "upper quartile", "worst",
    ]  # fmt: skip
    assert all(len(figure.panels) <= 16 for figure in figures.values())
    assert all(len(block.rows) < 120 for block in blocks if isinstance(block, Table))
    assert len(render_report(findings, SHEAR, "many", "rigfit run").encode()) < 2e6


def test_few_sentences_tell_why_many_runs_are_left_out() -> None:
    found = identified(list(recordings(replace(CAMPAIGN, bad=0.3, seed=2))))
    faulty = [plan.run.name for plan in plans(replace(CAMPAIGN, bad=0.3, seed=2)) if plan.fault]
    assert set(left_out(found)) == set(faulty)
    assert len(found.reasons) < 10
    assert any("and so " in reason for reason in found.reasons), listing(found.reasons)
    assert_numbers_hold(found)


def test_odd_runs_of_one_condition_together_are_no_odd_runs() -> None:
    """Where all repeats at one condition differ from the model, the runs are not what is wrong."""
    loops = many_loops(5)
    moved = [replace(loop, F=1.05 * loop.F) if loop.run.startswith("sh_10hz_2a") else loop for loop in loops]
    found = odd_among(moved, FitOptions(starts=1))
    assert found.runs == ()
    assert "10 Hz" in found.conditions
    name = next(loop.run for loop in loops if loop.run.startswith("sh_10hz_2a"))
    one = [replace(loop, F=1.05 * loop.F) if loop.run == name else loop for loop in loops]
    assert odd_among(one, FitOptions(starts=1)).runs == (name,)


def test_ordinary_scatter_makes_no_run_odd() -> None:
    assert [odd_among(many_loops(5, first), FitOptions(starts=1)).runs for first in (10, 20, 30)] == [(), (), ()]


def test_a_bad_day_is_told_as_one() -> None:
    bad_day = replace(CAMPAIGN, runs=100, bad=0.0, bad_day=True)
    found = identified(list(recordings(bad_day)))
    assert set(left_out(found)) == {"r0061", "r0062", "r0063", "r0064"}
    assert any("r0061 to r0064" in reason for reason in found.reasons)


def many_loops(repeats: int, first: int = 0) -> list[Any]:
    """Return repeats of the sheet's campaign with gains that scatter by 0.4 %."""
    return [
        replace(loop, run=f"{loop.run}_{seed}")
        for seed in range(repeats)
        for loop in noisy({"gain_scatter": 0.004}, seed)
    ]


def test_one_step_leaves_a_run_out_as_a_refit_does() -> None:
    options = FitOptions(variants=("ks",), starts=1)
    fit = identify_loops(many_loops(5), options).selected
    left = leave_one_out(fit, options)
    for i in (3, 40):
        without = refit(fit, [loop for loop in fit.loops if loop is not fit.loops[i]], options)
        sd = np.sqrt(np.diag(fit.errors.covariance))
        assert left.values[i] == pytest.approx(without.values, abs=0.02 * float(sd.max())) or np.all(
            np.abs(left.values[i] - without.values) < 0.02 * sd
        )


def test_errors_hold_what_neighbouring_runs_have_in_common() -> None:
    """A mean of runs whose errors wander: the spread claimed from white noise is too small, that by stretches is not."""
    rng = np.random.default_rng(0)
    runs, seen, claimed = 400, [], []
    for _ in range(200):
        wander = np.repeat(rng.standard_normal(runs // 8), 8)
        residual = rng.standard_normal(runs) + wander
        mean = residual.mean()
        plain = Errors(np.array([[2.0 / runs]]), np.zeros((1, 0)), 0.0)
        wider = widened(plain, np.ones((runs, 1)), residual - mean, np.arange(runs), [in_a_row(runs)])
        seen.append(mean)
        claimed.append(wider.covariance[0, 0])
    assert np.std(seen) > 1.8 * np.sqrt(2.0 / runs)
    assert np.sqrt(np.mean(claimed)) == pytest.approx(np.std(seen), rel=0.2)


def test_the_loops_that_stand_for_all_span_their_conditions() -> None:
    loops = many_loops(8)
    labels = [round(loop.current or 0.0) // 2 for loop in loops]
    chosen = [loops[i] for i in standing_for(loops, labels, 36)]
    assert len(chosen) <= 36
    assert {(round(loop.frequency), round(loop.current or 0)) for loop in chosen} == {
        (f, i) for f in (5, 10, 15) for i in (0, 2, 4, 6)
    }
