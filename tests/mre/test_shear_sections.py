"""Chapters and methods of `mre.shear` from findings as they lie on disk, for every kind of campaign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Figure, Line, Points, Section, Table
from pipeline.findings.storage import read, write
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear import captions
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.shear.residuals import field_laws
from pipeline.rigs.mre.synthetic import synthesize_rich

SHORT = {"duration": 1.2, "preload_runs": False}


def preload_campaign() -> list[Recording]:
    return SHEAR.synthesize({"duration": 2.0, "campaign": "smallest"}, 1)


def sequence_campaign() -> list[Recording]:
    runs = SHEAR.synthesize({**SHORT, "gain_scatter": 0.003, "currents": [0.0, 6.0]}, 1)
    return [replace(r, conditions={**r.conditions, "sequence_index": float(i)}) for i, r in enumerate(runs)]


def one_run() -> list[Recording]:
    return SHEAR.synthesize({**SHORT, "currents": [0.0], "frequencies": [10.0]}, 1)


def bare() -> list[Recording]:
    out = []
    for recording in SHEAR.synthesize({**SHORT, "currents": [0.0]}, 1):
        (stream,) = recording.streams.values()
        kept = {name: stream.channels[name] for name in ("displacement", "force")}
        out.append(Recording(recording.run, {"": Stream("", stream.time, kept)}))
    return out


def inverted() -> list[Recording]:
    out = []
    for recording in bare():
        (stream,) = recording.streams.values()
        F = stream.channels["force"]
        channels = {**stream.channels, "force": replace(F, values=-F.values)}
        out.append(replace(recording, streams={"": replace(stream, channels=channels)}))
    return out


def half_cycles() -> list[Recording]:
    time = np.arange(0, 20, 0.02)
    x = 0.01 * np.minimum(time, 20 - time) / 10
    F = 5000 * x + np.where(time <= 10, 2.0, -2.0) * (x / 0.01) + np.random.default_rng(0).normal(0, 0.01, time.size)
    channels = {"displacement": Channel("displacement", x, "m"), "force": Channel("force", F, "N")}
    return [Recording(name, {"": Stream("", time, channels)}) for name in ("first", "second")]


def record() -> list[Recording]:
    return [synthesize_rich({}, 5, duration=12.0)]


CAMPAIGNS: list[Callable[[], list[Recording]]] = [
    preload_campaign,
    sequence_campaign,
    one_run,
    bare,
    inverted,
    half_cycles,
    record,
]


def from_disk(recordings: list[Recording], folder: Path) -> Findings:
    found = SHEAR.identify(recordings, ShearSettings(), Context("test", {}))
    write(found.model_copy(update={"settings": ShearSettings().model_dump()}), folder)
    return read(folder)


def blocks(chapters: list[Section]) -> dict[str, Figure | Table]:
    return {block.name: block for chapter in chapters for block in chapter.blocks if isinstance(block, Figure | Table)}


@pytest.mark.parametrize(
    "campaign",
    [
        pytest.param(one, id=one.__name__, marks=[pytest.mark.thorough] * (one is sequence_campaign))
        for one in CAMPAIGNS
    ],
)
def test_chapters_are_made_from_what_is_on_disk(campaign: Callable[[], list[Recording]], tmp_path: Path) -> None:
    findings = from_disk(campaign(), tmp_path)
    chapters = list(SHEAR.sections(findings))
    assert chapters
    for chapter in chapters:
        assert chapter.blocks, f"the chapter '{chapter.name}' is empty"
    for name, block in blocks(chapters).items():
        assert "?" in block.caption, f"the caption of '{name}' asks nothing"
        if isinstance(block, Table):
            assert all(len(row) == len(block.columns) for row in block.rows), name
            continue
        for panel in block.panels:
            assert panel.marks, name
            for mark in panel.marks:
                if isinstance(mark, Points | Line):
                    assert mark.x.shape == mark.y.shape
                    assert np.isfinite(mark.y).any(), f"{name}: {panel.title} shows nothing"
    paragraphs = SHEAR.methods(findings)
    assert paragraphs
    assert not any("nan" in text.lower().split() for text in paragraphs)


def test_the_agreement_of_every_metric_covers_zero_for_the_true_model(tmp_path: Path) -> None:
    findings = from_disk(SHEAR.synthesize({**SHORT, "currents": [0.0, 6.0]}, 2), tmp_path)
    table = findings.arrays["agreement"]
    inside = ((table["low"] < 1) & (table["high"] > 1)).mean()
    assert inside > 0.85  # 95 % each, and the model was fitted to them
    assert len(table) == 4 * 6


@pytest.mark.thorough
def test_the_order_of_the_runs_is_shown_where_it_is_known(tmp_path: Path) -> None:
    findings = from_disk(sequence_campaign(), tmp_path)
    figure = blocks(list(SHEAR.sections(findings)))["sequence"]
    assert isinstance(figure, Figure)
    (points,) = [mark for mark in figure.panels[0].marks if isinstance(mark, Points)]
    assert points.x.tolist() == sorted(points.x.tolist())
    assert "sequence" not in blocks(list(SHEAR.sections(from_disk(bare(), tmp_path / "other"))))


@pytest.mark.parametrize(
    ("k_mr", "words"),
    [
        ({2.0: 7.5e4, 4.0: 1.5e5, 6.0: 2.25e5}, "saturation is not reached"),
        ({2.0: 1.2e5, 4.0: 1.9e5, 6.0: 2.1e5}, "saturation begins"),
    ],
)
@pytest.mark.thorough
def test_the_law_of_the_field_tells_whether_saturation_is_seen(k_mr: dict[float, float], words: str) -> None:
    findings = SHEAR.identify(SHEAR.synthesize({**SHORT, "k_mr": k_mr}, 4), ShearSettings(), Context("test", {}))
    law = field_laws(findings.parameters).set_index("name").loc["k_mr"]
    assert words in law["verdict"]


def test_captions_answer_from_the_tables_and_say_nothing_where_nothing_is_known() -> None:
    runs = pd.DataFrame(
        {
            "run": ["a", "b", "c"], "current": [0.0, 0.0, 2.0], "frequency": [5.0, 10.0, 5.0], "amplitude": 4e-4,
            "stiffness_secant": [3e5, 4e5, 5e5], "damping": [2000.0, 1000.0, 900.0], "nrmse": [0.01, 0.03, 0.02],
        }
    )  # fmt: skip
    assert captions.course(runs, "frequency") == (
        "At 0 A, secant stiffness goes from 300 to 400 kN/m and damping from 2 to 1 kN s/m between 5 Hz (0.4 mm) and 10 Hz (0.4 mm)."
    )
    assert captions.course(runs, "amplitude") == ""
    assert captions.course(runs.assign(current=np.nan), "frequency").startswith("Secant stiffness goes from ")
    assert captions.followed(runs) == "It misses 2 % of the force's rms in the middle run, at most 3 % (run b)."
    assert captions.followed(runs.drop(columns="nrmse")) == ""
    loops = pd.DataFrame({"run": ["a", "a", "b"], "force": [10.0, -20.0, 5.0], "residual": [0.1, -0.2, np.nan]})
    assert captions.missed(loops) == "At most 1 % of the largest force, 0.2 N (run a)."
    assert captions.missed(loops.assign(residual=np.nan)) == ""
    told = captions.between(runs, {"stiffness_secant": ("K_sec", 1e3, "kN/m"), "damping": ("damping", 1.0, "N s/m")})
    assert told == "K_sec between 300 (a) and 500 kN/m (c) and damping between 900 (c) and 2000 N s/m (a)."
    assert captions.not_fitted(loops.assign(model=[1.0, 2.0, np.nan])).endswith("own harmonics: b.")
    assert captions.not_fitted(loops.assign(model=np.nan)) == ""
    off = pd.DataFrame({"run": ["a", "b"], "ratio": [1.01, 0.97], "low": [0.99, 0.96], "high": [1.03, 0.98]})
    assert captions.off_the_model(off) == ("1 of 2 intervals (95 %) hold its number; the farthest is 3 % off (run b).")
    runs["chi2_reduced"] = [0.8, 1.2, 9.0]
    assert captions.stands_out(runs) == "Yes, c: chi2 per datum is 9, 1.2 in the middle run."
    assert captions.stands_out(runs[:2]) == "No: chi2 per datum is at most 1.2 (b), 1 in the middle run."


def test_the_field_is_told_at_equal_amplitude_first_and_why_it_is_not() -> None:
    def effect(name: str, value: float | None, preload: float, current: float = 6.0) -> Parameter:
        ci95 = None if value is None else (value - 0.001, value + 0.001)
        at: dict[str, float | str | bool] = {"coil_current": current, "preload": preload}
        return Parameter(
            name=name, value=value, ci95=ci95, symbol="e", unit="1", at=at, description="the model is rejected"
        )

    some = [
        effect("mr_effect_amplitude", None, 200.0),
        effect("mr_effect_force", 0.82, 200.0),
        effect("mr_effect_force", 0.3, 200.0, 2.0),
    ]
    findings = Findings(campaign="c", experiment="mre.shear", verdict="warning", reasons=["r"], parameters=some)
    assert captions.gained(findings) == (
        "At 6 A, at equal amplitude not told (the model is rejected); at equal force 82.00 % (95 %: 81.90 to 82.10 %) at 200 N."
    )
    assert captions.gained(findings.model_copy(update={"parameters": []})).startswith("Not told: there is no pair")
