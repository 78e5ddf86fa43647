"""What is handed over to `tpjb.dynamic`: the mass that holds is named, and what is not used is said."""

from __future__ import annotations

from dynamic_logs import conditions, found_in, logs, messages

from pipeline.findings import Findings, Parameter
from pipeline.rigs.tpjb.dynamic.declaration import DYNAMIC


def baseline(mass: float | None, error: float = 0.1, *, verdict: str = "ok", tones: str = "one tone") -> Findings:
    parameters = [
        Parameter(name="stator_mass", symbol="m_s", value=mass, std_error=error if mass else None, unit="kg")
        if mass
        else Parameter(name="stator_mass", symbol="m_s", value=None, unit="kg", description=tones),
        Parameter(name="stabilizer_stiffness", symbol="k_s", value=5e6, std_error=3e3, unit="N/m"),
    ]
    return Findings(
        campaign="t0", experiment="tpjb.baseline", verdict=verdict, reasons=["it touched."], parameters=parameters
    )


def test_a_mass_that_differs_from_the_stated_one_is_named_with_the_one_that_holds() -> None:
    findings = found_in(logs(1), t0=baseline(887.0, 4.0, verdict="warning"))
    text = messages(findings)
    assert findings.verdict == "warning"
    assert "the runs state 900 kg, campaign 't0' found 887 ± 8 kg; the latter is used" in text
    assert "it touched." in text
    assert float(findings.arrays["inertia"]["mass"].iloc[0]) == 887.0
    assert "inertia" in [block.name for chapter in DYNAMIC.sections(findings) for block in chapter.blocks]


def test_a_mass_that_agrees_leaves_the_verdict() -> None:
    findings = found_in(logs(1), t0=baseline(900.05))
    assert findings.verdict == "ok", messages(findings)
    assert "900.05 ± 0.2 kg" in messages(findings)


def test_a_baseline_without_a_mass_is_not_believed() -> None:
    findings = found_in(logs(1), t0=baseline(None))
    assert findings.verdict == "warning"
    assert "handed over and is not used: it gives no mass (one tone)" in messages(findings)
    findings = found_in([conditions(r, stator_mass=None) for r in logs(1)], t0=baseline(None))
    assert findings.verdict == "rejected"
    assert "one tone" in findings.reasons[0]


def test_what_does_not_serve_is_said() -> None:
    bump = Findings(campaign="b", experiment="tpjb.bump", verdict="ok")
    findings = found_in(logs(1), b=bump)
    assert findings.verdict == "ok"
    assert "campaign 'b' (tpjb.bump) was handed over and is not used" in messages(findings)
