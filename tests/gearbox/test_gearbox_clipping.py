"""Torques at the end stop of their converter: the peak is a lower bound, and nothing else leans on those samples."""

import numpy as np
import pytest

from pipeline.findings import Findings
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.torques.clipping import NONE, clip_of


def found(span: float, run: str = "g3", seed: int = 5) -> Findings:
    recordings = synthesize({"runs": (run,), "vibration": False, "torque_span": span}, seed)
    return identify(recordings, LoadExchangeSettings(), Context("test", {}))


@pytest.mark.parametrize("span", [3.0, 3.4, 4.0])
@pytest.mark.parametrize("run", ["g1", "g3", "g8"])
@pytest.mark.thorough
def test_a_cut_brake_rise_keeps_its_slope(span, run):
    slope = found(span, run).one("torque_transfer_slope", phase="brake")
    if slope.value is not None:
        assert slope.ci95[0] - 0.02 < 0.5443 < slope.ci95[1] + 0.02


def test_a_cut_peak_is_a_lower_bound_and_there_is_no_lock_torque():
    findings = found(3.4)
    peak = findings.one("torque_in_peak", stage="brake")
    assert peak.value == pytest.approx(1.7, abs=0.02)
    assert peak.ci95 is None
    for name in ("lock_torque", "torque_relief_in", "breakaway_drop_in"):
        assert findings.one(name).value is None
    assert findings.one("torque_in_nominal", stage="sos").ci95 is not None
    assert findings.verdict == "warning"


def test_a_cut_level_is_no_level_and_says_so():
    findings = found(2.4)
    level = findings.one("torque_in_nominal", stage="sos")
    assert level.value is None
    assert "saturated" in level.description
    assert findings.one("power_dissipated_sos").value is None
    assert "saturated" in findings.one("power_dissipated_sos").description


def test_noise_and_coarse_converters_are_no_end_stop():
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 10.0, 5e-4)
    assert clip_of(time, np.round(rng.normal(size=time.size), 3)) is NONE
    assert clip_of(time, np.round(np.sin(time), 1)) is NONE  # every value stands for many samples
    clip = clip_of(time, np.minimum(np.sin(time) + 0.01 * rng.normal(size=time.size), 0.9))
    assert clip.limit == 0.9
    assert clip.first((0.0, 3.0)) == pytest.approx(np.arcsin(0.9), abs=0.1)
    assert not clip.spoils((4.0, 6.0), 2000.0)
    assert clip.spoils((1.2, 1.8), 2000.0)
