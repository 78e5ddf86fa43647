"""Two findings held against each other: pairs of parameters, what a difference is measured by, what came and went."""

from __future__ import annotations

import math

import pytest

from pipeline.errors import InputError
from pipeline.findings import Findings, ModelResult, Parameter, Published, Quality, Run
from pipeline.findings.comparison import compare


def parameter(name: str, value: float | None, error: float | None = None, **at: float | str | bool) -> Parameter:
    return Parameter(
        name=name,
        symbol=name,
        value=value,
        std_error=error,
        unit="N/m",
        at=at,
        description="" if value else "too short",
    )


def findings(*parameters: Parameter, logs: tuple[str, ...] = ("a",), **more: object) -> Findings:
    runs = [Run(run=f"run {log}", files=[f"{log}.csv"], sha256=[log * 64]) for log in logs]
    return Findings(
        campaign="pads", experiment="mre.shear", verdict="ok", parameters=list(parameters), runs=runs, **more
    )  # type: ignore[arg-type]


def test_a_difference_from_the_same_logs_is_told_in_the_larger_standard_error() -> None:
    (change,) = compare(findings(parameter("k", 10.0, 3.0)), findings(parameter("k", 16.0, 4.0))).changes
    assert (change.kind, change.difference, change.error, change.ratio) == ("changed", 6.0, 4.0, 1.5)


def test_a_difference_from_other_logs_is_told_in_its_own_standard_error() -> None:
    before, after = findings(parameter("k", 10.0, 3.0), logs=("a",)), findings(parameter("k", 16.0, 4.0), logs=("b",))
    (change,) = compare(before, after).changes
    assert change.error == 5.0
    assert compare(before, after).logs.shared == "none"


def test_a_campaign_that_got_a_log_more_shares_its_errors() -> None:
    before = findings(parameter("k", 10.0, 3.0), logs=("a",))
    found = compare(before, findings(parameter("k", 16.0, 4.0), logs=("a", "b")))
    assert (found.logs.shared, found.logs.common, found.logs.only_after) == ("some", 1, ["b.csv"])
    assert found.changes[0].error == 4.0


def test_findings_without_hashes_of_logs_are_not_taken_for_independent() -> None:
    found = compare(findings(parameter("k", 1.0, 1.0), logs=()), findings(parameter("k", 2.0, 1.0), logs=()))
    assert found.logs.shared == "unknown"
    assert found.changes[0].error == 1.0


def test_every_kind_of_change_is_told_apart() -> None:
    before = findings(
        parameter("same", 1.0, 0.1), parameter("moved", 1.0, 0.1), parameter("lost", 1.0), parameter("found", None),
        parameter("never", None), parameter("gone", 1.0),
    )  # fmt: skip
    after = findings(
        parameter("same", 1.0, 0.1), parameter("moved", 1.2, 0.1), parameter("lost", None), parameter("found", 1.0),
        parameter("never", None), parameter("new", 1.0),
    )  # fmt: skip
    found = compare(before, after)
    assert {change.parameter.name: change.kind for change in found.changes} == {
        "same": "same", "moved": "changed", "lost": "not determined now", "found": "determined now",
        "never": "not determined", "new": "new", "gone": "gone",
    }  # fmt: skip
    assert not found.alike
    assert compare(before, before).alike


def test_a_new_interval_around_the_same_value_is_a_change() -> None:
    (change,) = compare(findings(parameter("k", 1.0, 0.1)), findings(parameter("k", 1.0, 0.2))).changes
    assert (change.kind, change.ratio) == ("changed", 0.0)


def test_operating_points_measured_anew_are_paired_with_the_near_one_and_never_with_two() -> None:
    before = findings(parameter("k", 1.0, 0.1, load=40_000.0), parameter("k", 2.0, 0.1, load=52_000.0))
    after = findings(parameter("k", 1.1, 0.1, load=40_010.0), parameter("k", 2.1, 0.1, load=51_990.0))
    assert [round(change.difference or 0.0, 9) for change in compare(before, after).changes] == [0.1, 0.1]
    crowded = findings(parameter("k", 1.1, 0.1, load=40_010.0), parameter("k", 2.1, 0.1, load=40_020.0))
    kinds = [change.kind for change in compare(before, crowded).changes]
    assert sorted(kinds) == ["gone", "gone", "new", "new"]


def test_true_at_an_operating_point_is_no_number_near_one() -> None:
    before, after = findings(parameter("k", 1.0, 0.1, load=1.0)), findings(parameter("k", 1.0, 0.1, load=True))
    after.parameters[0].at["load"] = "heavy"
    assert {change.kind for change in compare(before, after).changes} == {"new", "gone"}


def test_what_moved_most_comes_first() -> None:
    before = findings(*(parameter(name, 1.0, 0.1) for name in "abc"))
    after = findings(parameter("a", 1.05, 0.1), parameter("b", 0.5, 0.1), parameter("c", 1.2, 0.1))
    assert [change.parameter.name for change in compare(before, after).of("changed")] == ["b", "c", "a"]


def test_a_finding_on_the_data_that_only_has_other_numbers_neither_came_nor_went() -> None:
    clipped = [Quality(level="warning", run="r", message=f"clipped at {force} N") for force in (480.5, 512)]
    gap = Quality(level="note", run="r", message="a gap")
    found = compare(findings(quality=[clipped[0]]), findings(quality=[clipped[1], gap]))
    assert (found.quality_came, found.quality_went) == ([gap], [])
    twice = compare(findings(quality=[gap]), findings(quality=[gap, gap]))
    assert twice.quality_came == [gap]


def test_what_may_have_caused_it_is_told() -> None:
    def of(setting: float, numpy: str, model: str, agrees: bool) -> Findings:
        return findings(
            settings={"most_starts": setting}, provenance={"rigfit": "1", "libraries": {"numpy": numpy}},
            models=[ModelResult(name=model, selected=True, n_parameters=1, n_data=2)],
            published=[Published(name="k", published=1.0, found=1.0, agrees=agrees)],
        )  # fmt: skip

    found = compare(of(6, "2.0", "Maxwell", True), of(7, "2.1", "Zener", False))
    assert {(cause.what, cause.before, cause.after) for cause in found.causes} == {
        ("setting most_starts", "6", "7"), ("version of numpy", "2.0", "2.1"), ("model of the data", "Maxwell", "Zener"),
    }  # fmt: skip
    assert [new.agrees for _, new in found.claims] == [False]


def test_findings_of_different_experiments_are_refused() -> None:
    other = findings().model_copy(update={"experiment": "mre.axial", "campaign": "other"})
    with pytest.raises(InputError, match=r"'pads' is a campaign of mre\.shear, 'other' one of mre\.axial"):
        compare(findings(), other)


def test_the_ratio_of_independent_differences_has_unit_scatter() -> None:
    """With two campaigns of independent errors, the ratio is a standard normal: its spread over many is one."""
    import numpy as np

    rng = np.random.default_rng(4)
    pairs = zip(rng.normal(5, 0.3, 2000), rng.normal(5, 0.4, 2000), strict=True)
    ratios = [
        compare(findings(parameter("k", a, 0.3), logs=("a",)), findings(parameter("k", b, 0.4), logs=("b",))).changes[0].ratio
        or 0.0
        for a, b in pairs
    ]  # fmt: skip
    assert abs(np.std(ratios) - 1) < 4 / math.sqrt(2 * 2000)
