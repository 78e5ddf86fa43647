"""Campaigns that cannot tell some numbers: these are null with the reason and what to measure next, and no other takes them up."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from pressure_logs import ML_MIN, edited
from test_rap_bad_data import EXPERIMENTS, TANK, USUAL, middle

from benchmarks.coverage.studies import rap_cytotoxicity
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.synthetic import rig

SEEDS = (3, pytest.param(8, marks=pytest.mark.thorough))


def late(recording: Recording) -> Recording:
    """Return a log that begins 50 min after switching on."""

    def cut(stream: str, time: np.ndarray, columns: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        kept = time > 3000.0 if stream.endswith("temperature") else np.ones(time.size, dtype=bool)
        return time[kept], {name: values[kept] for name, values in columns.items()}

    return edited(recording, cut)


@dataclass(frozen=True)
class Design:
    """`nulls` cannot be told, because of `reason`; `advice` says what to measure next."""

    words: str
    experiment: str
    nulls: Sequence[str]
    reason: str
    advice: str
    truth: dict[str, Any] = field(default_factory=dict)
    spoil: Callable[[Recording], Recording] = lambda r: r


DESIGNS = [
    Design("one speed, never stopped", "pressures", ("lag", "gain", "offset", "r_access", "r_return", "r_filter"), "stop", "pump", {"uf_flow": 0.0}, middle),
    Design("never any ultrafiltration", "pressures", ("k_uf", "c_uf"), "never on", "ultrafiltration", {"uf_flow": 0.0}),
    Design("no clamp", "flow", ("stroke_volume", "y0", "y1"), "clamp", "clamp", {"calibration_clamps": [1.0]}),
    Design("one speed", "flow", ("stroke_volume", "y0", "y1"), "speed", "set-point", {"flows": [80.0 * ML_MIN]}),
    Design("forty minutes", "therapy", ("k_uf_decline",), "cannot tell a decline", "h"),
    Design("log begun late", "therapy", ("temperature_initial", "time_constant"), "switching on", "switching on", {"duration": 7200.0, **TANK}, late),
    Design("tank too empty for the level", "therapy", ("uf_pump_gain",), "echo", "echo", {"initial_volume": 0.0, "duration": 600.0, **TANK}),
]  # fmt: skip


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("design", DESIGNS, ids=[f"{d.experiment}: {d.words}" for d in DESIGNS])
def test_what_a_design_cannot_tell_is_null_and_the_rest_holds_the_truth(design: Design, seed: int) -> None:
    experiment, synthesize, truth_of = EXPERIMENTS[design.experiment]
    rigged = {**USUAL[design.experiment], **design.truth}
    found = experiment.identify(
        [design.spoil(r) for r in synthesize(rigged, seed)], experiment.settings(), Context("design", {})
    )
    for name in design.nulls:
        told = found.find(name)
        assert told, name
        assert all(p.value is None and p.std_error is None and p.ci95 is None for p in told), name
    assert any(design.reason in p.description for name in design.nulls for p in found.find(name))
    assert any(design.advice in text for text in found.advice), found.advice
    truth = truth_of(rigged, seed)
    for p in found.parameters:
        true = truth(p) if p.value is not None else None
        if p.std_error and isinstance(true, float) and math.isfinite(true):
            assert abs(p.value - true) <= 3.0 * p.std_error, (p.name, dict(p.at), p.value, p.std_error, true)


@pytest.mark.parametrize(
    ("truth", "reason"),
    [({"control": "none"}, "control"), ({"replicates": 1}, "cultur")],
    ids=["cytotoxicity: no control", "cytotoxicity: one culture each"],
)
def test_cells_without_control_or_repeats_tell_no_equivalence(truth: dict[str, Any], reason: str) -> None:
    experiment = rap_cytotoxicity.STUDY.experiment
    found = experiment.identify(rig.synthesize_cytotoxicity(truth, 3), experiment.settings(), Context("design", {}))
    assert all(p.ci95 is None for p in found.find("viability_difference"))
    assert any(reason in text for p in found.find("viability_difference") for text in (p.description, *found.advice))
    assert found.verdict != "ok"
