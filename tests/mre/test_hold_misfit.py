"""Where the law of `mre.hold` is not that of the force: what is measured stands, what rests on the law alone is null."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hold_logs import captions, changed, hold, said, without

from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.mre.hold.law import force
from pipeline.rigs.mre.hold.synthetic import synthesize


def log(seed: int = 3, **truth: object) -> Recording:
    return without(synthesize({"rise": 0.0, "fall": 0.0, **truth}, seed)[0], "voltage")


def with_force(course: Callable[[np.ndarray, np.ndarray], np.ndarray], seed: int = 3) -> Recording:
    """Return the standard log with a force of its own: `course(time, current)` and 1 N of noise."""
    recording = log(seed)
    current = np.round(2 * recording.values("current")) / 2
    rng = np.random.default_rng(seed)
    return changed(
        recording, "force_axial", lambda t, x: course(np.maximum(t, 0.05), current) + rng.standard_normal(x.size)
    )


def increments(found: Findings) -> list[tuple[float, float, tuple[float, float]]]:
    return [
        (float(p.at["coil_current"]), p.value, p.ci95)
        for p in found.find("force_increment")
        if p.value is not None and p.ci95 is not None
    ]


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.thorough
def test_a_quadratic_force_has_the_increments_of_its_holds(seed: int) -> None:
    def share(current: np.ndarray | float) -> np.ndarray:
        return 0.65 * np.minimum(np.abs(current) / 6, 1) ** 2

    found = hold([with_force(lambda t, i: 200 * (1 + share(i)) * (1 - 0.02 * np.log10(t / 10)), seed)])
    assert said(found, "not that of this force", "those of the holds")
    told = increments(found)
    assert len(told) == 16
    # One error of F0 is in all of them: they are off together, by less than twice the interval.
    assert all(abs(value - share(current)) < high - low for current, value, (low, high) in told)
    assert found.one("force_gain").value is None
    assert found.one("saturation_current").value is None
    assert found.one("relaxation").value == pytest.approx(0.02, abs=1.5e-3)


def test_a_force_that_goes_with_the_square_of_the_field_is_named_and_costs_the_increments() -> None:
    found = hold([log(pull=60.0)])
    assert said(found, "B^2", "press the load cell")
    told = captions(found)
    assert "Not told: the law misses the holds" in told["law"]
    (taken,) = (model for model in found.models if model.selected)
    assert "no number rests on it: the law misses the holds" in taken.description
    assert "without a blank test" in told["increments"]
    assert "Not all of it: of up to" in told["time"]
    assert not increments(found)
    assert found.one("force_gain").value is None


@pytest.mark.parametrize("rate", [0.01, 0.1])
def test_a_drift_is_told_from_relaxation_and_costs_it(rate: float) -> None:
    found = hold([changed(log(), "force_axial", lambda t, x: x + rate * t)])
    assert said(found, "drifts by")
    assert found.one("relaxation").value is None
    for current, value, (low, high) in increments(found):
        truth = force(np.array([current]), np.array([10.0]), 1.0, 0.65, 5.7, 12.0, 0.0)[0] - 1
        assert abs(value - truth) < 2 * (high - low) + 1e-3


@pytest.mark.parametrize("age", [60.0, 600.0])
def test_a_gap_closed_before_the_log_began_is_noticed_and_mended_by_its_condition(age: float) -> None:
    def old(t: np.ndarray, current: np.ndarray) -> np.ndarray:
        return force(current, t + age, 200.0, 0.65, 5.7, 12.0, 0.02)

    recording = with_force(old, 5)
    found = hold([recording])
    assert said(found, "before the log began")
    assert found.one("relaxation").value is None
    from dataclasses import replace

    told = hold([replace(recording, conditions={**recording.conditions, "gap_closed_for": age})])
    assert not said(told, "before the log began")
    for name, truth in (("force_initial", 200.0), ("relaxation", 0.02), ("force_gain", 0.65)):
        p = told.one(name)
        assert p.ci95 is not None
        assert abs((p.value or 0) - truth) < 1.5 * (p.ci95[1] - p.ci95[0]) / 2, name


def test_a_force_in_steps_of_five_newton_tells_no_relaxation_of_its_own() -> None:
    coarse = changed(log(force_noise=0.3), "force_axial", lambda _t, x: 5 * np.round(x / 5))
    p = hold([coarse]).one("relaxation")
    assert p.ci95 is None or p.ci95[0] < 0.02 < p.ci95[1]


@pytest.mark.thorough
def test_repeats_that_differ_are_named_and_those_that_agree_are_not() -> None:
    from dataclasses import replace

    first = log(1)
    other = replace(log(2, force_initial=230.0, force_gain=0.6), run="b", conditions={**first.conditions})
    assert said(hold([first, other]), "differ", "force at 0 A by 15 %")
    assert not said(hold([first, replace(log(2), run="b")]), "differ")


def test_a_soft_end_of_the_range_is_named() -> None:
    rng = np.random.default_rng(1)
    limited = changed(log(), "force_axial", lambda _t, x: np.minimum(x, 290) + 0.5 * rng.standard_normal(x.size))
    found = hold([limited])
    assert said(found, "range of the sensor")
    assert found.one("saturation_current").value is None
    assert found.one("force_increment", coil_current=6.0).value is None
    assert found.one("force_increment", coil_current=2.0).value == pytest.approx(0.228, abs=0.005)
