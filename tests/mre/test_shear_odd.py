"""Several odd runs at once: found where they stand out, told with their cause; honest scatter costs no run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from loops_of_truth import noisy

from pipeline.rigs.mre.model.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.shear.odd_runs import OddRun, set_odd_runs_aside

# Of the 12 runs: 5, 10, 15 Hz at 0, 2, 4, 6 A, three after three.
TWELVE = 12
QUICK = FitOptions(starts=1)
ONE_MODEL = FitOptions(starts=1, variants=("ks",))


def searched(
    loops: Sequence[Loop], options: FitOptions = QUICK
) -> tuple[Identification, dict[str, str], tuple[str, ...]]:
    """Return the fit, the runs set aside with their reasons, and rivals."""
    fit, odd, rivals = set_odd_runs_aside(identify_loops(loops, options), loops, options)
    assert all(isinstance(run, OddRun) for run in odd)
    return fit, {run.run: run.reason for run in odd}, rivals


def with_faults(loops: list[Loop], faults: dict[int, Callable[[Loop], Loop]]) -> list[Loop]:
    return [faults[i](loop) if i in faults else loop for i, loop in enumerate(loops)]


def gain(factor: float) -> Callable[[Loop], Loop]:
    return lambda loop: replace(loop, F=factor * loop.F)


def larger_motion(factor: float) -> Callable[[Loop], Loop]:
    return lambda loop: replace(loop, X=factor * loop.X)


def later(seconds: float) -> Callable[[Loop], Loop]:
    return lambda loop: replace(loop, F=loop.F * np.exp(-1j * loop.omega * np.arange(1, loop.F.size + 1) * seconds))


def stiffer(added: float) -> Callable[[Loop], Loop]:
    return lambda loop: replace(loop, F=loop.F + added * loop.X)


def labelled(current: float) -> Callable[[Loop], Loop]:
    return lambda loop: replace(loop, current=current)


def names(loops: Sequence[Loop], *which: int) -> set[str]:
    return {loops[i].run for i in which}


@pytest.mark.parametrize(
    ("faults", "words"),
    [
        ({2: larger_motion(1.02), 9: larger_motion(1.02)}, "-1."),
        ({0: gain(1.015), 1: gain(1.015)}, "+1."),
        ({5: gain(1.03), 6: gain(0.97)}, "3.0 % off"),
    ],
)
@pytest.mark.thorough
def test_two_runs_of_another_gain_are_both_set_aside_with_it(
    faults: dict[int, Callable[[Loop], Loop]], words: str
) -> None:
    loops = with_faults(noisy({}, 1), faults)
    fit, odd, _ = searched(loops)
    assert set(odd) == names(loops, *faults)
    assert all(words in reason and "gain of the load cell" in reason for reason in odd.values())
    assert fit.selected.run_scatter < 5e-4
    k2 = fit.selected.one("k2")
    assert k2.value == pytest.approx(2.6e5, abs=4.5 * (k2.std_error or 0.0))


def test_two_runs_of_another_gain_stand_out_of_honest_scatter() -> None:
    loops = with_faults(noisy({"gain_scatter": 0.003}, 5), {4: gain(1.05), 11: gain(0.95)})
    assert set(searched(loops)[1]) == names(loops, 4, 11)


@pytest.mark.thorough
def test_honest_scatter_costs_no_run() -> None:
    losing = 0
    for scatter in (0.004, 0.008):
        for seed in range(6):
            _, odd, rivals = searched(noisy({"gain_scatter": scatter}, seed), ONE_MODEL)
            losing += bool(odd or rivals)
    assert losing <= 1


def test_two_exchanged_current_labels_are_both_named_with_the_right_ones() -> None:
    loops = noisy({}, 2)
    swapped = with_faults(loops, {3: labelled(4.0), 6: labelled(2.0)})  # 5 Hz, 2 A and 4 A
    assert (loops[3].current, loops[6].current) == (2.0, 4.0)
    _, odd, rivals = searched(swapped, ONE_MODEL)
    assert not rivals
    assert "goes with the runs at 2 A but is labelled 4 A" in odd[loops[3].run]
    assert "goes with the runs at 4 A but is labelled 2 A" in odd[loops[6].run]


@pytest.mark.thorough
def test_exchanged_labels_are_found_by_exchanging_them_where_leaving_one_out_helps_nothing() -> None:
    loops = [loop for loop in noisy({}, 2) if loop.current != 6.0]  # nine runs: only one may be left out at will
    _, odd, _ = searched(with_faults(loops, {3: labelled(4.0), 6: labelled(2.0)}), ONE_MODEL)
    assert set(odd) == names(loops, 3, 6)


@pytest.mark.thorough
def test_a_lag_of_two_runs_is_named_with_its_size() -> None:
    loops = with_faults(noisy({}, 3), {3: later(200e-6), 10: later(200e-6)})
    fit, odd, rivals = searched(loops)
    assert set(odd) == names(loops, 3, 10)
    assert not rivals
    for reason in odd.values():
        assert "later than theirs" in reason
        assert abs(float(reason.split(" us later")[0].split()[-1]) - 200) < 20
    assert not fit.selected.rejected


@pytest.mark.thorough
def test_the_strongest_candidates_are_told_where_no_few_runs_can_be_spared() -> None:
    lags = {i: later(400e-6 * (i - 3)) for i in (1, 5, 6, 10)}
    loops = with_faults(noisy({}, 3), lags)
    fit, odd, rivals = searched(loops, ONE_MODEL)
    assert fit.selected.rejected
    assert not odd
    *named, rest = rivals
    assert rest.startswith("the other ")
    assert rest.endswith("runs as a whole")
    assert 1 <= len(named) <= TWELVE / 3
    assert all("than theirs" in text or " off" in text for text in named)


@pytest.mark.thorough
def test_another_preload_is_not_told_as_another_current() -> None:
    # 1.4e5 N/m is nearly k_MR at 4 A (1.51e5 N/m), but without the damping that the field adds.
    loops = with_faults(noisy({}, 4), {1: stiffer(1.4e5), 10: stiffer(1.4e5)})
    _, odd, _ = searched(loops)
    assert set(odd) == names(loops, 1, 10)
    for reason in odd.values():
        assert "another preload" in reason
        assert "N/m" in reason


@pytest.mark.thorough
def test_two_explanations_that_fit_alike_are_both_said() -> None:
    # Without field damping a run at another current and one at another preload are the same.
    truth = {"k_mr": {2.0: 7.5e4, 4.0: 1.5e5, 6.0: 2.25e5}, "s_mr": {2.0: 0.0, 4.0: 0.0, 6.0: 0.0}}
    loops = with_faults(noisy(truth, 4), {1: stiffer(1.5e5)})
    reason = searched(loops)[1][loops[1].run]
    assert "another preload" in reason
    assert "goes with the runs at 4 A but is labelled 0 A" in reason
    assert "do not tell which" in reason


@pytest.mark.thorough
def test_a_third_run_of_another_gain_is_found_beside_exchanged_labels() -> None:
    loops = with_faults(noisy({}, 2), {3: labelled(4.0), 6: labelled(2.0), 10: gain(0.96)})
    assert set(searched(loops, ONE_MODEL)[1]) == names(loops, 3, 6, 10)
