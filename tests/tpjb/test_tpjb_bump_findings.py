"""Bump campaigns with known truth: what is recovered, what is said of faults, what is left undetermined."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from unstated_gains import unstated

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Channel, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb.bump.contact import centred
from pipeline.rigs.tpjb.bump.declaration import BUMP, BumpSettings
from pipeline.rigs.tpjb.bump.synthetic import bump_truth, planes_of, synthesize

Change = Callable[[Recording], Recording]


def with_channels(recording: Recording, **changed: np.ndarray | None) -> Recording:
    stream = recording.streams["hf"]
    channels = dict(stream.channels)
    for name, values in changed.items():
        if values is None:
            del channels[name]
        else:
            channels[name] = Channel(name, values, channels[name].unit)
    return replace(recording, streams={"hf": replace(stream, channels=channels)})


def with_conditions(recording: Recording, **changed: float | str | None) -> Recording:
    conditions = {**recording.conditions, **changed}
    return replace(recording, conditions={k: v for k, v in conditions.items() if v is not None})


def scaled(recording: Recording, prefix: str, factor: float) -> Recording:
    return with_channels(recording, **{c.name: c.values * factor for c in recording if c.name.startswith(prefix)})


def identified(truth: Mapping[str, Any] | None = None, change: Change | None = None, **settings: Any) -> Findings:
    recordings = unstated(synthesize(truth or {}, 3))
    recordings = [change(r) for r in recordings] if change else recordings
    return BUMP.identify(recordings, BumpSettings(**settings), Context("bump", {}))


def mean_clearance(found: Findings, plane: float = 1.0) -> float | None:
    return next(p.value for p in found.parameters if p.name == "clearance" and p.at == {"plane": plane})


def true_values(truth: Mapping[str, Any]) -> dict[tuple[str, float, float], float]:
    """Return the truth by name, plane and side (0 for none), normalised as the findings are."""
    known = bump_truth(truth)
    values = {("contact_stiffness", 0.0, 0.0): known.contact_stiffness}
    values["support_stiffness", 0.0, 0.0] = known.support_stiffness
    centres = {}
    for plane, bearing in planes_of(known).items():
        centre, clearances = centred(bearing.sides, bearing.normals)
        centres[plane] = centre
        values["center_x", plane, 0.0], values["center_y", plane, 0.0] = centre
        values["clearance", plane, 0.0] = float(clearances.mean())
        values["rotation", plane, 0.0] = known.rotation
        values.update({("clearance", plane, float(i + 1)): float(c) for i, c in enumerate(clearances)})
    tilt = (centres[2] - centres[1]) / (known.z2 - known.z1)
    values["tilt_x", 0.0, 0.0], values["tilt_y", 0.0, 0.0] = tilt
    return values


@pytest.fixture(scope="module")
def four() -> Findings:
    return identified()


@pytest.mark.parametrize("bearing", ["4pad", "5pad"])
def test_the_example_campaigns_give_their_truth_to_the_accuracy_asked(bearing: str, four: Findings) -> None:
    """Section 6: centre 0.006 um, clearance 0.01 um, k_p 0.2 %, k_s 1 %, tilt 0.02 urad."""
    found = four if bearing == "4pad" else identified({"bearing": bearing})
    assert found.verdict == "ok"
    limits = {"center_x": 6e-9, "center_y": 6e-9, "clearance": 1e-8, "tilt_x": 2e-8, "tilt_y": 2e-8, "rotation": 2e-5}
    for (name, plane, side), true in true_values({"bearing": bearing}).items():
        at = {key: value for key, value in (("plane", plane), ("side", side)) if value}
        parameter = next(p for p in found.parameters if p.name == name and p.at == at)
        assert parameter.value is not None
        assert parameter.std_error is not None
        limit = limits.get(name) or true * {"contact_stiffness": 2e-3, "support_stiffness": 1e-2}[name]
        assert abs(parameter.value - true) < limit, parameter
        assert abs(parameter.value - true) < 4.5 * parameter.std_error, parameter


def test_normalising_moves_the_centre_of_unequal_pads_as_the_sheet_says() -> None:
    truth = {"bearing": "5pad"}
    moved = true_values(truth)["center_x", 1, 0.0] - 12e-6, true_values(truth)["center_y", 1, 0.0] + 7e-6
    np.testing.assert_allclose(moved, [-0.69e-6, -1.72e-6], atol=0.01e-6)


def test_a_force_that_turns_clockwise_over_three_levels_with_other_noise_is_understood() -> None:
    truth = {
        "levels": [3e3, 9e3, 15e3],
        "rotation_frequency": -0.05,
        "rate": 200.0,
        "probe_noise": 5e-7,
        "force_noise": 100.0,
    }
    found = identified(truth)
    assert found.verdict == "ok"
    assert found.one("center_x", plane=1.0).value == pytest.approx(12e-6, abs=0.02e-6)
    assert sorted(found.arrays["levels"]["force"].unique()) == pytest.approx([3e3, 9e3, 15e3], rel=0.01)


def test_soft_contacts_far_from_the_first_guess_are_found() -> None:
    found = identified({"contact_stiffness": 2e8, "support_stiffness": 4e6})
    assert any("not converged" in reason for reason in found.reasons)
    assert found.one("contact_stiffness").value == pytest.approx(2e8, rel=0.002)
    assert mean_clearance(found) == pytest.approx(201e-6, abs=0.02e-6)


@pytest.mark.parametrize("n_pads", [3, 6])
def test_another_number_of_pads_is_found_where_none_is_stated(n_pads: int) -> None:
    truth = {"n_pads": n_pads, "clearances": [150e-6] * n_pads}
    found = identified(truth, lambda r: with_conditions(r, n_pads=None, pad_angles=None, clearance_nominal=None))
    assert found.verdict == "ok"
    assert found.one("clearance", plane=2.0, side=float(n_pads)).value == pytest.approx(150e-6, abs=0.02e-6)


def test_pad_angles_for_the_other_load_direction_are_doubted() -> None:
    found = identified(change=lambda r: with_conditions(r, pad_angles="0 90 180 270 deg"))
    assert found.verdict == "warning"
    assert any("turned by -44" in reason for reason in found.reasons)


def test_one_plane_gives_everything_but_the_tilt() -> None:
    found = identified({"planes": "1"})
    assert found.one("center_y", plane=1.0).value == pytest.approx(-7e-6, abs=0.01e-6)
    assert found.one("tilt_x").value is None
    assert "one plane only" in found.one("tilt_x").description


def test_one_force_level_is_a_doubt() -> None:
    found = identified({"levels": [8e3]})
    assert found.verdict == "warning"
    assert any("one force level only" in reason for reason in found.reasons)
    assert "one force level" in found.one("contact_stiffness").description


def test_three_quarters_of_a_turn_are_enough_where_every_side_is_met() -> None:
    found = identified({"arc": 0.75})
    assert found.one("center_x", plane=1.0).value == pytest.approx(12e-6, abs=0.01e-6)
    assert any("of the directions only" in q.message for q in found.quality)


@pytest.mark.thorough  # the table of bad data has it for four pads
@pytest.mark.parametrize("bearing", ["5pad"])
def test_a_side_that_is_never_touched_leaves_its_part_undetermined(bearing: str) -> None:
    found = identified({"bearing": bearing, "missing_side": 2})
    assert found.verdict == "warning"
    assert any("Side 2" in reason and "never touched" in reason for reason in found.reasons)
    assert found.one("center_x", plane=1.0).value is None
    assert found.one("clearance", plane=1.0, side=2.0).value is None
    assert found.one("contact_stiffness").value == pytest.approx(1.5e9, rel=0.002)


def test_an_unbalanced_weight_is_told_and_fitted_along() -> None:
    def weight(recording: Recording) -> Recording:
        pull = 1500.0 / np.sqrt(2)  # 1.5 kN along +y, as u and v see it, missing in the measured force
        return with_channels(
            recording, force_u=recording.values("force_u") - pull, force_v=recording.values("force_v") - pull
        )

    found = identified({"levels": [4e3, 8e3, 12e3]}, weight)
    assert any("constant force of 1.5e+03 N towards 90 deg" in reason for reason in found.reasons)
    assert found.one("center_x", plane=1.0).value == pytest.approx(12e-6, abs=0.02e-6)


@pytest.mark.parametrize("friction", [0.02, 0.1])
def test_friction_is_told_and_hardly_moves_the_clearance(friction: float) -> None:
    found = identified({"friction": friction})
    assert any("as with friction" in reason for reason in found.reasons)
    assert found.one("support_stiffness").value is None
    assert mean_clearance(found) == pytest.approx(201e-6, abs=0.1e-6)  # section 6, acceptance


def test_an_inverted_probe_is_named_and_its_zero_not_made_up() -> None:
    found = identified(change=lambda r: with_channels(r, gap_up1=2e-3 - r.values("gap_up1")))
    assert found.verdict == "warning"
    assert any(q.channel == "gap_up1" and "inverted" in q.message for q in found.quality)
    assert found.one("center_x", plane=1.0).value is None
    assert found.one("center_x", plane=2.0).value == pytest.approx(18e-6, abs=0.01e-6)
    assert mean_clearance(found) == pytest.approx(201e-6, abs=0.01e-6)
    assert found.one("tilt_x").value is None


def _clipped(recording: Recording) -> Recording:
    return with_channels(recording, gap_up1=np.minimum(recording.values("gap_up1"), 1.19e-3))


def _spiky(recording: Recording) -> Recording:
    values = recording.values("gap_vp1").copy()
    values[::997] += 5e-4
    return with_channels(recording, gap_vp1=values)


@pytest.mark.parametrize(
    ("change", "channel"),
    [(_clipped, "gap_up1"), (_spiky, "gap_vp1")],
)
def test_sensors_that_hang_clip_or_spike_are_named_and_do_not_bias(change: Change, channel: str) -> None:
    found = identified(change=change)
    assert found.verdict == "warning"
    assert any(q.channel == channel and q.span is not None for q in found.quality)
    assert found.one("center_x", plane=1.0).value == pytest.approx(12e-6, abs=0.01e-6)
    assert found.one("contact_stiffness").value == pytest.approx(1.5e9, rel=0.002)


@pytest.mark.parametrize(
    ("prefix", "factor", "word"),
    [("gap", 1e3, "gap channels")],
)
def test_a_wrong_unit_is_rejected_without_numbers(prefix: str, factor: float, word: str) -> None:
    found = identified(change=lambda r: scaled(r, prefix, factor))
    assert found.verdict == "rejected"
    assert len(found.reasons) == 1
    assert word in found.reasons[0]
    assert all(p.value is None for p in found.parameters)


def _against(recording: Recording) -> Recording:
    return scaled(recording, "force_u", -1.0)


@pytest.mark.parametrize(
    ("truth", "change", "message"),
    [
        ({}, _against, "along u goes against the force"),
        ({"rotation_frequency": 0.0, "levels": [2e3]}, None, "does not turn"),
        ({"levels": [50.0, 150.0]}, lambda r: with_conditions(r, n_pads=None, pad_angles=None), "no polygon"),
        ({"levels": [100.0]}, None, "force may be too small"),
        ({}, lambda r: with_channels(r, **dict.fromkeys(("gap_up1", "gap_um1", "gap_up2", "gap_um2"))), "along u"),
    ],
)
def test_what_cannot_be_used_is_refused_in_plain_words(
    truth: Mapping[str, Any], change: Change | None, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        identified(truth, change)


def test_a_static_log_beside_a_good_one_is_left_out_with_its_reason(four: Findings) -> None:
    static = replace(synthesize({"rotation_frequency": 0.0, "levels": [2e3]}, 1)[0], run="static")
    found = BUMP.identify([*synthesize({}, 3), static], BumpSettings(), Context("bump", {}))
    assert [(run.run, run.used) for run in found.runs] == [("bump_4pad", True), ("static", False)]
    assert "does not turn" in found.runs[1].reason
    assert found.one("center_x", plane=1.0).value == four.one("center_x", plane=1.0).value


def test_a_log_for_each_force_is_the_same_as_one_log_for_all(four: Findings) -> None:
    whole = synthesize({}, 3)[0]
    stream, parts = whole.streams["hf"], []
    for k in range(4):
        span = slice(5000 * k, 5000 * (k + 1))
        channels = {n: replace(c, values=c.values[span]) for n, c in stream.channels.items()}
        time = stream.time[span] - stream.time[span.start]
        parts.append(replace(whole, run=f"level_{k}", streams={"hf": replace(stream, time=time, channels=channels)}))
    found = BUMP.identify(parts, BumpSettings(), Context("bump", {}))
    assert found.verdict == "ok"
    assert mean_clearance(found) == pytest.approx(mean_clearance(four), abs=2e-9)


def test_two_bearings_of_a_campaign_are_told_apart() -> None:
    found = BUMP.identify(
        [*synthesize({}, 1), *synthesize({"bearing": "5pad"}, 1)], BumpSettings(), Context("bump", {})
    )
    assert found.one("clearance", bearing="5pad", plane=1.0, side=5.0).value is not None
    assert len(found.find("contact_stiffness")) == 2


def test_a_pause_of_the_force_is_no_stuck_sensor() -> None:
    def paused(recording: Recording) -> Recording:
        force = {}
        for name in ("force_u", "force_v"):
            force[name] = np.round(recording.values(name) / 50.0) * 50.0
            force[name][:1500] = 0.0
        return with_channels(recording, **force)

    found = identified(change=paused)
    assert found.verdict == "ok"
    assert found.one("center_x", plane=1.0).value == pytest.approx(12e-6, abs=0.01e-6)


def test_tilt_beyond_the_limit_is_a_warning() -> None:
    found = identified(alignment_limit=20e-6)
    assert found.verdict == "warning"
    assert any("pitch stabilisers" in advice for advice in found.advice)


def test_names_are_those_declared_and_one_model_is_selected(four: Findings) -> None:
    assert {p.name for p in four.parameters} == {spec.name for spec in BUMP.parameters}
    assert sum(model.selected for model in four.models) == 1


@pytest.mark.parametrize(
    ("truth", "answers"),
    [
        ({}, ["Yes: every side was touched. Mean clearance 0.2010", "Yes: it grows by 0.66 um/kN", "within the limit"]),
        ({"missing_side": 2}, ["No: never at side 2 in plane 1, 2 in plane 2.", "It cannot be told"]),
        ({"planes": "2"}, ["Yes: every side was touched", "It cannot be told"]),
        ({"levels": [8e3]}, ["There is one force only", "Only one force was applied."]),
    ],
)
def test_report_sections_and_methods_are_written_from_the_findings(
    truth: Mapping[str, Any], answers: list[str]
) -> None:
    found = identified(truth)
    told = " ".join(getattr(block, "caption", "") for section in BUMP.sections(found) for block in section.blocks)
    assert [answer for answer in answers if answer not in told] == []
    names = [section.name for section in BUMP.sections(found)]
    assert names[:3] == ["clearance", "growth", "alignment"]
    figures = [block for section in BUMP.sections(found) for block in section.blocks if hasattr(block, "panels")]
    assert figures[0].panels[0].equal
    text = " ".join(BUMP.methods(found))
    assert "support function" in text


def test_unknown_truth_names_the_nearest() -> None:
    with pytest.raises(InputError, match="Did you mean 'friction'"):
        synthesize({"frction": 0.1}, 1)
    with pytest.raises(InputError, match="clearances"):
        synthesize({"n_pads": 6}, 1)


def test_check_says_what_would_make_a_log_useless() -> None:
    assert BUMP.check(synthesize({}, 1)[0]) == ()
    with pytest.raises(InputError, match="goes against the force"):
        BUMP.check(_against(synthesize({}, 1)[0]))


def test_check_says_that_the_orbit_has_other_pads_than_stated() -> None:
    log = synthesize({}, 1)[0]
    five = replace(log, conditions={**log.conditions, "n_pads": 5.0, "pad_angles": ""})
    assert any("n_pads is 5 but the orbit has 4 sides" in finding.message for finding in BUMP.check(five))
