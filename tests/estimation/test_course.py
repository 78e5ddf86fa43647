"""Numbers over runs: levels, drifts, steps, spells and odd runs are found with their size, and not where there are none."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.course import Change, Course, course

NOISE = 0.1


def noisy(n: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(10.0, NOISE, n)


def one_change(found: Course, kind: str) -> Change:
    (change,) = found.changes
    assert change.kind == kind
    return change


@pytest.mark.parametrize(
    "n",
    [
        6,
        pytest.param(12, marks=pytest.mark.thorough),
        pytest.param(100, marks=pytest.mark.thorough),
        pytest.param(3000, marks=pytest.mark.thorough),
    ],
)
def test_the_interval_of_the_level_covers_the_truth_in_nearly_95_of_100_campaigns(n: int) -> None:
    campaigns = {6: 120, 12: 120, 100: 60, 3000: 20}[n]
    covered = 0
    for seed in range(campaigns):
        low, high = course(noisy(n, seed)).level_ci95
        covered += low < 10.0 < high
    assert covered >= 0.95 * campaigns - 2.4 * np.sqrt(0.0475 * campaigns)


@pytest.mark.thorough
def test_few_of_sixty_steady_campaigns_show_a_change_or_an_odd_run() -> None:
    found = [course(noisy(40, seed)) for seed in range(60)]
    assert sum(bool(one.changes) for one in found) <= 3
    assert sum(bool(one.odd) for one in found) <= 8


@pytest.mark.parametrize("n", [8, 40, 1000])
def test_an_odd_run_is_named_with_its_distance(n: int) -> None:
    values = noisy(n)
    values[n // 2] += 30 * NOISE
    found = course(values, np.full(n, NOISE / 2))
    (odd,) = found.odd
    assert odd.place == n // 2
    assert odd.off == pytest.approx(30 * NOISE, abs=4 * NOISE)
    assert odd.own_errors == pytest.approx(odd.off / (NOISE / 2))
    assert abs(odd.deviations) > found.limit
    assert not found.changes


def test_the_limit_grows_with_the_number_of_runs_and_of_numbers_looked_at() -> None:
    limits = [course(noisy(n)).limit for n in (100, 1000, 10_000)]
    assert limits == sorted(limits)
    assert 3.3 < limits[0] < limits[-1] < 5.0
    assert course(noisy(100), among=30).limit > limits[0]


@pytest.mark.parametrize("n", [24, 1000])
def test_a_drift_is_told_with_its_size(n: int) -> None:
    change = one_change(course(noisy(n) + np.linspace(0, 0.6, n)), "drift")
    assert change.ci95[0] < 0.6 < change.ci95[1]
    assert (change.first, change.last) == (0, n - 1)


@pytest.mark.parametrize(("n", "size"), [(30, 0.5), (1000, 0.1)])
def test_a_step_is_found_to_the_run_or_nearly(n: int, size: float) -> None:
    values = noisy(n)
    values[n // 3 :] += size
    change = course(values).changes[0]
    assert change.kind == "step"
    assert abs(change.first - n // 3) <= 0.03 * n
    assert change.ci95[0] < size < change.ci95[1]


@pytest.mark.parametrize(("n", "size"), [(30, 0.5), (60, 0.3)])
@pytest.mark.thorough
def test_a_step_in_the_middle_is_no_drift_and_told_once(n: int, size: float) -> None:
    """Of twenty campaigns nearly all tell the step alone; a drift found first is dropped beside the step."""
    told = []
    for seed in range(20):
        values = noisy(n, seed)
        values[n // 2 :] += size
        told.append([change.kind for change in course(values).changes])
    assert sum(kinds == ["step"] for kinds in told) >= 16


@pytest.mark.parametrize(("n", "size"), [(60, 0.25), (200, 0.2)])
@pytest.mark.thorough
def test_a_slight_drift_is_no_step(n: int, size: float) -> None:
    told = [[change.kind for change in course(noisy(n, seed) + np.linspace(0, size, n)).changes] for seed in range(20)]
    assert sum(kinds == ["drift"] for kinds in told) >= 16


def test_a_bad_day_of_one_run_in_six_is_one_spell_and_none_of_its_runs_odd() -> None:
    """Their number is many enough to bend what is held for usual before the day is known."""
    for seed in range(5):
        values = noisy(60, seed)
        values[30:40] += 6 * NOISE
        found = course(values)
        change = one_change(found, "spell")
        assert (change.first, change.last) == (30, 39)
        assert change.ci95[0] < 6 * NOISE < change.ci95[1]
        assert not {odd.place for odd in found.odd} & set(range(30, 40))


def test_a_day_that_is_off_is_a_spell_with_both_ends() -> None:
    values = noisy(1000)
    values[300:400] -= 0.15
    change = one_change(course(values), "spell")
    assert abs(change.first - 300) <= 12
    assert abs(change.last - 399) <= 12
    assert change.ci95[0] < -0.15 < change.ci95[1]


def test_runs_of_a_drifted_campaign_are_not_odd_for_that() -> None:
    found = course(noisy(500) + np.linspace(0, 5, 500))
    assert not found.odd
    assert found.scatter == pytest.approx(NOISE, rel=0.15)


def test_groups_have_their_own_levels() -> None:
    group = np.arange(70) % 7
    values = noisy(70) + 5.0 * group
    values[33] += 2.0
    found = course(values, groups=[str(one) for one in group])
    assert [odd.place for odd in found.odd] == [33]
    assert found.scatter == pytest.approx(NOISE, rel=0.4)
    assert np.all(np.abs(found.levels - 10 - 5 * group) < 5 * NOISE / np.sqrt(10))


def test_scatter_is_what_own_errors_do_not_explain() -> None:
    rng = np.random.default_rng(3)
    error = np.where(np.arange(2000) % 2, 0.3, 0.05)
    values = 1.0 + rng.normal(0, 0.2, 2000) + rng.normal(0, error)
    assert course(values, error).scatter == pytest.approx(0.2, rel=0.1)
    assert course(1.0 + rng.normal(0, error), error).scatter < 0.05


def test_runs_that_follow_each_other_count_less() -> None:
    rng = np.random.default_rng(4)
    slow = np.convolve(rng.normal(0, NOISE, 420), np.ones(20) / 4, "valid")[:400]
    wandering, white = course(10 + slow), course(10 + rng.permutation(slow))
    assert wandering.level_error > 2 * white.level_error
    assert not wandering.changes


@pytest.mark.parametrize("values", [[3.0], [3.0, 3.0], [3.0] * 50, [None, 2.0, None, 2.5], [0.0] * 9, [1e-300, 2e-300]])
def test_few_or_equal_numbers_need_no_scatter(values: list[float | None]) -> None:
    found = course(values)
    assert not found.odd
    assert not found.changes
    assert found.level == pytest.approx(np.mean([value for value in values if value is not None]))


def test_one_run_has_no_error_of_its_own_making() -> None:
    assert np.isnan(course([3.0]).level_error)
    assert course([3.0], [0.2]).level_error == pytest.approx(0.2)


def test_numbers_rounded_to_a_few_steps_make_no_odd_runs() -> None:
    assert not course(np.round(noisy(300), 1)).odd
    assert not course([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.01, 1.01, 1.0]).odd


def test_the_same_input_gives_the_same_result() -> None:
    values = noisy(200)
    values[100:] += 0.1
    first, again = course(values), course(values.copy())
    assert first.changes == again.changes
    assert first.odd == again.odd


def test_no_value_at_all_is_refused() -> None:
    with pytest.raises(ValueError, match="none of the runs"):
        course([None, np.nan])


def test_two_spells_side_by_side_are_not_told_as_two_that_cancel() -> None:
    rng = np.random.default_rng(5)
    place = np.arange(994)
    weather, bad_day = (place >= 500) & (place < 668), (place >= 668) & (place < 695)
    numbers = 1 - 0.09 * place / 994 - 0.01 * weather - 0.097 * bad_day + rng.normal(0, 0.009, place.size)
    found = course(numbers)
    assert [change.kind for change in found.changes].count("drift") == 1
    (first, second) = sorted((c for c in found.changes if c.kind == "spell"), key=lambda change: change.first)
    assert first.last < second.first
    assert abs(second.first - 668) <= 2
    assert abs(second.last - 694) <= 2
    assert second.size == pytest.approx(-0.097, abs=0.01)
    assert first.size == pytest.approx(-0.01, abs=0.005)
