"""Jumps of force or gauge, friction and play, and what one rate cannot tell: named, and not passed as sound numbers."""

from __future__ import annotations

import numpy as np
import pytest
from axial_logs import changed, found, press, scaled, unchanged, words

from pipeline.recording import Recording

D, F = "displacement_axial", "force_axial"


def log(seed: int = 1, **truth: object) -> Recording:
    (recording,) = press(seed, **{"currents": [0.0], **truth})
    return recording


def played(x: np.ndarray, play: float) -> np.ndarray:
    out, at = np.empty_like(x), x[0]
    for i, value in enumerate(x):
        at = min(max(at, value - play / 2), value + play / 2)
        out[i] = at
    return out


@pytest.mark.parametrize("at", [40.0, 75.0])
@pytest.mark.parametrize("gauge", [1e-5, 1e-6])
def test_jump_of_the_force_is_named_and_taken_off(at: float, gauge: float) -> None:
    campaign = found(changed(log(gauge_step=gauge), lambda t, c: {**c, F: c[F] + 3.0 * (t > at)}))
    assert campaign.verdict == "warning"
    assert "the force jumps by +3" in words(campaign) or "the force jumps by +2." in words(campaign)
    alpha = campaign.one("alpha", coil_current=0.0)
    assert alpha.value is not None
    assert alpha.value == pytest.approx(24.0, abs=4 * (alpha.std_error or 0))


@pytest.mark.parametrize("jump", [5e-5, 2e-5])
def test_jump_of_the_gauge_is_named_and_taken_off(jump: float) -> None:
    campaign = found(changed(log(), lambda t, c: {**c, D: c[D] + jump * (t > 40)}))
    assert campaign.verdict == "warning"
    assert f"the gauge jumps by +{1e3 * jump:g} mm at" in words(campaign)
    assert campaign.one("stiffness_secant", coil_current=0.0).value == pytest.approx(510.12e3, rel=0.01)


def test_friction_of_the_press_is_named_and_in_no_alpha() -> None:
    half = 60.0
    campaign = found(changed(log(speed_error=0.0), lambda t, c: {**c, F: c[F] + 8.0 * np.where(t < half, 1.0, -1.0)}))
    assert campaign.verdict == "warning"
    assert "dry friction" in words(campaign)
    assert campaign.one("alpha", coil_current=0.0).value == pytest.approx(24.0, rel=0.15)


def test_play_of_the_gauge_is_named() -> None:
    fine = log(gauge_step=0.0)
    small = found(changed(fine, lambda _t, c: {**c, D: np.round(played(c[D], 5e-6) / 1e-6) * 1e-6}))
    large = found(changed(fine, lambda _t, c: {**c, D: np.round(played(c[D], 2e-5) / 1e-5) * 1e-5}))
    for campaign in (small, large):
        assert campaign.verdict == "warning"
        assert "play" in words(campaign)


@pytest.mark.thorough
def test_sound_logs_have_no_jumps() -> None:
    for seed in range(6):
        for truth in ({}, {"gauge_step": 1e-6, "rate_ripple": 0.3}, {"cycles": 2}):
            campaign = found(log(seed, **truth))
            assert campaign.verdict == "ok", campaign.reasons


def test_one_rate_is_said_to_leave_relaxation_open() -> None:
    campaign = found(log())
    assert campaign.verdict == "ok"
    assert "at the rate of the test, 0.01 mm/s" in words(campaign)
    assert "cannot tell hysteresis from relaxation and viscosity" in words(campaign)


def test_force_in_kilonewton_taken_as_newton_is_rejected_without_pads_too() -> None:
    nameless = changed(log(), scaled(force_axial=1e-3), pad_diameter=None, pad_height=None)
    campaign = found(nameless)
    assert campaign.verdict == "rejected"
    assert "kN taken as N" in words(campaign)
    assert campaign.one("stiffness_secant", coil_current=0.0).value is None


def test_log_without_any_current_says_so() -> None:
    bare = changed(log(), lambda _t, c: {D: c[D], F: c[F]}, coil_current=None)
    campaign = found(bare)
    assert campaign.verdict == "warning"
    assert "No coil current is known" in words(campaign)
    assert found(changed(log(), unchanged)).verdict == "ok"
