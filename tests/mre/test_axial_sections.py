"""Chapters and methods of `mre.axial` from findings as they lie on disk, for every kind of campaign."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from axial_logs import changed, found, press, unchanged

from pipeline.findings import Findings
from pipeline.findings.figures import Figure, Line, Section, Table, Text
from pipeline.findings.storage import read, write
from pipeline.recording import Recording
from pipeline.rigs.mre.axial.declaration import AXIAL

D = "displacement_axial"


def bare() -> list[Recording]:
    names = ("coil_current", "pad_diameter", "pad_height", "powder_fraction", "matrix_shear_modulus", "poisson_ratio")
    return [
        changed(r, lambda _t, c: {k: v for k, v in c.items() if k != "current"}, **dict.fromkeys(names))
        for r in press(1)
    ]


def loading_only() -> list[Recording]:
    return [changed(r, unchanged, keep=r.stream_of(D).time < 59.0) for r in press(1)]


def hand_turned() -> list[Recording]:
    return press(1, rate_ripple=0.3, currents=[0.0])


def repeated() -> list[Recording]:
    return press(1, repeats=2)


def fluxed() -> list[Recording]:
    from pipeline.recording import Channel

    out = []
    for run in press(1):
        (stream,) = run.streams.values()
        flux = Channel("flux_density", 0.15 * stream.channels["current"].values, "T")
        stream.channels[flux.name] = flux
        out.append(run)
    return out


CAMPAIGNS: dict[str, Callable[[], list[Recording]]] = {
    "example": lambda: press(1), "bare": bare, "loading only": loading_only, "hand": hand_turned, "repeats": repeated,
    "flux": fluxed,
}  # fmt: skip


def from_disk(campaign: Findings, recordings: list[Recording], folder: Path) -> Findings:
    """Write and read back, with the conditions that the stage adds."""
    conditions = {r.run: dict(r.conditions) for r in recordings}
    campaign.runs = [run.model_copy(update={"conditions": conditions[run.run]}) for run in campaign.runs]
    write(campaign, folder)
    return read(folder)


@pytest.fixture(params=CAMPAIGNS)
def told(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, Findings]:
    recordings = CAMPAIGNS[request.param]()
    return request.param, from_disk(found(*recordings), recordings, tmp_path)


def test_every_campaign_has_chapters_and_methods(told: tuple[str, Findings]) -> None:
    kind, campaign = told
    chapters = {chapter.name: chapter for chapter in AXIAL.sections(campaign)}
    assert {"loops", "stiffness", "model"} <= set(chapters)
    assert ("micromechanics" in chapters) is (kind != "bare")
    figures = [b for chapter in chapters.values() for b in chapter.blocks if isinstance(b, Figure)]
    tables = [b for chapter in chapters.values() for b in chapter.blocks if isinstance(b, Table)]
    assert len({b.name for b in figures}) == len(figures)
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    for figure in figures:
        for panel in figure.panels:
            assert all(np.isfinite(m.y).any() for m in panel.marks if isinstance(m, Line))
    paragraphs = AXIAL.methods(campaign)
    assert all(text.strip() and "None" not in text and "nan" not in text for text in paragraphs)
    assert ("averaged" in " ".join(paragraphs)) is (kind == "repeats")


@pytest.fixture(scope="module")
def example() -> Findings:
    return found(*press(1))


def captions(campaign: Findings) -> dict[str, str]:
    blocks = [b for chapter in AXIAL.sections(campaign) for b in chapter.blocks if isinstance(b, Figure | Table)]
    return {block.name: block.caption for block in blocks}


def test_captions_answer_with_the_numbers_of_the_campaign(example: Findings) -> None:
    told = captions(example)
    secant = example.one("stiffening_secant", coil_current=2.0)
    assert secant.value is not None
    assert f"At 2 A by {100 * secant.value:.2f} % (95 %: " in told["over_current"]
    assert "It misses at most 1.1 % of the force (rms, run ax_0)" in told["loops"]
    assert "At 0 A the secant lies 1.4 % below it" in told["loops"]
    assert "independent from sample to sample" in told["loop_residuals"]
    assert "every sample counts" in told["motion"]
    assert "Yes, within rounding" in told["gauge"]
    assert "Of the loading work 26." in told["stiffness"]
    assert "N) at 2 A. It builds up over 1/rho = 4" in told["model"]


def test_captions_of_a_campaign_that_tells_nothing_say_why(example: Findings) -> None:
    gone = {"value": None, "std_error": None, "ci95": None, "description": "it: the loop is rejected."}
    open_ = [p.model_copy(update=gone) for p in example.parameters]
    half = [p if p.name.startswith("stiffness") else q for p, q in zip(example.parameters, open_, strict=True)]
    assert (
        "Not told: the loop is rejected. " in captions(example.model_copy(update={"parameters": half}))["over_current"]
    )
    runs = example.arrays["runs"].assign(effective=[300.0, 1200.0], motion=["constant rate", "changing rate"])
    samples = example.arrays["samples"]
    samples = samples.assign(reading=samples["reading"] + 2e-5 * (samples["time"] > 100))
    told = captions(
        example.model_copy(update={"parameters": open_, "arrays": {**example.arrays, "runs": runs, "samples": samples}})
    )
    for name in ("stiffness", "model"):
        assert "Not told: the loop is rejected. " in told[name]
    assert "the secant lies" not in told["loops"]
    assert "Not only: neighbours are alike, most in run ax_0, whose 1196 samples count as 300" in told["loop_residuals"]
    assert "of run ax_0 300 of 1196 samples count" in told["motion"]
    assert "Not everywhere: the reading of ax_0 is up to 24 µm off it, 16 % of the samples" in told["gauge"]


def test_theory_line_stands_in_every_loop_with_the_shape_remark(tmp_path: Path) -> None:
    recordings = press(1)
    campaign = from_disk(found(*recordings), recordings, tmp_path)
    loops = next(c for c in AXIAL.sections(campaign) if c.name == "loops")
    panels = next(b for b in loops.blocks if isinstance(b, Figure) and b.name == "loops").panels
    for panel in panels:
        line = next(m for m in panel.marks if isinstance(m, Line) and m.label == "E A/h")
        assert line.y[-1] / line.x[-1] == pytest.approx(516.9e3, rel=1e-3)
    assert any("9.68" in p for b in loops.blocks if isinstance(b, Text) for p in b.paragraphs)


def test_measured_flux_places_the_stiffening(tmp_path: Path) -> None:
    recordings = fluxed()
    campaign = from_disk(found(*recordings), recordings, tmp_path)
    chapter: Section = next(c for c in AXIAL.sections(campaign) if c.name == "micromechanics")
    table = next(b for b in chapter.blocks if isinstance(b, Table) and b.name == "micromechanics_measured")
    assert [row[2] for row in table.rows] == pytest.approx([0.3, 0.3], abs=5e-3)
    assert any("as measured" in p for b in chapter.blocks if isinstance(b, Text) for p in b.paragraphs)
