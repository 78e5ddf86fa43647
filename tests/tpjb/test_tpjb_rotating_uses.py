"""tpjb.rotating beside the findings of other campaigns: stiffness of the dynamic test, clearance of the bump test."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotating_logs import coefficients, logs

from pipeline.findings import Findings, Parameter, Run
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb.axes import pad_directions
from pipeline.rigs.tpjb.rotating.clearance import clearances_of, outline_of
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.dynamic_stiffness import dynamic_states
from pipeline.rigs.tpjb.rotating.identify import identify

TONES = (7.0, 11.0, 13.0, 19.0, 23.0, 29.0, 37.0, 43.0)


def dynamic(curvature: float = 0.0, factor: float = 1.0) -> Findings:
    """Return findings of a dynamic test of the four-pad bearing at 80 kN: K (1 - curvature (f/43 Hz)^2) with 0.1 %."""
    true = coefficients("4pad-L2")
    parameters = []
    for name in ("kxx", "kxy", "kyx", "kyy"):
        for f in TONES:
            value = factor * true[name] * (1 - curvature * (f / 43.0) ** 2)
            at = {"static_load": 80e3, "shaft_speed": 104.7, "frequency": f}
            parameters.append(Parameter(name=name, symbol=name, value=value, std_error=1.2e6, unit="N/m", at=at))
    return Findings(campaign="d", experiment="tpjb.dynamic", verdict="ok", parameters=parameters)


def bump() -> Findings:
    """Return findings of a bump test: planes centred at (12, -7) and (18, -3) um, 200 um to each of four sides."""
    parameters = []
    for plane, centre in ((1.0, (12e-6, -7e-6)), (2.0, (18e-6, -3e-6))):
        for name, value in (("center_x", centre[0]), ("center_y", centre[1]), ("rotation", 0.0)):
            unit = "rad" if name == "rotation" else "m"
            parameters.append(Parameter(name=name, symbol=name, value=value, unit=unit, at={"plane": plane}))
        for side in (1.0, 2.0, 3.0, 4.0):
            at = {"plane": plane, "side": side}
            parameters.append(Parameter(name="clearance", symbol="c", value=200e-6, unit="m", at=at))
    return Findings(campaign="b", experiment="tpjb.bump", verdict="ok", parameters=parameters)


def test_stiffness_of_the_dynamic_test_is_carried_to_zero_frequency():
    (plain,), (bent,) = dynamic_states({"d": dynamic()}), dynamic_states({"d": dynamic(curvature=0.05)})
    true = coefficients("4pad-L2")
    assert plain.stiffness[0] == pytest.approx(true["kxx"], rel=1e-12)
    assert plain.std_error[0] == pytest.approx(1.2e6 / math.sqrt(8), rel=1e-9)
    assert bent.stiffness[3] == pytest.approx(true["kyy"], rel=1e-9)


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, "ok"), (1.03, "warning")])
def test_another_stiffness_in_the_dynamic_test_is_a_warning(factor, verdict):
    context = Context("t", {"d": dynamic(factor=factor), "b": bump()})
    findings = identify(logs("A6"), RotatingSettings(), context)
    assert findings.verdict == verdict
    wording = "gives the same stiffness" if verdict == "ok" else "do not give the same stiffness"
    assert any(wording in reason for reason in findings.reasons)


def test_orbits_count_from_the_centre_of_the_clearance():
    findings = identify(logs("A6", drift=0.0), RotatingSettings(), Context("t", {"b": bump()}))
    samples = findings.arrays["samples"]
    rest = samples[samples["dwell"]][["dx", "dy"]].mean().to_numpy()
    assert rest == pytest.approx([6e-6, 156.2e-6], abs=0.1e-6)
    assert len(findings.arrays["polygon"]) == 4


def test_the_clearance_of_four_pads_is_a_diamond_and_of_five_a_pentagon_with_a_corner_up():
    diamond = outline_of(pad_directions(4) + math.pi, np.full(4, 1.0)).to_numpy()
    assert sorted(np.abs(diamond).max(axis=1)) == pytest.approx([math.sqrt(2)] * 4)
    pentagon = outline_of(pad_directions(5) + math.pi, np.full(5, 1.0)).to_numpy()
    assert pentagon[:, 1].max() == pytest.approx(1 / math.cos(math.radians(36)))
    assert pentagon[:, 1].min() == pytest.approx(-1.0)


def test_bump_findings_of_another_bearing_are_not_used():
    other = bump()
    other.runs = [Run(run="x", conditions={"bearing": "5pad"})]
    assert clearances_of({"b": other}, logs("A6")) == {}


def test_findings_of_another_bearing_or_load_are_named_and_make_no_published_row():
    other = dynamic()
    other.runs = [Run(run="x", conditions={"bearing": "5pad"})]
    findings = identify(logs("A6"), RotatingSettings(), Context("t", {"d": other}))
    assert any("'d' (tpjb.dynamic) are not used: it is of bearing 5pad" in q.message for q in findings.quality)
    assert not any("frequency of excitation" in row.name for row in findings.published)
    findings = identify(logs("A4"), RotatingSettings(), Context("t", {"d": dynamic()}))
    assert any("measured at 80 kN and 104.7 rad/s, these at 40 kN" in q.message for q in findings.quality)
