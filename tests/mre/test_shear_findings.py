"""What `mre.shear` finds on the synthetic rig: names and operating points of the sheet, truth, evidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.findings.figures import Figure, Table
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.synthetic import synthesize_shear

TRUTH = {"k1": 6e4, "s1": 1200, "tau": 0.02, "k2": 2.6e5, "alpha_bw": 40, "rho": 4000, "c_bw": 0.8, "n_bw": 1.4}
FIELD = {2.0: (7.55e4, 120.0), 4.0: (1.51e5, 240.0), 6.0: (2.265e5, 360.0)}


def identified(recordings: Sequence[Recording], **settings: object) -> Findings:
    return SHEAR.identify(recordings, ShearSettings(**settings), Context("test", {}))


@pytest.fixture(scope="module")
def campaign() -> list[Recording]:
    return synthesize_shear({}, 7)


@pytest.fixture(scope="module")
def findings(campaign: list[Recording]) -> Findings:
    return identified(campaign)


def test_the_truth_of_the_campaign_is_recovered_to_the_accuracy_of_the_sheet(findings: Findings) -> None:
    allowed = {
        "k1": 5e-3,
        "k2": 5e-3,
        "s1": 2e-2,
        "tau": 2e-2,
        "alpha_bw": 1e-2,
        "rho": 1e-2,
        "c_bw": 1e-2,
        "n_bw": 1e-2,
    }
    for name, value in TRUTH.items():
        assert findings.one(name).value == pytest.approx(value, rel=allowed[name]), name
    for current, (k_mr, s_mr) in FIELD.items():
        assert findings.one("k_mr", coil_current=current).value == pytest.approx(k_mr, rel=5e-3)
        assert findings.one("s_mr", coil_current=current).value == pytest.approx(s_mr, rel=2e-2)
    assert findings.one("force_lag").value == pytest.approx(60e-6, abs=5e-6)
    assert findings.verdict == "ok"


def test_every_name_is_declared_and_field_terms_are_absent_at_zero_current(findings: Findings) -> None:
    declared = {spec.name: spec.unit for spec in SHEAR.parameters}
    assert all(declared[p.name] == p.unit for p in findings.parameters)
    assert {p.at["coil_current"] for p in findings.find("k_mr")} == {2.0, 4.0, 6.0}
    assert not findings.find("k1_plus_k2"), "sums are told only where their members are open"


def test_loop_metrics_of_each_run_carry_its_operating_point(campaign: list[Recording], findings: Findings) -> None:
    for name in ("stiffness_secant", "stiffness_storage", "damping", "loss_factor", "shear_modulus_storage"):
        assert len(findings.find(name)) == len(campaign)
    for recording in campaign:
        metric = findings.one("stiffness_storage", run=recording.run)
        assert set(metric.at) == {"run", "coil_current", "frequency", "amplitude", "preload"}
        assert metric.at["frequency"] == pytest.approx(recording.condition("frequency"), rel=2e-3)
        if recording.condition("coil_current") == 0:
            assert metric.at["coil_current"] == 0.0, "0 is said where the interval of the measured current holds 0"
        modulus = findings.one("shear_modulus_storage", run=recording.run)
        assert modulus.value == pytest.approx(metric.value * 0.006 / (2 * np.pi * 0.025**2), rel=1e-9)


def test_the_mr_effect_is_told_at_equal_force_and_at_equal_amplitude(findings: Findings) -> None:
    for preload, force, amplitude in ((200.0, 0.820, 0.687), (700.0, 0.401, 0.352)):
        at = {"coil_current": 6.0, "preload": preload}
        assert findings.one("mr_effect_force", **at).value == pytest.approx(force, abs=5e-3)
        assert findings.one("mr_effect_amplitude", **at).value == pytest.approx(amplitude, abs=5e-3)
    row = next(row for row in findings.published if row.name == "stiffness at 200 N preload, 6 A")
    assert row.agrees
    assert row.found == pytest.approx(599.7e3, rel=2e-3)


@pytest.mark.thorough
def test_the_variant_of_the_truth_wins_by_bic() -> None:
    changing = {"alpha_mr": {2.0: 10.0, 4.0: 20.0, 6.0: 30.0}, "s_mr": {2.0: 0.0, 4.0: 0.0, 6.0: 0.0}}
    found = identified(synthesize_shear({**changing, "preload_runs": False}, 3))
    chosen = next(model for model in found.models if model.selected)
    assert chosen.name == "ka"
    assert [
        p.value for p in sorted(found.find("alpha_bw"), key=lambda p: float(p.at["coil_current"]))
    ] == pytest.approx([40, 50, 60, 70], rel=1e-2)


def test_evidence_can_be_drawn_from_what_is_kept(findings: Findings) -> None:
    chapters = SHEAR.sections(findings)
    figures = {block.name for chapter in chapters for block in chapter.blocks if isinstance(block, Figure)}
    assert {"loops", "loop_residuals", "metrics_frequency", "field", "correlation", "residual_harmonics"} <= figures
    tables = {block.name for chapter in chapters for block in chapter.blocks if isinstance(block, Table)}
    assert {"metrics", "preload", "fit_by_run"} <= tables
    for chapter in chapters:
        for block in chapter.blocks:
            if isinstance(block, Figure):
                assert block.caption
                assert block.alt
                assert "?" in block.caption, "a caption states the question that the figure answers"


def test_methods_name_what_was_done_with_the_settings_used(findings: Findings) -> None:
    text = " ".join(SHEAR.methods(findings.model_copy(update={"settings": ShearSettings().model_dump()})))
    for word in ("16 runs", "50 Hz", "variable projection", "BIC", "Variant 'ks'", "95 %"):
        assert word in text


def test_a_device_without_pads_or_current_is_one_group_at_an_unnamed_point(campaign: list[Recording]) -> None:
    bare = []
    for recording in campaign:
        if recording.conditions["coil_current"] == 0 and recording.conditions["test"] == "shear":
            stream = next(iter(recording.streams.values()))
            channels = {name: stream.channels[name] for name in ("displacement", "force")}
            bare.append(Recording(recording.run, {"": Stream("", stream.time, channels)}))
    found = identified(bare)
    assert not found.find("k_mr")
    assert not found.find("shear_modulus_storage")
    assert found.published == []
    assert found.one("k2").value == pytest.approx(2.6e5, rel=2e-2)
    assert "coil_current" not in found.find("damping")[0].at


def ramp(seed: int = 0) -> Recording:
    rng = np.random.default_rng(seed)
    time = np.arange(0, 20, 0.02)
    x = 0.01 * np.minimum(time, 20 - time) / 10
    force = 50 * x / 0.01 + np.where(time <= 10, 2.0, -2.0) * (x / 0.01) + rng.normal(0, 0.01, time.size)
    channels = {"displacement": Channel("displacement", x, "m"), "force": Channel("force", force, "N")}
    return Recording("ramp", {"": Stream("", time, channels)})


def test_a_half_cycle_gives_stiffness_and_loss_and_says_that_it_is_half_a_cycle() -> None:
    found = identified([ramp()])
    assert found.verdict == "warning"
    assert found.one("stiffness_secant").value == pytest.approx(5200, rel=5e-3)
    assert found.one("loss_work").value == pytest.approx(0.02, rel=2e-2)
    assert not found.find("damping")
    assert any("one half cycle only" in q.message for q in found.quality)


def test_a_record_without_a_period_is_checked_on_its_second_half() -> None:
    from pipeline.rigs.mre.synthetic import synthesize_rich

    found = identified([synthesize_rich({}, 5, duration=20.0)])
    assert found.one("k2").value == pytest.approx(2.6e5, rel=1e-2)
    assert any("predicts the second half" in reason for reason in found.reasons)
    [model] = [model for model in found.models if model.selected]
    assert model.cv_error is not None
    assert model.cv_error < 0.05
    assert next(section.name for section in SHEAR.sections(found)) == "records"


def test_nothing_usable_is_an_input_error_that_names_each_run() -> None:
    time = np.arange(0, 5, 0.001)
    still = {
        "displacement": Channel("displacement", np.zeros(time.size), "m"),
        "force": Channel("force", np.sin(time), "N"),
    }
    with pytest.raises(InputError, match=r"still_run.*the channel displacement is dead"):
        identified([Recording("still_run", {"": Stream("", time, still)})])


def test_without_a_run_at_zero_current_the_static_stiffness_is_told_at_each_current() -> None:
    found = identified(synthesize_shear({"currents": (2.0, 4.0), "preload_runs": False, "duration": 2.0}, 4))
    for current, k_mr in ((2.0, 7.55e4), (4.0, 1.51e5)):
        parameter = found.one("k2", coil_current=current)
        assert parameter.value == pytest.approx(2.6e5 + k_mr, rel=5e-3)
        assert "no run at 0 A" in parameter.description
    assert [p.value for p in found.find("k_mr")] == [None]


def test_runs_that_cannot_tell_the_variants_apart_say_so_and_hide_no_uncertainty() -> None:
    runs = synthesize_shear({"preload_runs": False}, 1)
    found = identified([r for r in runs if r.run in ("sh_5hz_2a", "sh_10hz_4a")])
    assert found.verdict == "warning"
    assert any("do not tell what the field changes" in reason for reason in found.reasons)
    for name, truth in (("k1", 6e4), ("tau", 0.02), ("s1", 1200.0)):
        parameter = found.one(name)
        if parameter.value is not None:
            assert abs(parameter.value - truth) < 4 * parameter.std_error
