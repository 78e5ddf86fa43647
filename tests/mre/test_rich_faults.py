"""Bad rich records (mre.md section 8 and beyond): named, doubted or refused, and no wrong number as good."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faulty_logs import changed, held, left_out, on_rows, said, with_channel, with_conditions, without_channel
from rich_logs import Change, assert_numbers_hold, identify, rich, samples

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.findings.storage import read
from pipeline.recording import Recording
from pipeline.rigs.mre.rich.declaration import SHEAR_RICH
from pipeline.rigs.mre.synthetic import rich_recording, shear_truth, synthesize_rich
from pipeline.signals.filtering import low_pass

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


def batch(recording: Recording, **settings: object) -> Findings:
    return identify(recording, online=False, **settings)


def moved(motion: Callable[[np.ndarray], np.ndarray], **overrides: float) -> Recording:
    """Return a record of another motion than the chirp's."""
    from pipeline.rigs.mre import synthetic

    truth = shear_truth({"rate": 1000.0, "duration": 30.0, **overrides})
    fine = np.arange(round(truth.duration * truth.rate * 10)) / (truth.rate * 10)
    x = motion(fine)
    run = synthetic.ShearRun("rich", "shear_rich", float("nan"), float("nan"), 0.0)
    return rich_recording(truth, 0.0, 3, (fine, x, synthetic._force_along(truth, run, fine, x)))


def swept(t: np.ndarray) -> np.ndarray:
    return np.asarray(np.sin(2 * np.pi * (3 + 7 * t / 30) * t))


def undetermined(findings: Findings) -> set[str]:
    return {p.name for p in findings.parameters if p.value is None}


@pytest.mark.parametrize(("channel", "factor"), [("displacement", 1e3), ("force", 1e-3)])
def test_a_wrong_unit_is_named(channel: str, factor: float) -> None:
    findings = batch(changed(rich(), channel, lambda _, v: factor * v))
    assert findings.verdict == "warning"
    assert said(findings, "shear modulus", "mm taken as m")


@pytest.mark.parametrize(
    ("channel", "change", "words"),
    [
        ("force", lambda _, v: -v, "wrong sign"),
        ("displacement", lambda _, v: -v, "wrong sign"),
        ("force", lambda t, v: np.interp(t - 0.02, t, v), "wrong way round"),
        ("force", lambda _, v: np.random.default_rng(0).permutation(v), "wrong channels"),
        ("force", lambda _, v: 0 * v, "dead"),
        ("displacement", lambda _, v: np.full_like(v, np.nan), "holds no number"),
        ("force", lambda t, v: held(t, v, 5.0, 30.0), "stuck"),
        (
            "displacement",
            lambda t, v: v.mean() + 1e-6 * np.random.default_rng(0).standard_normal(v.size),
            "does not move",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_with_the_reason(channel: str, change: Change, words: str) -> None:
    log = changed(rich(), channel, change)
    with pytest.raises(InputError, match=words):
        batch(log)
    with pytest.raises(InputError, match=words):
        SHEAR_RICH.check(log)


def test_swapped_channels_are_refused() -> None:
    _, x, force = samples(rich())
    log = changed(changed(rich(), "displacement", lambda *_: 1e-6 * force), "force", lambda *_: 1e6 * x)
    with pytest.raises(InputError, match="swapped"):
        batch(log)


@pytest.mark.parametrize(
    ("channel", "change", "words"),
    [
        ("force", lambda _, v: np.clip(v, 0.9 * v.min(), 0.9 * v.max()), "the force is clipped"),
        ("displacement", lambda _, v: np.clip(v, 0.9 * v.min(), 0.9 * v.max()), "the displacement is clipped"),
        ("force", lambda t, v: held(t, v, 8.0, 8.4), "the force is stuck"),
        ("force", lambda t, v: v + 0.3 * np.ptp(v) * t / t[-1], "the mean force drifts"),
    ],
)
def test_what_is_lost_or_taken_out_is_doubted_and_the_numbers_hold(channel: str, change: Change, words: str) -> None:
    findings = batch(changed(rich(), channel, change))
    assert findings.verdict == "warning"
    assert any(words in reason for reason in findings.reasons)
    assert_numbers_hold(findings)


def test_a_large_lag_is_found_and_doubted_since_a_filter_would_lower_its_signal_too() -> None:
    findings = batch(changed(rich(), "force", lambda t, v: np.interp(t + 1e-3, t, v)))
    assert findings.verdict == "warning"
    assert any("taken for a shift of the clocks" in reason for reason in findings.reasons)
    assert findings.one("force_lag").value == pytest.approx(60e-6 - 1e-3, abs=40e-6)
    assert findings.one("k2").value == pytest.approx(2.6e5, rel=0.005)


@pytest.mark.parametrize(
    "change", [lambda t, v: v * (1 - 0.02 * t / t[-1]), lambda t, v: v * np.where(t > 10, 1.03, 1.0)]
)
@pytest.mark.thorough
def test_a_gain_that_changes_is_doubted_and_not_taken_for_a_mass(change: Change) -> None:
    findings = batch(changed(rich(), "force", change))
    assert findings.verdict == "warning"
    assert said(findings, "gain that fades")
    assert not findings.find("moving_mass")


def test_an_untared_mass_is_found_told_and_taken_out() -> None:
    t, x, _ = samples(rich())
    inertia = 0.15 * np.gradient(np.gradient(low_pass(t, x, 60.0), t), t)
    log = changed(rich(), "force", lambda _, v: v + inertia)
    findings = batch(log)
    assert findings.verdict == "warning"
    assert any("untared mass" in reason for reason in findings.reasons)
    mass = findings.one("moving_mass")
    assert mass.value == pytest.approx(0.15, abs=4 * float(mass.std_error or 0))
    assert_numbers_hold(findings)
    known = batch(log, moving_mass=0.15)
    assert known.verdict == "ok"
    assert_numbers_hold(known)


def test_missing_values_a_gap_and_wild_samples_cost_nothing_but_themselves() -> None:
    t, _, _ = samples(rich())
    log = changed(rich(), "force", lambda t, v: np.where((t > 5) & (t < 6), np.nan, v))
    log = changed(log, "displacement", lambda t, v: np.where((t > 12) & (t < 12.5), np.nan, v))
    log = changed(log, "force", lambda _, v: np.where(np.arange(v.size) % 1777 == 0, v + 5e3, v))
    assert_numbers_hold(batch(on_rows(log, (t < 15) | (t > 16))))


def test_small_amplitudes_leave_the_bouc_wen_terms_open_and_say_what_to_do() -> None:
    findings = batch(moved(lambda t: 1e-4 * (0.6 - 0.4 * np.cos(2 * np.pi * 0.23 * t)) * swept(t)))
    assert findings.verdict == "warning"
    assert {"rho", "alpha_bw", "k2"} <= undetermined(findings)
    assert findings.one("k2_plus_alpha_rho").value == pytest.approx(4.2e5, rel=0.01)
    assert any("larger amplitudes" in advice for advice in findings.advice)
    assert_numbers_hold(findings)


@pytest.mark.parametrize("duration", [4.0, 10.0])
@pytest.mark.thorough
def test_a_short_record_gives_wider_intervals_that_hold(duration: float) -> None:
    findings = identify(rich(duration=duration))
    assert_numbers_hold(findings)
    assert findings.one("k1").std_error > batch(rich()).one("k1").std_error
    assert said(findings, "online filter not converged")


def test_a_few_strokes_are_no_rich_record() -> None:
    t, _, _ = samples(rich())
    with pytest.raises(InputError, match="strokes"):
        batch(on_rows(rich(), t < 0.6))


def test_noise_is_told_and_the_intervals_allow_for_it() -> None:
    findings = batch(synthesize_rich({"rate": 1000.0, "force_noise": 20.0}, 2, duration=30.0))
    assert findings.verdict == "warning"
    assert said(findings, "the force's noise of")
    assert_numbers_hold(findings)


def test_a_current_that_changes_or_contradicts_its_label_is_doubted() -> None:
    t, _, _ = samples(rich())
    changing = batch(with_channel(rich(), "current", np.where(t > 10, 6.0, 0.0), "A"))
    assert any("no single operating point" in reason for reason in changing.reasons)
    wrong = batch(with_conditions(rich(), coil_current=6.0))
    assert any("contradicts the label" in reason for reason in wrong.reasons)
    assert wrong.one("k2").at == {"coil_current": 0.0}
    assert {changing.verdict, wrong.verdict} == {"warning"}


def test_the_set_current_stands_in_where_none_was_measured() -> None:
    findings = batch(without_channel(rich(6.0), "current"))
    assert_numbers_hold(findings, 6.0)
    assert findings.one("s_mr", coil_current=6.0).value is not None


def test_a_good_record_stands_beside_one_that_is_left_out() -> None:
    bad = changed(rich(6.0), "force", lambda _, v: -v)
    findings = identify(rich(), bad, online=False)
    assert findings.verdict == "warning"
    assert "wrong sign" in left_out(findings)["rich_6a"]
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_a_damper_that_the_model_does_not_describe_is_rejected(
    realdata: Path, rigfit: Callable[..., Any], tmp_path: Path
) -> None:
    whole = (realdata / "mr_damper_random" / "ranran_50_converted.csv").read_text().splitlines(keepends=True)
    log, recipe = tmp_path / "random.csv", tmp_path / "damper.yaml"
    log.write_text("".join(whole[:24_000]))
    recipe.write_text((EXAMPLES / "mr_damper_random.yaml").read_text().replace("mre.shear", "mre.shear_rich"))
    answer = rigfit("run", "mre.shear_rich", log, "--recipe", recipe, "--out", tmp_path / "out")
    assert answer.status == 1, answer.err
    findings = read(tmp_path / "out")
    assert any("does not describe this device" in reason for reason in findings.reasons)
    assert any("no single operating point" in reason for reason in findings.reasons)
    assert set(findings.arrays["records"]["online"]) <= {"not converged", "diverged"}
