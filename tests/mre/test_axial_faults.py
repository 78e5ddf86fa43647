"""Faulty logs of compression are named, doubted or refused; no wrong number passes as good (mre.md section 8)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axial_logs import Change, changed, found, press, scaled, unchanged, words

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Channel, Recording
from pipeline.rigs.mre.axial.check import check

D, F = "displacement_axial", "force_axial"
AT_0, AT_2 = press(1)
SECANT_0 = 510.12e3


def force(function: object) -> Change:
    return lambda t, c: {**c, F: function(t, c[F])}


def gauge(function: object) -> Change:
    return lambda t, c: {**c, D: function(t, c[D])}


def secant_at_0(campaign: Findings) -> float | None:
    rows = campaign.find("stiffness_secant", coil_current=0.0)
    return rows[0].value if rows else None


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (scaled(displacement_axial=1e3), "mm"),
        (scaled(force_axial=1e-3), "kN taken as N"),
        (scaled(force_axial=1e3), "N taken as kN"),
        (scaled(force_axial=-1.0), "wrong sign"),
        (lambda _t, c: {**c, D: c[F], F: c[D]}, "swapped"),
        (force(lambda _t, f: 0 * f + 3.0), "dead channel"),
        (gauge(lambda _t, x: 0 * x), "dead channel"),
        (force(lambda t, _f: np.random.default_rng(0).normal(0, 10, t.size)), "does not follow"),
        (gauge(lambda t, x: np.where((t > 20) & (t < 45), x[200], x)), "stuck"),
        (lambda t, c: {**c, "current": c["current"] + 2.0 * (t > 60)}, "coil current changes"),
        (scaled(displacement_axial=12.0), "high"),
    ],
)
def test_log_that_is_no_loop_is_left_out_with_the_reason(change: Change, told: str) -> None:
    faulty = changed(AT_0, change)
    campaign = found(faulty, AT_2)
    assert campaign.verdict == "warning"
    assert campaign.runs[0].used is False
    assert told in campaign.runs[0].reason
    assert told in words(campaign)
    with pytest.raises(InputError, match=told):
        found(faulty)
    with pytest.raises(InputError, match=told):
        check(faulty)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (force(lambda _t, f: np.minimum(f, 250.0)), "clipped"),
        (force(lambda t, f: f + 0.1 * t), "drifts"),
        (force(lambda t, f: f + 200.0 * (np.arange(t.size) % 200 == 77)), "wild samples"),
        (force(lambda t, f: np.where((t > 20) & (t < 30), np.nan, f)), "no value"),
        (gauge(lambda t, x: np.where((t > 70) & (t < 80), np.nan, x)), "no value"),
        (gauge(lambda _t, x: x + 3e-4), "not at zero"),
        (force(lambda _t, f: f + 100.0), "preload"),
        (scaled(force_axial=-1.0, displacement_axial=-1.0), "sign turned"),
    ],
)
@pytest.mark.thorough
def test_what_can_be_mended_is_mended_and_said(change: Change, told: str) -> None:
    faulty = changed(AT_0, change)
    campaign = found(faulty, AT_2)
    assert campaign.verdict == "warning"
    assert told in words(campaign)
    assert secant_at_0(campaign) == pytest.approx(SECANT_0, rel=4e-3)
    assert any(told in finding.message for finding in check(faulty))


def test_drift_that_is_no_straight_line_is_not_passed_over() -> None:
    campaign = found(changed(AT_0, force(lambda t, f: f + 15 * (1 - np.exp(-t / 30)))), AT_2)
    assert campaign.verdict == "warning"
    assert "off by more than their intervals" in words(campaign)


def test_measured_current_is_trusted_over_the_label() -> None:
    campaign = found(changed(AT_0, unchanged, coil_current=2.0), changed(AT_2, unchanged, coil_current=0.0))
    assert campaign.verdict == "warning"
    assert "label says 2 A" in words(campaign)
    assert secant_at_0(campaign) == pytest.approx(SECANT_0, rel=4e-3)
    assert campaign.one("stiffening_secant", coil_current=2.0).value == pytest.approx(0.679, abs=6e-3)


def test_release_that_does_not_return_leaves_the_loss_open_only() -> None:
    campaign = found(changed(AT_0, unchanged, keep=AT_0.stream_of(D).time < 85.0), AT_2)
    assert campaign.one("loss_ratio", coil_current=0.0).value is None
    assert campaign.one("alpha", coil_current=0.0).value == pytest.approx(24.0, rel=0.02)


def test_release_alone_and_a_log_that_begins_under_load_are_refused() -> None:
    time = AT_0.stream_of(D).time
    for keep, told in ((time > 70.0, "release only"), (time > 30.0, "in the middle of a loading")):
        with pytest.raises(InputError, match=told):
            found(changed(AT_0, unchanged, keep=keep))


def test_no_hysteresis_is_told_as_a_limit() -> None:
    campaign = found(*press(1, alpha={0: 0.0}, currents=[0.0]))
    for name in ("alpha", "rho", "loss_ratio", "unloading_drop"):
        p = campaign.one(name, coil_current=0.0)
        assert p.value is None
        assert "no hysteresis" in p.description
    k = campaign.one("stiffness", coil_current=0.0)
    assert abs((k.value or 0) - 4.55e5) < 4 * (k.std_error or 0)
    assert next(m for m in campaign.models if m.selected).name == "elastic"


def test_yield_displacement_beyond_the_stroke_leaves_rho_open() -> None:
    campaign = found(*press(1, rho={0: 300.0}, alpha={0: 2000.0}, currents=[0.0]))
    p = campaign.one("rho", coil_current=0.0)
    assert p.value is None or (p.ci95 is not None and p.ci95[0] < 300.0 < p.ci95[1])
    alpha = campaign.one("alpha", coil_current=0.0)
    assert alpha.value is None or (alpha.ci95 is not None and alpha.ci95[0] < 2000.0 < alpha.ci95[1])


def test_yield_displacement_far_below_the_samples_leaves_rho_open() -> None:
    campaign = found(*press(1, rho={0: 3e7}, currents=[0.0]))
    p = campaign.one("rho", coil_current=0.0)
    assert p.value is None
    assert "too small" in p.description
    alpha = campaign.one("alpha", coil_current=0.0)
    assert alpha.value == pytest.approx(24.0, rel=0.02)
    assert "log faster" in words(campaign)


def test_few_samples_give_wide_intervals_and_too_few_none() -> None:
    campaign = found(*press(4, rate=0.3, currents=[0.0]))
    assert campaign.verdict == "warning"
    p = campaign.one("stiffness_secant", coil_current=0.0)
    assert p.value == pytest.approx(SECANT_0, rel=0.06)
    assert (p.std_error or 0) > 2e3
    with pytest.raises(InputError, match="samples"):
        found(*press(4, rate=0.1, currents=[0.0]))


def test_relaxation_at_the_turn_is_told() -> None:
    (run,) = press(1, rest_top=30.0, currents=[0.0])
    relaxing = changed(run, force(lambda t, f: f - 15 * (1 - np.exp(-np.clip(t - 60, 0, None) / 8))))
    campaign = found(relaxing)
    assert "relaxed" in words(campaign)
    assert campaign.verdict == "warning"
    assert campaign.one("alpha", coil_current=0.0).value == pytest.approx(24.0, rel=0.05)


def with_rows(recording: Recording, x: np.ndarray, F_: np.ndarray) -> Recording:
    (stream,) = recording.streams.values()
    channels = {D: Channel(D, np.round(x / 1e-5) * 1e-5, "m"), F: Channel(F, F_, "N")}
    return replace(recording, streams={"axial": replace(stream, time=np.arange(x.size) * 0.1, channels=channels)})


def test_backlash_of_the_screw_leaves_the_loading_branch() -> None:
    x, f, back = AT_0.values(D), AT_0.values(F), 60
    top = int(x.argmax()) + 5
    held = np.full(back, f[top - 3 : top + 3].mean()) + np.random.default_rng(0).normal(0, 1, back)
    screw = np.concatenate([x[:top], x[top] - 1e-6 * np.arange(back), x[top:] - 1e-6 * back])
    campaign = found(with_rows(AT_0, screw, np.concatenate([f[:top], held, f[top:]])), AT_2)
    assert "screw backlash" in words(campaign)
    assert campaign.one("alpha", coil_current=0.0).value is None
    assert secant_at_0(campaign) == pytest.approx(SECANT_0, rel=5e-3)


def test_free_travel_before_contact_is_taken_off() -> None:
    x, f, free = AT_0.values(D), AT_0.values(F), 100
    level = np.random.default_rng(0).normal(f[:3].mean(), 1, free)
    campaign = found(
        with_rows(AT_0, np.concatenate([1e-6 * np.arange(free), x + 1e-4]), np.concatenate([level, f])), AT_2
    )
    assert "first contact" in words(campaign)
    assert secant_at_0(campaign) == pytest.approx(SECANT_0, rel=5e-3)


def test_hand_turned_screw_without_any_law_uses_the_passages_only() -> None:
    x, f = AT_0.values(D), AT_0.values(F)
    rng = np.random.default_rng(2)
    # Standstills of up to 3 s at random moments, the force standing with the pad.
    repeats = np.where(rng.random(x.size) < 0.03, rng.integers(5, 30, x.size), 1)
    exact = np.interp(np.arange(x.size), np.arange(x.size), f)
    stopped = with_rows(AT_0, np.repeat(x, repeats), np.repeat(exact, repeats) + rng.normal(0, 0.3, int(repeats.sum())))
    campaign = found(stopped, AT_2)
    assert "passages" in words(campaign)
    assert secant_at_0(campaign) == pytest.approx(SECANT_0, rel=0.01)


def test_loop_that_gives_energy_is_rejected_and_tells_nothing() -> None:
    reverse = changed(AT_0, lambda _t, c: {**c, D: c[D][::-1], F: c[F][::-1]})
    campaign = found(reverse)
    assert campaign.verdict == "rejected"
    assert "give energy" in words(campaign)
    assert all(p.value is None for p in campaign.parameters)


def test_other_test_is_not_taken_for_a_loop() -> None:
    with pytest.raises(InputError, match="hold_sweep"):
        found(changed(AT_0, unchanged, test="hold_sweep"))


def test_good_log_is_not_doubted() -> None:
    assert list(check(AT_0)) == []
