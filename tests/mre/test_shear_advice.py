"""What `mre.shear` advises to measure next, and what its report says of runs at many amplitudes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipeline.findings import Published
from pipeline.findings.figures import Figure, Line, Points
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear.arrays import _alike
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.shear.methods import _runs_hold
from pipeline.rigs.mre.shear.published import published
from pipeline.rigs.mre.shear.sections import sections
from pipeline.rigs.mre.shear.verdict import _design_advice


def fit_of(amplitudes: list[float], frequencies: list[float], **estimates: float) -> Any:
    loops = [SimpleNamespace(amplitude=x, frequency=f) for x, f in zip(amplitudes, frequencies, strict=True)]
    return SimpleNamespace(loops=loops, estimates=[SimpleNamespace(name=n, value=v) for n, v in estimates.items()])


def test_amplitudes_that_lie_close_to_each_other_are_many_where_they_span_a_range() -> None:
    amplitudes = list(np.linspace(0.1e-3, 0.5e-3, 40))
    advice = _design_advice(fit_of(amplitudes, list(np.linspace(2, 9, 40)), rho=4000.0, tau=0.02))
    assert not any("one amplitude" in text or "one frequency" in text for text in advice)


@pytest.mark.parametrize("spread", [1.0, 1.1])
def test_one_amplitude_and_one_frequency_are_told_with_what_to_add(spread: float) -> None:
    amplitudes = [4e-4, 4e-4, 4e-4 * spread]
    advice = " ".join(_design_advice(fit_of(amplitudes, [10.0, 10.0, 10.2], rho=4000.0)))
    assert "other amplitudes than 0.4 mm, some 0.13 mm and some 0.8 mm" in advice
    assert "2 Hz and one at 30 Hz" in advice


def test_frequencies_close_to_each_other_still_straddle_the_corner() -> None:
    advice = _design_advice(fit_of([2e-4, 6e-4, 8e-4], [5.0, 5.15, 12.0], rho=4000.0, tau=0.02))
    assert not any("frequenc" in text for text in advice if "Add amplitudes" not in text)


def test_points_lie_on_the_lines_of_the_model_at_their_own_amplitude() -> None:
    # The rig's motion has harmonics of 1 and 1.5 %: lines of a pure sine would be 2 % of the damping off.
    truth = {"duration": 1.2, "preload_runs": False, "currents": [0.0, 6.0]}
    findings = SHEAR.identify(SHEAR.synthesize(truth, 1), ShearSettings(), Context("c", {}))
    figures = [block for section in sections(findings) for block in section.blocks if isinstance(block, Figure)]
    for figure in (figure for figure in figures if figure.name.startswith("metrics_")):
        for panel in figure.panels:
            for points in (mark for mark in panel.marks if isinstance(mark, Points)):
                (line,) = (m for m in panel.marks if isinstance(m, Line) and m.role == points.role)
                strokes = np.split(np.c_[line.x, line.y], np.flatnonzero(np.isnan(line.x)))
                curves = [stroke[~np.isnan(stroke[:, 0])] for stroke in strokes]
                for x, y in zip(points.x, points.y, strict=True):
                    near = [np.interp(x, *c.T) for c in curves if len(c) and c[0, 0] <= x <= c[-1, 0]]
                    assert min(abs(at / y - 1) for at in near) < 0.005, (figure.name, panel.title)


def test_runs_at_many_close_amplitudes_do_not_share_one_line() -> None:
    runs = pd.DataFrame({"amplitude": np.geomspace(1e-4, 6e-4, 60)})
    parts = _alike(runs, "amplitude")
    assert sum(len(part) for part in parts) == 60
    assert all(part["amplitude"].max() <= 1.05 * part["amplitude"].min() for part in parts)


def test_checks_of_the_paper_are_marked_as_such_and_do_not_change_with_the_pads() -> None:
    def rows(diameter: float) -> list[Published]:
        loop = SimpleNamespace(pads=SimpleNamespace(diameter=diameter, height=0.006))
        return published(SimpleNamespace(loops=[loop]), None)

    assert {row.basis for row in rows(0.05)} == {"paper"}
    assert rows(0.05) == rows(0.0505)
    assert rows(0.08) == []


def test_one_run_holds_and_two_hold() -> None:
    assert [_runs_hold(1), _runs_hold(2)] == ["1 run holds", "2 runs hold"]
