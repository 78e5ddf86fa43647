"""Logs of real machines through `rigfit run mre.shear` with the recipes kept as examples: honest verdicts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from pipeline.findings import Findings
from pipeline.findings.storage import read

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


def ran(rigfit: Callable[..., Any], recipe: str, logs: list[Path], out: Path) -> tuple[Findings, int]:
    answer = rigfit("run", "mre.shear", *logs, "--recipe", EXAMPLES / recipe, "--out", out)
    assert answer.status in (0, 1), answer.err
    findings = read(out)
    assert (findings.verdict == "rejected") == (answer.status == 1)
    assert (out / "report.html").stat().st_size > 10_000
    return findings, answer.status


def notes(findings: Findings, run: str) -> str:
    return " ".join(q.message for q in findings.quality if q.run == run)


def damping_by_area(log: Path, frequency: float) -> float:
    """Return A/(pi omega X^2) with the area summed over the raw samples of the last whole cycles, N s/m."""
    table = loadmat(log)
    time, x, force = (np.ravel(table[name]).astype(float) for name in ("Tout", "dist", "forc"))
    cycles = int((time[-1] - 5.0) * frequency)
    part = time > time[-1] - cycles / frequency
    x, force = 1e-3 * x[part], force[part] - force[part].mean()
    area = float(np.trapezoid(force, x)) / cycles
    motion = x - np.polyval(np.polyfit(time[part], x, 2), time[part])
    return area / (np.pi * 2 * np.pi * frequency * 2 * float(np.mean(motion**2)))


def test_a_shaken_damper_shows_loops_and_a_model_and_is_rejected_for_named_reasons(
    realdata: Path, rigfit: Callable[..., Any], tmp_path: Path
) -> None:
    logs = sorted((realdata / "mr_damper_sine").glob("*.mat"))
    findings, _ = ran(rigfit, "mr_damper_sine.yaml", logs, tmp_path / "damper")
    assert findings.verdict == "rejected"
    assert "does not describe the data" in findings.reasons[0]
    assert any("mean displacement drifts" in r and "asymmetric" in r and "offset" in r for r in findings.reasons)
    assert "nothing moves in the first 2" in notes(findings, "ensaio.A.1")
    assert "in push" in notes(findings, "ensaio.A.1")
    for run in ("ensaio.A.1", "ensaio.A.3"):
        damping = findings.one("damping", run=run)
        assert damping.value is not None
        expected = damping_by_area(realdata / "mr_damper_sine" / f"{run}.mat", float(damping.at["frequency"]))
        assert damping.value == pytest.approx(expected, rel=0.04)
    assert {"displacement", "force", "model"} <= set(findings.arrays["loops"].columns)
    assert any(model.selected and model.nrmse and 0.02 < model.nrmse < 0.3 for model in findings.models)


def test_an_elastomer_strip_gives_stiffness_and_loss_of_half_a_cycle(
    realdata: Path, rigfit: Callable[..., Any], tmp_path: Path
) -> None:
    logs = sorted((realdata / "vhb4910").glob("*.csv"))
    findings, status = ran(rigfit, "elastomer_strip.yaml", logs, tmp_path / "strip")
    assert status == 0
    assert findings.verdict == "warning"
    assert any("Half cycles only" in reason for reason in findings.reasons)
    for log in logs:
        assert "one half cycle only" in notes(findings, log.stem)
        stiffness = findings.one("stiffness_secant", run=log.stem).value
        ratio = findings.one("loss_ratio", run=log.stem).value
        assert stiffness is not None
        assert ratio is not None
        assert 10 < stiffness < 25  # N/m: 0.6 to 1.05 N over 40 or 80 mm
        assert 0.4 < ratio < 0.7
    assert not findings.find("damping")
    assert not findings.find("k1")
    # Stiffness and loss of a viscoelastic strip grow with the rate.
    slow, fast = (findings.one("stiffness_secant", run=name).value for name in ("0d01_1d5", "0d05_1d5_1"))
    assert slow is not None
    assert fast is not None
    assert slow < fast


@pytest.mark.thorough
def test_a_randomly_driven_damper_is_checked_on_the_second_half(
    realdata: Path, rigfit: Callable[..., Any], tmp_path: Path
) -> None:
    whole = (realdata / "mr_damper_random" / "ranran_50_converted.csv").read_text().splitlines(keepends=True)
    log = tmp_path / "random.csv"
    log.write_text("".join(whole[:24_000]))
    findings, _ = ran(rigfit, "mr_damper_random.yaml", [log], tmp_path / "damper")
    assert findings.verdict == "rejected"
    assert "predicts the second half to within" in findings.reasons[0]
    [model] = findings.models
    assert model.name == "time_domain"
    assert model.cv_error is not None
    assert 0.2 < model.cv_error < 1.0
    assert any("no single operating point" in reason and "voltage" in reason for reason in findings.reasons)
    assert not findings.find("stiffness_secant")
