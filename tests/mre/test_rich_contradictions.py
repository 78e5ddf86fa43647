"""Rich records that contradict each other, or the model: a gain, a curved sensor, a hardening pad, a gain that steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from faulty_logs import changed, with_conditions, without_channel
from rich_logs import Change, assert_numbers_hold, identify, rich, samples, true_values

from pipeline.findings import Findings
from pipeline.recording import Recording


def louder(log: Recording, factor: float) -> Recording:
    return changed(log, "force", lambda _, v: factor * v)


def doubted(findings: Findings, *words: str) -> bool:
    return findings.verdict == "warning" and any(all(w in reason for w in words) for reason in findings.reasons)


def test_two_records_of_one_current_that_contradict_each_other_are_told_with_the_factor_between_them() -> None:
    findings = identify(rich(), replace(louder(rich(seed=5), 1.03), run="again"), online=False)
    words = "rich_0a and again", "contradict each other", "One factor on the force"
    # Which of the two is off they cannot tell.
    assert doubted(findings, *words, "again by +3 ") or doubted(findings, *words, "rich_0a by -3 ")


def test_records_of_one_current_that_differ_in_more_than_a_gain_are_told_without_one() -> None:
    x = samples(rich(seed=5))[1]
    stiffer = changed(rich(seed=5), "force", lambda _, v: v + 1e4 * (x - x.mean()))
    findings = identify(rich(), replace(stiffer, run="again"), online=False)
    assert doubted(findings, "contradict each other", "k2 2.", "Something changed between them")


def test_records_that_repeat_each_other_are_no_contradiction() -> None:
    assert identify(rich(), replace(rich(seed=5), run="again"), online=False).verdict == "ok"


@pytest.mark.thorough
def test_a_gain_of_one_record_of_a_current_series_is_named_and_not_taken_for_the_field() -> None:
    findings = identify(rich(), rich(2.0), louder(rich(4.0), 1.03), rich(6.0), online=False)
    assert doubted(findings, "one factor", "run rich_4a by +3 ")
    assert not any("the field changes more" in reason for reason in findings.reasons)


def test_of_two_currents_no_one_can_tell_which_gain_is_off() -> None:
    findings = identify(rich(), louder(rich(6.0), 1.03), online=False)
    assert doubted(findings, "one factor", "or the other run")


CURVED: list[tuple[str, Callable[[np.ndarray], Change], str]] = [
    ("force", lambda _: lambda t, v: v * (1 - 0.03 * (v / 200) ** 2), "a load cell that reads"),
    ("force", lambda _: lambda t, v: v * (1 - 0.01 * (v / 200) ** 2), "a load cell that reads"),
    ("force", lambda x: lambda t, v: v + 4e10 * x**3, "a pad that hardens, k3 = 4"),
    ("force", lambda x: lambda t, v: v + 1e10 * x**3, "a pad that hardens"),
    ("displacement", lambda _: lambda t, v: v * (1 - 0.02 * (v / 6e-4) ** 2), "a displacement sensor that reads"),
]


@pytest.mark.parametrize(("channel", "bend", "words"), CURVED)
@pytest.mark.thorough
def test_a_curve_that_the_model_does_not_hold_is_named_and_the_intervals_hold_the_truth(
    channel: str, bend: Callable[[np.ndarray], Change], words: str
) -> None:
    x = samples(rich())[1]
    findings = identify(changed(rich(), channel, bend(x - x.mean())), online=False)
    assert doubted(findings, "follows the cube", words)
    truth = true_values(0.0)
    for p in findings.parameters:
        if p.name in truth and p.ci95 is not None:
            wide = p.ci95[1] - p.ci95[0]
            assert p.ci95[0] - 0.25 * wide < truth[p.name] < p.ci95[1] + 0.25 * wide, p


def _coloured(t: np.ndarray, size: float, memory: float) -> np.ndarray:
    """Return noise of first order, shape of `t`."""
    from scipy.signal import lfilter

    kept = float(np.exp(-np.median(np.diff(t)) / memory))
    white = np.random.default_rng(1).standard_normal(t.size)
    return size * np.sqrt(1 - kept**2) * np.asarray(lfilter([1.0], [1.0, -kept], white))


@pytest.mark.parametrize(("size", "memory"), [(0.7, 0.01), (2.0, 0.01), (1.0, 0.1)])
def test_noise_of_the_force_is_no_missing_part_of_the_model_whatever_its_colour(size: float, memory: float) -> None:
    findings = identify(changed(rich(), "force", lambda t, v: v + _coloured(t, size, memory)), online=False)
    assert not doubted(findings, "not in the model")
    assert_numbers_hold(findings)


MISSING: list[tuple[Callable[[np.ndarray], Change], str]] = [
    (lambda x: lambda t, v: v + 2.0 * (x / 6e-4) ** 2, "hangs together with the motion"),
    (lambda _: lambda t, v: v + np.sin(2 * np.pi * 0.11 * t), "wanders in the course"),
]


@pytest.mark.parametrize(("part", "words"), MISSING)
def test_a_part_that_the_model_lacks_is_told_though_it_is_no_larger_than_the_noise(
    part: Callable[[np.ndarray], Change], words: str
) -> None:
    log = changed(rich(), "force", lambda t, v: v + _coloured(t, 0.7, 0.01))
    x = samples(rich())[1]
    findings = identify(changed(log, "force", part(x - x.mean())), online=False)
    assert doubted(findings, "not in the model", words)


@pytest.mark.parametrize(
    "change", [lambda t, v: v * (1 - 0.03 * t / t[-1]), lambda t, v: v * np.where(t > 2 * t[-1] / 3, 1.01, 1.0)]
)
@pytest.mark.thorough
def test_a_gain_that_fades_or_steps_in_a_long_chirp_is_no_mass(change: Change) -> None:
    findings = identify(changed(rich(duration=60.0), "force", change), online=False)
    assert doubted(findings, "a gain that fades")
    assert not findings.find("moving_mass")
    assert_numbers_hold(findings)


def test_a_force_in_kilonewtons_is_doubted_where_no_pad_size_tells() -> None:
    bare = with_conditions(louder(rich(), 1e-3), pad_height=None, pad_diameter=None)
    assert doubted(identify(bare, online=False), "Is it in kN?")


def test_without_a_known_current_the_damping_of_a_field_is_found() -> None:
    unknown = with_conditions(without_channel(rich(6.0), "current"), coil_current=None)
    findings = identify(unknown, online=False)
    assert doubted(findings, "No current is known", "viscous damping")
    assert findings.one("s_mr").value == pytest.approx(360.0, rel=0.1)
    assert_numbers_hold(findings, 6.0)
    without_field = with_conditions(without_channel(rich(), "current"), coil_current=None)
    assert identify(without_field, online=False).verdict == "ok"


def test_a_label_of_no_current_on_a_record_with_a_field_is_doubted() -> None:
    mislabelled = with_conditions(without_channel(rich(6.0), "current"), coil_current=0.0)
    findings = identify(mislabelled, online=False)
    assert doubted(findings, "told to be without a field", "as viscous damping would make it")


def test_a_zero_that_steps_is_named_with_time_and_size() -> None:
    findings = identify(changed(rich(), "force", lambda t, v: v + 5.0 * (t > 11)), online=False)
    assert doubted(findings, "The zero of the force steps by +4.9", "near 11")


def test_a_force_that_the_model_misses_by_more_than_noise_explains_is_rejected() -> None:
    x = samples(rich())[1]
    findings = identify(changed(rich(), "force", lambda _, v: v + 60 * ((x - x.mean()) / 6e-4) ** 2), online=False)
    assert findings.verdict == "rejected"


def test_intervals_end_where_the_model_does() -> None:
    findings = identify(rich(duration=4.0), online=False)
    for name, floor in (("c_bw", 0.5), ("n_bw", 1.0), ("k1", 0.0)):
        for p in findings.find(name):
            assert p.ci95 is None or p.ci95[0] >= floor
