"""Designs that cannot determine some parameter: it is null with the reason, the advice says what to measure, and nothing else
takes its place: what is still told holds the truth on every seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from axial_logs import changed as press_changed
from axial_logs import press, unchanged

from benchmarks.coverage.studies import mre_axial, mre_hold, mre_shear, mre_shear_rich, mre_step
from pipeline.findings import Findings, Parameter
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context, Experiment
from pipeline.rigs.mre.hold.synthetic import synthesize as synthesize_hold
from pipeline.rigs.mre.rich.declaration import RichSettings
from pipeline.rigs.mre.shear.declaration import ShearSettings
from pipeline.rigs.mre.step.synthetic import synthesize as synthesize_step
from pipeline.rigs.mre.synthetic import ShearRun, rich_recording, shear_truth, synthesize_shear

# Some 150 numbers a seed.
_SEEDS = (11, pytest.param(12, marks=pytest.mark.thorough))
_SIGMAS = 3.5
Truth = Callable[[Parameter], object]


@dataclass(frozen=True)
class Design:
    """Logs by seed; what must be null, what of it the reasons say; what the advice names; what is true."""

    logs: Callable[[int], Sequence[Recording]]
    open: Sequence[str]
    reason: str
    advice: str
    truth: Truth
    experiment: Experiment
    settings: object = None
    told: Sequence[str] = ()


def _shear(**truth: object) -> Callable[[int], Sequence[Recording]]:
    return lambda seed: synthesize_shear({"duration": 1.5, "preload_runs": False, **truth}, seed)


def _of_shear(p: Parameter) -> object:
    return None if "run" in p.at or p.name == "run_scatter" else mre_shear.truth(p)


def _only_loading(seed: int) -> Sequence[Recording]:
    logs = press(seed)
    return [press_changed(r, unchanged, keep=r.stream_of("force_axial").time < 59.0) for r in logs]


def _rich(x: Callable[[np.ndarray], np.ndarray]) -> Callable[[int], Sequence[Recording]]:
    """Return one record of that motion, 20 s at 2 kHz, made as the rig's own are."""
    from pipeline.rigs.mre import synthetic

    known = shear_truth({"duration": 20.0, "rate": 2000.0})
    fine = np.arange(round(20.0 * 2000.0 * 10)) / 20000.0
    motion = x(fine)

    def logs(seed: int) -> Sequence[Recording]:
        run = ShearRun("rich_0a", "shear_rich", float("nan"), float("nan"), 0.0)
        force = synthetic._force_along(known, run, fine, motion)
        return [rich_recording(known, 0.0, seed, (fine, motion, force))]

    return logs


def _small(t: np.ndarray) -> np.ndarray:
    amplitude = 1e-4 * (0.6 - 0.4 * np.cos(2 * np.pi * 0.23 * t))
    return np.asarray(amplitude * np.sin(2 * np.pi * (3 + 7 * t / 20) * t))


def _one_loop(t: np.ndarray) -> np.ndarray:
    return np.asarray(4e-4 * np.sin(2 * np.pi * 7.3 * t))


_OFFLINE = RichSettings(online=False)
_TWO_STARTS = ShearSettings(starts=2)
_AX, _HO, _ST, _SH, _RI = (
    study.STUDY.experiment for study in (mre_axial, mre_hold, mre_step, mre_shear, mre_shear_rich)
)

DESIGNS = {
    "shear, one frequency": Design(
        _shear(frequencies=[10.0], currents=[0.0, 6.0]), ("k1", "tau", "s1"), "tau", "Add a run at 2 Hz", _of_shear, _SH,
        _TWO_STARTS, told=("rho",),
    ),
    "shear, small amplitudes only": Design(
        _shear(amplitudes=[1e-4], currents=[0.0]), ("alpha_bw", "rho", "k2"), "only k2 + alpha_bw rho", "other amplitudes",
        _of_shear, _SH, _TWO_STARTS, told=("k2_plus_alpha_rho",),
    ),
    "shear, one loop": Design(
        lambda seed: _shear(currents=[0.0])(seed)[2:3], ("k1", "tau", "s1"), "determined", "Add runs at other frequencies",
        _of_shear, _SH, _TWO_STARTS,
    ),
    "shear, no run at 0 A": Design(
        lambda seed: [r for r in _shear()(seed) if r.condition("coil_current") in (4.0, 6.0)], ("k_mr",), "0 A",
        "Add runs at 0 A", lambda p: None if p.name == "k2" else _of_shear(p), _SH, _TWO_STARTS, told=("alpha_bw", "rho"),
    ),
    "rich, small amplitudes only": Design(
        _rich(_small), ("alpha_bw", "rho", "k2"), "determined", "larger amplitudes", mre_shear_rich.truth, _RI, _OFFLINE,
        told=("k2_plus_alpha_rho",),
    ),
    "rich, one loop over and over": Design(
        _rich(_one_loop), ("k1", "s1", "tau", "k2"), "one amplitude at one frequency", "mre.shear treats such runs better",
        mre_shear_rich.truth, _RI, _OFFLINE
    ),
    "axial, loading only": Design(
        _only_loading, ("stiffness", "alpha", "rho", "loss_ratio", "unloading_drop"), "loading branch", "Log the release too",
        mre_axial.truth, _AX, told=("stiffness_secant", "stiffening_secant"),
    ),
    "axial, no run at 0 A": Design(
        lambda seed: press(seed, currents=[2.0]), ("stiffening_secant", "stiffening_slope"), "0 A", "Add a run at 0 A",
        mre_axial.truth, _AX, told=("stiffness", "alpha"),
    ),
    "hold, swept to 4 A": Design(
        lambda seed: synthesize_hold({"largest_current": 4.0}, seed), ("force_gain", "saturation_current", "sharpness"),
        "saturation", "Sweep on", mre_hold.truth, _HO, told=("force_initial", "relaxation", "force_increment"),
    ),
    "hold, up only": Design(
        lambda seed: synthesize_hold({"down": False}, seed), (), "", "Sweep the current back down", mre_hold.truth, _HO,
        told=("force_initial", "force_increment"),
    ),
    "step, up only": Design(
        lambda seed: synthesize_step({"times": [1.0], "levels": [6.0], "duration": 6.0}, seed),
        ("t63 fall", "t90 fall", "delay fall", "time_constant_1 fall"), "no falling step", "Log a step up and a step down",
        mre_step.truth, _ST, told=("t63 rise",),
    ),
    "step, sampled at 10 Hz": Design(
        lambda seed: synthesize_step({"rate": 10.0}, seed),
        ("delay rise", "delay fall", "time_constant_2 rise", "time_constant_2 fall"), "within one sample", "Sample force",
        mre_step.truth, _ST, told=("t63 fall",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("seed", _SEEDS)
@pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)
def test_what_a_design_cannot_tell_is_null_and_the_rest_holds(design: Design, seed: int) -> None:
    findings = _identified(design, list(design.logs(seed)))
    assert findings.verdict == "warning", findings.reasons
    for name in design.open:
        found = _named(findings, name)
        assert found, name
        assert all(p.value is None for p in found), name
        assert all(p.description for p in found)
    reasons = [p.description for name in design.open for p in _named(findings, name)]
    assert not design.open or any(design.reason in text for text in reasons), reasons
    said = [*findings.advice, *findings.reasons, *(q.message for q in findings.quality)]
    assert any(design.advice in text for text in said), findings.advice
    for name in design.told:
        assert any(p.value is not None for p in _named(findings, name)), name
    for p in findings.parameters:
        true = design.truth(p) if p.value is not None and p.std_error else None
        if isinstance(true, float) and p.value is not None and p.std_error:
            low, high = p.ci95 or (p.value, p.value)
            off = max(low - true, true - high, 0.0)
            assert off < (_SIGMAS - 1.96) * p.std_error, (seed, p.name, dict(p.at), p.value, true, p.std_error)


def _identified(design: Design, logs: list[Recording]) -> Findings:
    settings = design.settings or design.experiment.settings()
    return design.experiment.identify(logs, settings, Context("test", {}))


def _named(findings: Findings, name: str) -> list[Parameter]:
    """Return parameters by name, or by name and direction."""
    name, _, direction = name.partition(" ")
    return [p for p in findings.find(name) if not direction or p.at.get("direction") == direction]
