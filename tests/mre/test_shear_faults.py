"""Faults of section 8 of the sheet, injected into the synthetic rig: the message, and no wrong number as good."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from pipeline.findings import Findings
from pipeline.recording import Channel, Provenance, Recording, SourceFile
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.loop import fit_loop
from pipeline.rigs.mre.shear import SHEAR, ShearSettings
from pipeline.rigs.mre.shear_check import check
from pipeline.rigs.mre.synthetic import synthesize_shear

BASE = {"duration": 2.0, "preload_runs": False}


@pytest.fixture(scope="module")
def campaign() -> list[Recording]:
    return synthesize_shear(BASE, 11)


def identified(recordings: list[Recording], **settings: object) -> Findings:
    return SHEAR.identify(recordings, ShearSettings(**settings), Context("test", {}))  # type: ignore[arg-type]


def changed(recording: Recording, **change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    """Return a recording with some channels changed."""
    [(name, stream)] = recording.streams.items()
    channels: Mapping[str, Channel] = {
        c.name: replace(c, values=change[c.name](c.values.copy())) if c.name in change else c
        for c in stream.channels.values()
    }
    return replace(recording, streams={name: replace(stream, channels=channels)})


def with_fault(campaign: list[Recording], index: int, recording: Recording) -> list[Recording]:
    return [recording if i == index else other for i, other in enumerate(campaign)]


def messages(findings: Findings, run: str | None = None) -> str:
    return " | ".join(q.message for q in findings.quality if run is None or q.run == run)


def assert_true_values(findings: Findings) -> None:
    assert findings.one("k2").value == pytest.approx(2.6e5, rel=1e-2)
    assert findings.one("alpha_bw").value == pytest.approx(40, rel=2e-2)


LEFT_OUT: dict[str, tuple[dict[str, Callable[[np.ndarray], np.ndarray]], str]] = {
    "dead force": ({"force": lambda F: np.full_like(F, 3.0)}, "dead"),
    "dead displacement": ({"displacement": lambda x: np.zeros_like(x)}, "dead"),
    "only NaN": ({"force": lambda F: np.full_like(F, np.nan)}, "holds no number"),
    "stuck force": ({"force": lambda F: np.where(np.arange(F.size) > 0.6 * F.size, F[0], F)}, "stuck"),
    "clipped force": ({"force": lambda F: np.clip(F, -60.0, 60.0)}, "clipped"),
    "wrong sign of force": ({"force": lambda F: -F}, "sign"),
    "wrong sign of displacement": ({"displacement": lambda x: -x}, "sign"),
}


@pytest.mark.parametrize("fault", LEFT_OUT)
def test_a_run_that_is_unfit_is_left_out_named_and_changes_no_number(campaign: list[Recording], fault: str) -> None:
    change, word = LEFT_OUT[fault]
    found = identified(with_fault(campaign, 4, changed(campaign[4], **change)))
    run = campaign[4].run
    assert [r.run for r in found.runs if not r.used] == [run]
    assert word in messages(found, run)
    assert found.verdict == "warning"
    assert any(run in reason for reason in found.reasons)
    assert not found.find("damping", run=run)
    assert_true_values(found)


def test_swapped_channels_are_recognised_by_the_sense_of_the_loop(campaign: list[Recording]) -> None:
    recording = campaign[4]
    [(name, stream)] = recording.streams.items()
    x, F = stream.channels["displacement"], stream.channels["force"]
    channels = {
        **stream.channels,
        "displacement": replace(x, values=F.values * 1e-6),
        "force": replace(F, values=x.values * 1e6),
    }
    found = identified(with_fault(campaign, 4, replace(recording, streams={name: replace(stream, channels=channels)})))
    assert "swapped" in messages(found, recording.run)
    assert_true_values(found)


def test_the_gain_error_of_one_run_is_pinned_on_that_run(campaign: list[Recording]) -> None:
    found = identified(with_fault(campaign, 7, changed(campaign[7], force=lambda F: 1.03 * F)))
    assert found.verdict != "ok"
    assert "contradicts the other runs" in messages(found, campaign[7].run)
    others = [r.run for r in campaign if r.run != campaign[7].run]
    assert not any("contradicts" in messages(found, run) for run in others)


def test_a_wrong_current_label_is_said_and_the_channel_is_trusted(campaign: list[Recording]) -> None:
    wrong = replace(campaign[6], conditions={**campaign[6].conditions, "coil_current": 6.0})
    found = identified(with_fault(campaign, 6, wrong))
    assert "the label says 6.00 A; the measured one is used" in messages(found, wrong.run)
    assert_true_values(found)


def test_a_wrong_frequency_label_is_said(campaign: list[Recording]) -> None:
    wrong = replace(campaign[6], conditions={**campaign[6].conditions, "frequency": 12.0})
    found = identified(with_fault(campaign, 6, wrong))
    assert "the label says 12 Hz" in messages(found, wrong.run)


def test_a_force_that_is_one_sample_late_is_fitted_and_warned_of() -> None:
    found = identified(synthesize_shear({**BASE, "force_lag": 200e-6}, 2))
    assert found.one("force_lag").value == pytest.approx(200e-6, abs=6e-6)
    assert "late against the displacement" in messages(found)
    assert_true_values(found)


def accelerated(recording: Recording, mass: float) -> Recording:
    """Add the inertia of a mass (kg) to the force, late like the force itself."""
    [(_, stream)] = recording.streams.items()
    loop = fit_loop(recording.run, stream.time, recording.values("displacement"), recording.values("force"))
    angular = loop.omega * np.arange(1, loop.X.size + 1)
    turning = np.exp(1j * np.outer(stream.time - 60e-6, angular))
    inertia = mass * (turning @ (-(angular**2) * loop.X)).real
    return changed(recording, force=lambda F: F + inertia)


def test_an_untared_mass_is_found_and_reported() -> None:
    found = identified([accelerated(recording, 0.15) for recording in synthesize_shear(BASE, 5)])
    assert found.one("moving_mass").value == pytest.approx(0.15, abs=0.05)
    assert "untared mass" in messages(found)
    assert_true_values(found)


def test_mm_taken_as_m_is_warned_of_by_the_modulus(campaign: list[Recording]) -> None:
    wrong = changed(campaign[0], displacement=lambda x: 1000 * x)
    [finding] = check(wrong)
    assert finding.level == "warning"
    assert "1000" in finding.message
    assert check(campaign[0]) == []


def test_an_inverted_force_is_told_without_any_fit(campaign: list[Recording]) -> None:
    assert any("wrong sign" in finding.message for finding in check(changed(campaign[0], force=lambda F: -F)))


def test_the_same_file_twice_is_counted_once(campaign: list[Recording]) -> None:
    source = Provenance((SourceFile("a.csv", "0" * 64, 1, "csv 1"),))
    twins = [replace(campaign[0], provenance=source), replace(campaign[0], run="copy", provenance=source)]
    found = identified([*twins, *campaign[1:]])
    assert [r.run for r in found.runs if not r.used] == ["copy"]
    assert "same bytes" in messages(found, "copy")


def test_cycles_before_the_steady_state_do_not_enter(campaign: list[Recording]) -> None:
    def settling(F: np.ndarray) -> np.ndarray:
        return F * (1 + 0.2 * np.exp(-np.arange(F.size) / 700))

    found = identified(with_fault(campaign, 9, changed(campaign[9], force=settling)))
    assert "not settled" in messages(found, campaign[9].run)
    assert_true_values(found)


def test_harmonics_on_the_mains_are_left_out_and_said(campaign: list[Recording]) -> None:
    found = identified(campaign)
    assert "mains frequency" in messages(found)
    loud = identified(synthesize_shear({**BASE, "hum": 2.0}, 3))
    assert_true_values(loud)


def test_one_run_only_invents_no_model(campaign: list[Recording]) -> None:
    found = identified(campaign[:1])
    assert found.verdict == "warning"
    assert any("One run only" in reason for reason in found.reasons)
    assert found.find("stiffness_storage")[0].value is not None
    for name in ("k1", "k2", "tau"):
        parameter = found.one(name)
        if parameter.value is None:
            assert parameter.description
        else:
            truth = {"k1": 6e4, "k2": 2.6e5, "tau": 0.02}[name]
            assert parameter.ci95 is not None
            assert parameter.ci95[0] < truth < parameter.ci95[1]
    assert found.advice


def test_one_amplitude_at_one_frequency_gives_sums_and_advice() -> None:
    found = identified(synthesize_shear({**BASE, "frequencies": (15.0,), "amplitudes": (1e-4,), "campaign": "full"}, 3))
    assert found.verdict in ("warning", "rejected")
    assert any(p.value is None for p in found.parameters)
    assert any("frequency" in advice or "amplitude" in advice for advice in found.advice)


def test_scatter_from_run_to_run_is_estimated_and_widens_the_intervals() -> None:
    found = identified(synthesize_shear({**BASE, "gain_scatter": 0.004}, 21))
    scatter = found.one("run_scatter")
    assert scatter.value is not None
    assert 0.0015 < scatter.value < 0.009
    for name, truth in (("k2", 2.6e5), ("k1", 6e4), ("alpha_bw", 40.0)):
        parameter = found.one(name)
        assert parameter.ci95 is not None
        assert abs(parameter.value - truth) < 2.5 * (parameter.ci95[1] - parameter.ci95[0]) / 2


def test_a_model_that_cannot_be_right_is_rejected_and_loops_stand(campaign: list[Recording]) -> None:
    cubic = [changed(r, force=lambda F, k=4e12, r=r: F + k * (r.values("displacement") ** 3)) for r in campaign]
    found = identified(cubic)
    assert found.verdict == "rejected"
    assert any("does not describe" in reason for reason in found.reasons)
    assert found.find("stiffness_secant")
