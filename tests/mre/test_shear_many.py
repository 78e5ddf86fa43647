"""Campaigns of many shear runs: the same truth, odd runs named, intervals that hold, a report that can be read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

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
from pipeline.rigs.mre.shear.cycles import Wander
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.shear.odd_among_many import odd_among
from pipeline.rigs.mre.shear.sections_many import numbers_over_runs
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun
from pipeline.rigs.mre.shear.trend import gains_over_runs, say_changes
from pipeline.rigs.mre.shear.unsteady import say_unsteady
from tests.mre.faulty_logs import assert_numbers_hold, left_out
from tests.mre.loops_of_truth import noisy

CAMPAIGN = Campaign(runs=60, bad=0.15, duration=1.0, rate=1000.0)


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


@pytest.mark.thorough
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


@pytest.mark.thorough
def test_few_sentences_tell_why_many_runs_are_left_out() -> None:
    found = identified(list(recordings(replace(CAMPAIGN, bad=0.3, seed=2))))
    faulty = [plan.run.name for plan in plans(replace(CAMPAIGN, bad=0.3, seed=2)) if plan.fault]
    assert set(left_out(found)) == set(faulty)
    assert len(found.reasons) < 10
    assert any("nd so " in reason for reason in found.reasons), listing(found.reasons)
    assert_numbers_hold(found)


@pytest.mark.thorough
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


@pytest.mark.thorough
def test_ordinary_scatter_makes_no_run_odd() -> None:
    assert [odd_among(many_loops(5, first), FitOptions(starts=1)).runs for first in (10, 20)] == [(), ()]


@pytest.mark.thorough
def test_runs_of_other_gain_in_most_repeats_of_a_condition_are_odd_where_they_are_elsewhere_too() -> None:
    """Two kinds of pads mixed at random: at some condition the wrong kind is in the majority by chance."""
    loops = many_loops(5)
    by_place = [loop.run for loop in loops]
    at_10 = [run for run in by_place if run.startswith("sh_10hz_2a_4_")]
    others = [run for run in by_place if run not in at_10]
    stiffer = {*at_10[: len(at_10) // 2 + 1], *np.random.default_rng(0).choice(others, len(others) // 5, replace=False)}
    mixed = [replace(loop, F=1.15 * loop.F) if loop.run in stiffer else loop for loop in loops]
    found = odd_among(mixed, FitOptions(starts=1))
    assert set(found.runs) == stiffer
    assert found.conditions == ""


@pytest.mark.parametrize("kind", ["drift", "step"])
def test_what_is_said_at_the_top_is_what_the_figure_tells(kind: str, findings: Findings) -> None:
    """One judgement of the gains: each change once, of its size."""
    table = findings.arrays["runs"].copy()
    place = np.arange(len(table)) / (len(table) - 1)
    table["gain"] += 0.02 * (place if kind == "drift" else place > 0.5)
    drawn = numbers_over_runs(findings.model_copy(update={"arrays": findings.arrays | {"runs": table}}))[0]
    runs = SortedRuns()
    known = table[table["gain"].notna()]
    found = gains_over_runs(list(known["run"]), list(known["gain"]), list(known["sequence"]), list(known["begins"]))
    (said,) = say_changes(runs, found)
    (change,) = drawn.course.changes
    assert change.kind == kind
    assert change.size == pytest.approx(0.02, abs=0.005)
    assert drawn.change_sentence(change) in said
    assert [note.message for note in runs.quality] == [said]


def test_of_a_thousand_runs_of_few_cycles_chance_makes_none_soften() -> None:
    """With three degrees of freedom one run in a hundred is beyond five standard errors, and is not told; one far beyond is."""
    rng = np.random.default_rng(0)
    change = 3e-4 * rng.standard_t(3, 1000)
    assert np.abs(change).max() > 5 * 3e-4
    for largest in (0.0, 0.2):
        change[0] = largest
        wanders = [Wander(0.0, 0.0, 0.0, 0.0, size, 0.0, 3e-4, 3, 2.0) for size in change.tolist()]
        loops = [SimpleNamespace(run=f"r{i}", wander=wander, loop=None) for i, wander in enumerate(wanders)]
        assert len(say_unsteady(SortedRuns(loops=cast("list[UsableRun]", loops)))) == (largest > 0)


@pytest.mark.thorough
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
