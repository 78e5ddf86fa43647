"""What is said and drawn of a number over runs: sizes in words, order of the runs, odd runs by name, runs that stand for all."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pipeline.findings.figures import Band, Line, Points, Rule, Stems
from pipeline.rigs.over_runs import (
    OverRuns,
    distribution_panel,
    natural,
    odd_table,
    over_runs,
    representative,
    trend_figure,
    trend_panel,
)

DAY = 86400.0


def stiffness(n: int, *, step: float = 0.0, odd: float = 0.0, groups: bool = False, days: int = 0) -> OverRuns:
    rng = np.random.default_rng(1)
    values = 2e5 * (1 + 0.002 * rng.normal(size=n))
    values[n // 2 :] *= 1 + step
    values[n // 4] *= 1 + odd
    labels = None
    if groups:
        values = values * (1 + np.arange(n) % 3)
        labels = [f"at {2 * (place % 3)} A" for place in range(n)]
    begins = [1.7e9 + DAY * (place * days // n) + 60 * place for place in range(n)] if days else None
    names = [f"r{place}" for place in range(n)]
    return over_runs("stiffness", "N/m", names, values, np.full(n, 200.0), groups=labels, begins=begins)


def test_a_steady_campaign_has_nothing_to_tell() -> None:
    number = stiffness(60)
    assert number.sentences() == []
    assert odd_table([number]) is None
    assert "No change and no odd run" in trend_figure([number], "t", "T").caption


def test_a_step_is_told_as_a_share_with_its_interval_and_its_day() -> None:
    (sentence,) = stiffness(60, step=0.01, days=4).sentences()
    assert re.match(r"The stiffness steps by \+(0\.9\d|1\.0) % \(95 %: \+0\.\d\d % to \+1\.\d %\)", sentence)
    assert "between run 'r29' and run 'r30' (2023-11-" in sentence


@pytest.mark.parametrize("groups", [False, True])
def test_an_odd_run_is_named_in_words_table_and_picture(groups: bool) -> None:
    number = stiffness(60, odd=0.05, groups=groups)
    (sentence,) = number.sentences()
    assert "1 run of 60 is off the others: 'r15' by +5." in sentence or "'r15' by +4." in sentence
    table = odd_table([number])
    assert table is not None
    assert [row[0] for row in table.rows] == ["r15"]
    (fault,) = [mark for mark in trend_panel(number).marks if isinstance(mark, Points) and mark.role == "fault"]
    assert fault.texts[0].startswith("r15")


def test_runs_of_several_groups_are_drawn_beside_their_own_level() -> None:
    panel = trend_panel(stiffness(60, groups=True))
    assert panel.y.unit == "%"
    drawn = np.concatenate([mark.y for mark in panel.marks if isinstance(mark, Points)])
    assert np.all(np.abs(drawn) < 0.02)


def test_days_and_steps_are_marked() -> None:
    rules = [mark for mark in trend_panel(stiffness(60, step=0.02, days=4)).marks if isinstance(mark, Rule)]
    assert [rule.label for rule in rules if rule.role == "fault"] == ["step"]
    assert len({rule.label for rule in rules}) == 4  # the step and three new days


def test_a_far_run_does_not_squeeze_the_others() -> None:
    panel = trend_panel(stiffness(60, odd=50.0))
    heights = np.concatenate([np.asarray(mark.y) for mark in panel.marks if isinstance(mark, Points | Line)])
    assert np.ptp(heights) < 0.1 * 2e5
    assert any(
        re.search(r"\+(49|50)\d\d %", text) for mark in panel.marks if isinstance(mark, Points) for text in mark.texts
    )


def test_the_order_is_that_of_numbers_times_or_names() -> None:
    runs, values = ["r10", "r9", "r1"], [1.0, 2.0, 3.0]
    assert over_runs("x", "1", runs, values).runs == ["r1", "r9", "r10"]
    by_time = over_runs("x", "1", runs, values, begins=[5.0, 9.0, 7.0])
    assert (by_time.runs, by_time.order) == (["r10", "r1", "r9"], "in the order in which the logs begin")
    assert over_runs("x", "1", runs, values, sequence=[2, 1, 3], begins=[5.0, 9.0, 7.0]).runs == ["r9", "r10", "r1"]
    assert over_runs("x", "1", runs, values, begins=[5.0, None, 7.0]).runs == ["r1", "r9", "r10"]
    assert sorted(["b2", "b10", "a"], key=natural) == ["a", "b2", "b10"]


def test_runs_that_stand_for_all_do_not_depend_on_the_order() -> None:
    runs, misfit = ["c", "a", "d", "b"], [0.2, 0.1, None, 0.1]
    assert representative(runs, misfit) == {"best": "a", "median": "b", "worst": "c"}
    assert representative(runs[::-1], misfit[::-1]) == representative(runs, misfit)
    assert representative(["a"], [1.0]) == {"best": "a"}
    assert representative(["a"], [float("nan")]) == {}


@pytest.mark.parametrize("n", [1, 2, 5, 121, 1000])
def test_any_number_of_runs_can_be_drawn(n: int) -> None:
    number = over_runs("x", "m", [f"r{place}" for place in range(n)], np.random.default_rng(0).normal(size=n))
    (panel,) = trend_figure([number], "t", "T").panels
    assert max(np.size(mark.x) for mark in panel.marks if isinstance(mark, Line | Band)) <= 121
    (bars,) = [mark for mark in distribution_panel(number).marks if isinstance(mark, Stems)]
    assert bars.y.sum() == n


def test_runs_without_the_number_are_left_out() -> None:
    values = [1.0, None, 1.1, float("nan"), 0.9, 1.0, 1.05, 0.95]
    number = over_runs("x", "1", list("abcdefgh"), values, groups=["1", "2"] * 4)
    assert np.isfinite(number.course.expected).sum() == 6
    trend_panel(number)


def test_a_number_that_no_run_tells_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="value of slip torque"):
        over_runs("slip torque", "N*m", ["a", "b"], [None, None], groups=["1", "2"])


def test_moments_that_are_not_all_known_give_no_order() -> None:
    number = over_runs("x", "1", ["a", "b"], [1.0, 2.0], begins=[5.0, float("nan")])
    assert (number.order, number.begins) == ("in the order of their names", None)
