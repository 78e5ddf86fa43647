"""Torques that change while nothing else does: told per channel, and no interval pretends that the zero stood still."""

import numpy as np
import pytest

from pipeline.findings import Findings
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.torques.torque_drift import Drift, drift_of

PLAIN = {"runs": ("g3",), "vibration": False}


def found(seed: int = 5, **truth: object) -> Findings:
    return identify(synthesize({**PLAIN, **truth}, seed), LoadExchangeSettings(), Context("test", {}))


def holds(findings: Findings, name: str, value: float, **at: str) -> bool:
    ci95 = findings.one(name, **at).ci95
    return ci95 is not None and ci95[0] <= value <= ci95[1]


def told(findings: Findings) -> dict[str, str]:
    return {str(q.channel): q.message for q in findings.quality if "locked torque at equal speed changes" in q.message}


@pytest.mark.parametrize("change", [0.1, -0.1])
def test_a_zero_that_drifts_without_a_closing_standstill_is_told_of_both_channels(change):
    findings = found(offset_change_in=change, offset_change_out=change)
    assert set(told(findings)) == {"torque_in", "torque_out"}
    assert findings.verdict == "warning"
    assert all("a standstill at the end of the log would tell" in message for message in told(findings).values())


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_what_a_drifting_zero_spoils_knows_it(seed):
    findings = found(seed, offset_change_in=0.1, offset_change_out=0.1)
    for quantity, values in (("torque_in", (0.9384, 1.4068, 0.9384)), ("torque_out", (0.3000, 0.5559, 0.3000))):
        for stage, value in zip(("fos", "sos", "fos_after"), values, strict=True):
            assert holds(findings, f"{quantity}_nominal", value, stage=stage), (quantity, stage)
    assert holds(findings, "efficiency_fos", 0.3000 / 0.9384)
    assert holds(findings, "torque_ratio_sos", 0.3952)
    assert holds(findings, "inertia_load", 0.0195, run="g3")
    assert abs(findings.one("inertia_load", run="g3").value / 0.0195 - 1) < 0.08


def test_a_drift_of_one_channel_is_told_of_that_channel_alone():
    assert set(told(found(offset_change_out=0.06))) == {"torque_out"}
    assert set(told(found(offset_change_in=0.06))) == {"torque_in"}


def test_a_zero_read_at_both_ends_leaves_no_drift_open():
    findings = found(offset_change_in=0.1, offset_change_out=0.1, duration=34.0)
    assert not any(q.level == "warning" and "locked torque" in q.message for q in findings.quality)
    assert findings.one("torque_in_nominal", stage="fos").std_error < 0.02


def test_sound_runs_show_no_drift():
    for seed in range(2):
        assert told(found(seed)) == {}


def test_a_brake_that_rubs_after_the_release_is_named_and_leaves_the_inertia_right():
    findings = found(brakes=[[10.0, 20.0, 1.3], [20.3, 40.0, 0.06]])
    assert any("the brake does not free the load" in q.message for q in findings.quality)
    assert holds(findings, "inertia_load", 0.0195, run="g3")


def steady(rng, rate=0.0, step=0.0):
    time = np.arange(0.0, 30.0, 0.01)
    torque = 0.9 + rate * time + step * (time > 15.0) + 0.005 * rng.standard_normal(time.size)
    return drift_of(time, torque, 12.566 * time, [(5.0, 10.0), (22.0, 29.0)], 1.0)


def test_a_line_and_a_step_are_told_apart_and_noise_is_neither():
    rng = np.random.default_rng(3)
    line, step = steady(rng, rate=0.002), steady(rng, step=0.05)
    assert line is not None
    assert step is not None
    assert line.shape == "line"
    assert line.rate == pytest.approx(0.002, rel=0.05)
    assert step.shape == "step"
    assert step.step == pytest.approx(0.05, rel=0.05)
    assert sum(steady(rng) is not None for _ in range(200)) <= 4


def test_the_error_of_a_drift_grows_from_when_the_zero_was_known():
    line = Drift("line", 0.003, 0.0, 1.0, 15.0, 9.0, 3.0)
    assert line.error(1.0) == 0.0
    assert 1.96 * line.error(21.0) > 0.06
    step = Drift("step", 0.0, 0.05, 1.0, 15.0, 9.0, 3.0)
    assert (step.error(10.0), step.change(20.0)) == (0.0, 0.05)
