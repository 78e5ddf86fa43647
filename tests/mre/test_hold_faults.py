"""Faults of a hold test (mre.md section 8): each is named, doubted or refused, none passes as good."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hold_logs import captions, changed, hold, rows, said, without

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.rigs.mre.hold.declaration import HOLD
from pipeline.rigs.mre.hold.synthetic import synthesize


def log(**truth: object) -> Recording:
    return synthesize(truth, 3)[0]


def force(change: object, **truth: object) -> Recording:
    return changed(log(**truth), "force_axial", change)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
@pytest.mark.parametrize("told", [True, False])
def test_kn_as_n_is_rejected_with_or_without_a_preload(factor: float, told: bool) -> None:
    recording = force(lambda _t, x: factor * x)
    found = hold([recording if told else replace(recording, conditions={})])
    assert found.verdict == "rejected"
    assert said(found, "kN taken as N")
    assert "Not told: the force of this run is not to be used" in captions(found)["time"]
    assert not told or "Not told. No blank test" in captions(found)["pull"]
    assert found.one("force_initial").value is None
    assert found.one("flux_slope").value is not None


@pytest.mark.parametrize(("factor", "words"), [(1e3, "mT taken as T"), (1e-3, "T taken as mT")])
def test_mt_as_t_costs_the_field_only(factor: float, words: str) -> None:
    found = hold([changed(log(), "flux_density", lambda _t, x: factor * x)])
    assert found.verdict == "rejected"
    assert said(found, words)
    assert found.one("flux_saturation").value is None
    assert found.one("force_gain").value == pytest.approx(0.65, abs=5e-3)


@pytest.mark.parametrize(
    ("channel", "change", "words"),
    [
        ("force_axial", lambda _t, x: -x, "sign: -1"),
        ("current", lambda _t, x: 1e3 * x, "mA taken as A"),
        ("current", lambda _t, x: 1e-3 * x, "A taken as mA"),
        ("current", lambda _t, x: 0 * x + 6, "nothing is swept"),
        ("current", lambda _t, x: np.full(x.size, np.nan), "only has 0 samples"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words(channel: str, change: object, words: str) -> None:
    recording = changed(log(), channel, change)
    words = words.replace("only has 0 samples", "only 0 samples")
    with pytest.raises(InputError, match=words):
        hold([recording])
    with pytest.raises(InputError, match=words):
        HOLD.check(recording)


def test_signs_of_current_and_probe_are_named() -> None:
    assert said(hold([changed(log(), "current", lambda _t, x: -x)]), "current is negative")
    turned = hold([changed(log(), "flux_density", lambda _t, x: -x)])
    assert said(turned, "probe turned round")
    assert said(hold([log(force_gain=-0.3)]), "force falls as the current rises")


def test_a_clipped_force_costs_its_holds_and_the_limit() -> None:
    found = hold([force(lambda _t, x: np.minimum(x, 300.0))])
    assert said(found, "clipped at 300")
    assert found.one("saturation_current").value is None, "the flat top of a clipped force is no saturation"


@pytest.mark.parametrize("channel", ["force_axial", "current"])
def test_a_channel_that_freezes_costs_its_holds(channel: str) -> None:
    found = hold([changed(log(), channel, lambda t, x: np.where(t > 200, x[2000], x))])
    assert said(found, "stuck" if channel == "force_axial" else "frozen")
    assert found.one("force_increment", coil_current=6.0).value == pytest.approx(0.627, abs=0.01)


def test_a_dead_force_leaves_the_field() -> None:
    found = hold([force(lambda _t, x: 0 * x + 5)])
    assert said(found, "force_axial is dead")
    assert found.one("force_initial").value is None
    assert found.one("flux_slope").value == pytest.approx(0.158, rel=0.01)


def test_outliers_and_gaps_do_not_move_the_numbers() -> None:
    rng = np.random.default_rng(0)
    spiked = hold([force(lambda _t, x: np.where(rng.random(x.size) < 0.01, x + 200, x))])
    gapped = hold([force(lambda t, x: np.where((t > 50) & (t < 75), np.nan, x))])
    for found in (spiked, gapped):
        assert found.one("force_gain").value == pytest.approx(0.65, abs=4e-3)
        assert found.one("relaxation").value == pytest.approx(0.02, abs=1.5e-3)


def test_one_knocked_hold_is_left_out_by_name() -> None:
    found = hold([force(lambda t, x: np.where((t > 100) & (t < 110), x + 8, x))])
    assert said(found, "left out", "5.00 A")
    assert found.one("force_gain").value == pytest.approx(0.65, abs=4e-3)


def test_drift_and_jumps_of_the_sensor_are_doubted() -> None:
    assert said(hold([force(lambda t, x: x + 5 * t / 330)]), "drifts by")
    assert said(hold([force(lambda t, x: np.where(t > 200, x + 4, x))]), "beside relaxation")
    assert said(hold([log(relaxation=-0.02)]), "grows with time")


@pytest.mark.thorough
def test_short_holds_and_a_force_that_has_not_settled_are_doubted() -> None:
    assert said(hold([log(hold_duration=2.0)]), "too short")
    assert said(hold([log(hold_duration=10.0, fall=3.0, rise=3.0)]), "has not settled")


def test_no_level_at_0_is_doubted() -> None:
    found = hold([log(smallest_current=1.0)])
    assert said(found, "no hold is at 0 A")
    assert found.one("force_initial").value == pytest.approx(200, rel=3e-3)


def test_a_set_point_in_place_of_the_current_is_doubted() -> None:
    assert said(hold([changed(log(), "current", lambda _t, x: np.round(2 * x) / 2)]), "set-point")


@pytest.mark.thorough
def test_a_gap_that_moves_and_a_hot_coil_are_doubted() -> None:
    moving = changed(log(), "displacement_axial", lambda t, x: x - 1e-5 * np.round(3 * np.sin(np.pi * t / 330)))
    assert said(hold([moving]), "gap moves by 30 um")
    assert said(hold([log(heating=40.0)]), "coil resistance", "warmer")
    found = hold([log()])
    assert any("coil resistance 6.9" in q.message or "coil resistance 6.8" in q.message for q in found.quality)


def test_pole_pull_that_is_not_subtracted_does_not_pass_as_good() -> None:
    found = hold([without(log(pull=150.0), "flux_density")])
    assert found.verdict == "warning"


def test_ramps_between_the_holds_and_continuous_sweeps() -> None:
    ramped = hold([log(ramp=5.0)])
    assert ramped.one("force_gain").value == pytest.approx(0.65, abs=6e-3)
    swept = hold([log(hold_duration=0.5, current_step=0.025, rise=0.0, fall=0.0)])
    assert said(swept, "swept and not held")
    assert swept.one("force_increment", coil_current=6.0).value == pytest.approx(0.627, abs=0.01)


@pytest.mark.parametrize("end", [120.0, 60.0, 15.0, 3.0])
@pytest.mark.thorough
def test_a_truncated_log_is_refused_or_doubted(end: float) -> None:
    recording = log()
    cut = rows(recording, recording.streams["axial"].time < end)
    if end < 20:
        with pytest.raises(InputError, match=r"hold|sweep|step"):
            hold([cut])
        return
    found = hold([cut])
    assert found.verdict == "warning"
    assert found.one("force_gain").value is None


def test_large_noise_widens_and_does_not_mislead() -> None:
    found = hold([log(force_noise=20.0)])
    for name, truth in (("force_initial", 200.0), ("relaxation", 0.02)):
        p = found.one(name)
        if p.value is not None:
            assert abs(p.value - truth) < 4 * (p.std_error or 0)


def test_a_log_of_another_test_is_sent_there() -> None:
    step_log = replace(log(), conditions={"test": "step"})
    with pytest.raises(InputError, match=r"mre\.step"):
        hold([step_log])
    found = hold([log(), replace(step_log, run="other")])
    assert said(found, "other", "mre.step")


@pytest.mark.parametrize("rate", [1.0, 100.0])
def test_other_rates_and_levels(rate: float) -> None:
    found = hold([log(rate=rate, current_step=0.7, hold_duration=9.0, largest_current=9.1)])
    assert found.one("force_gain").value == pytest.approx(0.65, abs=0.01)
    assert found.find("force_increment", coil_current=0.7)
