"""Type B: what a recipe says of gains and offsets reaches every parameter as it should."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from toy_spring import SPRING, SpringSettings, synthesize

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording.altered import altered
from pipeline.rigs import registry
from pipeline.rigs.calibration import Calibration, identify_calibrated
from pipeline.rigs.calibration_effects import BUDGET
from pipeline.rigs.experiment import Context

CONTEXT = Context("pulls", {})


def calibrated(seed: int = 1, recordings=None, **calibration: Calibration) -> Findings:
    logs = synthesize({}, seed) if recordings is None else recordings
    return identify_calibrated(SPRING, logs, SpringSettings(), CONTEXT, calibration)


def test_nothing_stated_changes_nothing() -> None:
    plain = SPRING.identify(synthesize({}, 1), SpringSettings(), CONTEXT)
    assert calibrated().parameters == plain.parameters
    assert calibrated(force=Calibration()).parameters == plain.parameters


def test_a_gain_of_the_force_scales_the_stiffness() -> None:
    plain, found = calibrated().parameters[0], calibrated(force=Calibration(gain_u=0.01)).parameters[0]
    assert found.value == plain.value
    assert found.type_b == pytest.approx(0.01 * plain.value, rel=1e-9)
    assert found.std_error == pytest.approx(math.hypot(plain.std_error, found.type_b))
    half = 1.959964 * found.std_error
    assert found.ci95 == pytest.approx((plain.value - half, plain.value + half), rel=1e-5)


def test_an_offset_that_the_model_has_costs_the_slope_nothing() -> None:
    plain, found = calibrated().parameters[0], calibrated(force=Calibration(offset_u=5.0)).parameters[0]
    assert found.type_b == pytest.approx(0.0, abs=1e-9)
    assert found.std_error == pytest.approx(plain.std_error)


def test_gains_of_two_channels_add_in_quadrature_and_stand_in_the_budget() -> None:
    found = calibrated(force=Calibration(gain_u=0.003), extension=Calibration(gain_u=0.004))
    first = found.parameters[0]
    assert first.type_b == pytest.approx(0.005 * first.value, rel=1e-3)
    budget = found.arrays[BUDGET].query(f"at == '{'run ' + str(first.at['run'])}'").set_index("channel")
    assert budget.effect["force"] == pytest.approx(0.003 * first.value)
    assert budget.effect["extension"] == pytest.approx(-0.004 * first.value, rel=1e-3)
    assert found.calibration["force"] == {"gain_u": 0.003, "offset_u": 0.0}


def test_a_strongly_curved_effect_gets_the_skewed_interval_of_a_full_monte_carlo() -> None:
    found = calibrated(extension=Calibration(gain_u=0.1)).parameters[0]
    z = np.random.default_rng(5).standard_normal(400_000)
    low, high = np.quantile(found.value / (1.0 + 0.1 * z), (0.025, 0.975))
    assert found.ci95 == pytest.approx((low, high), rel=0.01)
    assert found.ci95[1] - found.value > 1.2 * (found.value - found.ci95[0])


def test_intervals_hold_the_truth_when_gains_are_off_by_what_was_stated() -> None:
    rng, held, campaigns = np.random.default_rng(3), 0, 400
    for seed in range(campaigns):
        force, extension = 1.0 + 0.01 * rng.standard_normal(2)
        logs = [
            altered(r, {"force": lambda v, g=force: v * g, "extension": lambda v, g=extension: v * g})
            for r in synthesize({}, seed)
        ]
        told = calibrated(recordings=logs, force=Calibration(0.01), extension=Calibration(0.01)).parameters[0]
        held += told.ci95[0] <= 200.0 <= told.ci95[1]
    assert abs(held / campaigns - 0.95) < 3 * math.sqrt(0.95 * 0.05 / campaigns)


def test_advice_names_the_calibration_that_rules() -> None:
    assert any("gain of 'force'" in text for text in calibrated(force=Calibration(gain_u=0.05)).advice)
    assert not calibrated(force=Calibration(gain_u=1e-6)).advice


def test_what_stands_on_one_exact_calibration_is_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    limit = float(np.abs(synthesize({}, 1)[0].values("extension")).max())

    def picky(recordings, settings, context) -> Findings:
        if any(abs(np.abs(r.values("extension")).max() - limit) > 1e-9 for r in recordings):
            raise InputError("not this stroke")
        return SPRING.identify(recordings, settings, context)

    experiment = replace(SPRING, identify=picky)
    monkeypatch.setattr(registry, "experiment", lambda _id: experiment)
    found = identify_calibrated(
        experiment, synthesize({}, 1), SpringSettings(), CONTEXT, {"extension": Calibration(gain_u=0.01)}
    )
    assert found.parameters[0].value is None
    assert "gain of 'extension'" in found.parameters[0].description
    assert found.verdict == "warning"
    assert "stiffness" in found.reasons[0]


def test_altered_channels_leave_the_others_and_the_blocks_alike() -> None:
    recording = synthesize({}, 1)[0]
    doubled = altered(recording, {"force": lambda values: 2.0 * values})
    assert np.array_equal(doubled.values("force"), 2.0 * recording.values("force"))
    assert np.array_equal(doubled.values("extension"), recording.values("extension"))
    time, (force,) = next(iter(doubled.stream_of("force").blocks(["force"])))
    assert np.array_equal(force, doubled.values("force"))
    assert np.array_equal(time, recording.signal("force")[0])


def test_an_operating_point_that_is_measured_is_told_where_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """Force over measured extension, told at rounded extensions: a gain of the extension moves the points."""

    def at_points(recordings, settings, context) -> Findings:
        found = SPRING.identify(recordings, settings, context)
        gain = float(np.abs(recordings[0].values("extension")).max()) / 0.02
        told = found.parameters[0]
        points = [
            told.model_copy(
                update={"at": {"extension": x * gain}, "value": 200.0 * x, "std_error": 1e-6, "ci95": (0, 99)}
            )
            for x in (0.0, 0.004, 0.008, 0.012, 0.016)
        ]
        return found.model_copy(update={"parameters": points})

    experiment = replace(SPRING, identify=at_points)
    monkeypatch.setattr(registry, "experiment", lambda _id: experiment)
    found = identify_calibrated(
        experiment, synthesize({}, 1), SpringSettings(), CONTEXT, {"extension": Calibration(gain_u=0.01)}
    )
    assert [p.type_b for p in found.parameters] == pytest.approx(
        [0.01 * 200.0 * x for x in (0.0, 0.004, 0.008, 0.012, 0.016)], rel=0.02
    )
    assert all(p.value is not None for p in found.parameters)


def test_a_channel_that_no_log_carries_is_told_and_not_claimed() -> None:
    found = calibrated(temperature=Calibration(gain_u=0.01), force=Calibration(gain_u=0.01))
    assert list(found.calibration) == ["force"]
    assert any(q.channel == "temperature" and "no log carries it" in q.message for q in found.quality)
    assert any(q.channel == "temperature" for q in calibrated(temperature=Calibration(gain_u=0.01)).quality)


def test_a_calibration_of_findings_that_are_used_is_not_claimed_to_be_in_the_intervals() -> None:
    bench = calibrated(force=Calibration(gain_u=0.01))
    found = identify_calibrated(SPRING, synthesize({}, 1), SpringSettings(), Context("road", {"bench": bench}), {})
    assert any(q.level == "warning" and "not in those here" in q.message for q in found.quality)


def test_an_input_that_changes_no_number_is_said() -> None:
    found = calibrated(force=Calibration(offset_u=5.0))
    assert any(q.level == "warning" and "offset of 'force' changes no number" in q.message for q in found.quality)


def test_a_verdict_that_hangs_on_a_calibration_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    limit = float(np.abs(synthesize({}, 1)[0].values("force")).max())

    def strict(recordings, settings, context) -> Findings:
        found = SPRING.identify(recordings, settings, context)
        strong = np.abs(recordings[0].values("force")).max() > 1.001 * limit
        return found.model_copy(update={"verdict": "rejected", "reasons": ["Too strong."]}) if strong else found

    experiment = replace(SPRING, identify=strict)
    monkeypatch.setattr(registry, "experiment", lambda _id: experiment)
    found = identify_calibrated(
        experiment, synthesize({}, 1), SpringSettings(), CONTEXT, {"force": Calibration(gain_u=0.01)}
    )
    assert found.verdict == "warning"
    assert (
        "gain of 'force' one standard uncertainty higher the verdict would be 'rejected': Too strong."
        in found.reasons[0]
    )
