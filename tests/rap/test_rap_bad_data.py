"""Bad data, row by row of the fact sheet's section 8: the fault put in, the message that names it, no wrong number told as good.

Each row: where the fault is made, words of the message, the channel and the moment (s, its own clock) that it names, the
verdict. Whatever is still determined holds the truth within three standard errors, or the verdict is `rejected`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from pressure_logs import ML_MIN, edited

from benchmarks.coverage.studies import rap_cytotoxicity, rap_flow, rap_pressures, rap_therapy
from pipeline.errors import InputError
from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.synthetic import rig

EXPERIMENTS = {
    "pressures": (rap_pressures.STUDY.experiment, rig.synthesize_pressures, lambda t, _seed: rap_pressures.known(t)),
    "flow": (rap_flow.STUDY.experiment, rig.synthesize_flow, rap_flow.known),
    "therapy": (rap_therapy.STUDY.experiment, rig.synthesize_therapy, rap_therapy.known),
}
USUAL: dict[str, dict[str, Any]] = {
    "pressures": {"flows": (60.0 * ML_MIN, 100.0 * ML_MIN), "duration": 260.0},
    "flow": {"sets": ["calibration", "holdout"], "hold": 30.0, "meter_gain": 1.0},
    "therapy": {"runs": ["rap_therapy_312"], "duration": 2400.0, "initial_volume": 0.2e-3, "meter_gain": 1.0},
}
PREFILTER, ACCESS, UF = (f"pressure_{tap}_rap" for tap in ("prefilter", "access", "uf"))
TANK = {"tables": ["device_status", "device_temperature", "bench_temperature", "scale", "events"]}
SECTION_8 = 20
AT_THE_TANK = ("drain", "echo_lost", "tilt", "uf_without_blood")
Spoil = Callable[[Recording], Recording]


def fault(kind: str, **how: Any) -> dict[str, Any]:
    return {"faults": [{"kind": kind, **how}]}


@dataclass(frozen=True)
class Row:
    """`number` and `words` of the sheet's row; `truth` overrides the rig, `spoil` its finished logs; `really` is the truth where the fault is the rig's own."""

    number: int
    words: str
    experiment: str
    says: str
    truth: dict[str, Any] = field(default_factory=dict)
    spoil: Spoil = lambda r: r
    channel: str | None = None
    at: float | None = None
    verdict: Sequence[str] = ("warning",)
    level: Sequence[str] = ("warning", "error")
    nulls: Sequence[str] = ()
    refused: bool = False
    really: Callable[[Parameter], float | None] = lambda _p: None


def middle(recording: Recording) -> Recording:
    """Return a minute of one speed, without start or stop."""

    def cut(_stream: str, time: np.ndarray, columns: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        kept = (time > 40.0) & (time < 110.0)
        return time[kept], {name: values[kept] for name, values in columns.items()}

    return edited(recording, cut)


def as_rotor(recording: Recording) -> Recording:
    """Return flows three times as large: the strokes seen are then the rotor's turns."""

    def thrice(
        _stream: str, time: np.ndarray, columns: dict[str, np.ndarray]
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        return time, {n: 3.0 * v if n in ("blood_flow_bench", "blood_flow_set") else v for n, v in columns.items()}

    return edited(recording, thrice)


def lifted(by: float) -> Callable[[Parameter], float | None]:
    """Return the offset of a device whose pre-filter sensor stands so many pascal higher."""
    return lambda p: 80.0 + by if p.name == "offset" and p.at["channel"] == "prefilter" else None


ROWS = [
    Row(1, "wrong correlation peak", "pressures", "include a pump start", {"uf_flow": 0.0}, middle, nulls=("lag", "gain", "offset")),
    Row(2, "clock drift ignored", "pressures", "rate error -1", {"device_ppm": -150.0}, verdict=("ok", "warning"), level=("note", "warning")),
    Row(3, "swapped pre/return", "pressures", "pre-filter and return exchanged?", fault("swapped"), channel=PREFILTER, verdict=("rejected",)),
    Row(3, "swapped pre/return", "flow", "exchanged", fault("swapped"), refused=True),
    Row(3, "swapped pre/return", "therapy", "exchanged", fault("swapped"), nulls=("k_uf_initial",)),
    Row(4, "access sign flipped", "pressures", "access must be negative", fault("sign"), channel=ACCESS, verdict=("rejected",)),
    Row(5, "mmHg labelled Pa", "pressures", "unit mix-up, factor 133", fault("mmhg"), verdict=("rejected",)),
    Row(5, "kPa labelled Pa", "pressures", "unit mix-up, factor 1000", fault("kpa"), verdict=("rejected",)),
    Row(5, "mmHg labelled Pa", "therapy", "133", fault("mmhg"), nulls=("k_uf_initial",)),
    Row(6, "stuck", "pressures", "channel frozen", fault("stuck"), channel=UF, at=100.0),
    Row(6, "stuck", "therapy", "frozen", fault("stuck"), channel=UF, nulls=("k_uf_initial",)),
    Row(6, "saturated", "pressures", "channel saturated", fault("saturated"), channel=PREFILTER),
    Row(7, "zero not taken", "pressures", "zero not taken", fault("zero_not_taken", channel=PREFILTER), channel=PREFILTER, really=lifted(300.0)),
    Row(8, "air bubble at transducer", "pressures", "Compliance changed; E2 invalid", fault("air_at_sensor", start=130.0), channel=PREFILTER, at=130.0),
    Row(8, "air bubble at transducer", "flow", "compliance changed", fault("air_at_sensor", start=0.0, run="rap_flow_val")),
    Row(8, "air bubble in the circuit", "flow", "compliance changed", fault("air_bubble", run="rap_flow_val")),
    Row(9, "sub-harmonic pick", "flow", "rotor", {}, as_rotor, verdict=("rejected",)),
    Row(10, "aliasing", "pressures", "anti-alias filter", fault("aliasing")),
    Row(11, "dropped samples", "pressures", "gap of", fault("dropout"), at=150.0, verdict=("ok", "warning"), level=("note", "warning")),
    Row(11, "duplicated samples", "pressures", "duplicated", fault("duplicated"), at=150.0),
    Row(12, "MCU skew", "pressures", "skew +", {"skew": 0.010}, verdict=("ok", "warning"), level=("note", "warning")),
    Row(13, "tank emptied, no drain_pressed", "therapy", "without drain_pressed", {**fault("drain", start=1200.0, end=1240.0, key=False), **TANK}, at=1220.0),
    Row(14, "echo lost", "therapy", "level-blind for", {**fault("echo_lost", start=800.0, end=2200.0), **TANK}, channel="uf_level_distance", at=1000.0, level=("note", "warning")),
    Row(14, "foam", "therapy", "of the echoes are wild", {"wild_echoes": 0.25, **TANK}, channel="uf_level_distance"),
    Row(15, "tilt > 12 deg", "therapy", "tilt over 12 deg", {**fault("tilt", start=800.0, end=1100.0), **TANK}, at=900.0, level=("note", "warning")),
    Row(16, "scale touched", "therapy", "scale disturbed", {**fault("scale_touched", start=1200.0, end=2500.0), **TANK}, channel="uf_mass_scale", at=1200.0),
    Row(16, "scale drifts", "therapy", "drift apart", {**fault("scale_drift", size=0.04), **TANK}, channel="uf_mass_scale"),
    Row(17, "UF rate set vs scale > 5 %", "therapy", "UF pump gain 0.8", {"pump_gain": 0.85, "closed_loop": False, **TANK}, channel="uf_flow_set"),
    Row(18, "meter on return line", "pressures", "meter reads Q_b - Q_uf", {"flowmeter_location": "return", "told": {"flowmeter_location": "access"}}),
    Row(18, "meter on return line", "flow", "meter reads Q_b - Q_uf", {"flowmeter_location": "return", "uf_flow": 5.0 * ML_MIN, "told": {"flowmeter_location": "access"}}, verdict=("warning", "rejected")),
    Row(19, "blood pump off but UF on", "therapy", "UF without circulation", fault("uf_without_blood", start=600.0, end=630.0), at=600.0),
]  # fmt: skip


@pytest.mark.parametrize("row", ROWS, ids=[f"{row.number} {row.words} ({row.experiment})" for row in ROWS])
def test_a_fault_is_named_and_no_wrong_number_is_told_as_good(row: Row) -> None:
    experiment, synthesize, truth_of = EXPERIMENTS[row.experiment]
    rigged = {**USUAL[row.experiment], **row.truth}
    recordings = [row.spoil(r) for r in synthesize(rigged, 3)]
    if row.refused:
        with pytest.raises(InputError, match=row.says):
            experiment.identify(recordings, experiment.settings(), Context("bad", {}))
        return
    found = experiment.identify(recordings, experiment.settings(), Context("bad", {}))
    named = [q for q in found.quality if row.says.lower() in q.message.lower()]
    assert any(q.level in row.level for q in named), [q.message for q in found.quality]
    assert {q.run for q in named} <= {None, *(r.run for r in recordings)}
    assert row.channel is None or any(row.channel in (q.channel, *q.message.replace(",", " ").split()) for q in named)
    if row.at is not None:
        spans = [q.span for q in named if q.span is not None]
        assert any(start - 20.0 <= row.at <= end + 20.0 for start, end in spans), spans
    assert found.verdict in row.verdict, found.reasons
    for name in row.nulls:
        assert all(p.value is None for p in found.find(name)), name
    if found.verdict == "rejected":
        return
    # Faults at the tank happen to the truth as well; those of sensors and logs do not.
    happened = [one for one in rigged.get("faults", ()) if one["kind"] in AT_THE_TANK]
    truth = truth_of({**rigged, "faults": happened}, 3)
    for p in found.parameters:
        true = row.really(p) or truth(p)
        if p.value is not None and p.std_error and isinstance(true, float) and math.isfinite(true):
            assert abs(p.value - true) <= 3.0 * p.std_error, (p.name, dict(p.at), p.value, p.std_error, true)


@pytest.mark.parametrize(("factor", "says"), [(1.1, "more than 100 %"), (0.8, "do not sum to 100 %")], ids=["20 viability > 100 %", "20 fractions not summing"])  # fmt: skip
def test_shares_of_cells_that_cannot_be_are_named(factor: float, says: str) -> None:
    def counted(
        _stream: str, time: np.ndarray, columns: dict[str, np.ndarray]
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        return time, {name: factor * v if name == "viability" else v for name, v in columns.items()}

    experiment = rap_cytotoxicity.STUDY.experiment
    recordings = [edited(r, counted) for r in rig.synthesize_cytotoxicity({}, 3)]
    found = experiment.identify(recordings, experiment.settings(), Context("bad", {}))
    assert any(says in q.message and "gating" in q.message for q in found.quality)
    assert found.verdict == "warning"


def test_every_row_of_the_sheet_is_here() -> None:
    assert {row.number for row in ROWS} | {20} == set(range(1, SECTION_8 + 1))
