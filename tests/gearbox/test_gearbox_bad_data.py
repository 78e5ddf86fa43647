"""Every row of the sheet's table of bad data (gearbox.md, 8): the fault is named, and no wrong number is told as good."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from benchmarks.coverage.studies.gearbox_load_exchange import Truth
from pipeline.errors import InputError
from pipeline.findings import Parameter
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.check import check
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import gearbox_truth

PLAIN = {"runs": ("g3",), "vibration": False}
SEED = 5
Change = Callable[[Recording], Recording]


def as_it_is(recording: Recording) -> Recording:
    return recording


def stated(**conditions: Any) -> Change:
    return lambda recording: replace(recording, conditions={**recording.conditions, **conditions})


def in_another_unit(factor: float) -> Change:
    def change(recording: Recording) -> Recording:
        stream = recording.streams["encoder"]
        channel = Channel("speed_out", factor * stream.channels["speed_out"].values, "rad/s")
        streams = {**recording.streams, "encoder": Stream("encoder", stream.time, {"speed_out": channel})}
        return replace(recording, streams=streams)

    return change


@dataclass(frozen=True)
class Row:
    """One row of the sheet: how the fault comes into the log, what is said of it, and what may not be told.

    `refused` rows leave nothing to identify. `null` are parameters (with their operating point) without a value, `bound` without an
    interval. `wrong` begin the names of those that the fault makes wrong and that nothing in one log can tell: the verdict asks for what can.
    """

    truth: Mapping[str, Any]
    words: str
    change: Change = as_it_is
    refused: bool = False
    null: Sequence[tuple[str, Mapping[str, str]]] = ()
    bound: Sequence[tuple[str, Mapping[str, str]]] = ()
    wrong: Sequence[str] = ()


def _names(*names: str) -> list[tuple[str, Mapping[str, str]]]:
    return [(name, {}) for name in names]


OF_SOS = _names("slip_torque", "torque_ratio_sos", "power_dissipated_sos", "torque_relief_in", "lock_torque")
ROWS = {
    "1 torque channels swapped": Row(
        {"swap_torques": True}, "Output torque exceeds input torque at equal speed; channels swapped", refused=True
    ),
    "2 sign of torque_in wrong": Row({"gain_in": -1.0}, "using -torque_in is suggested", refused=True),
    "2 sign of torque_out wrong": Row({"gain_out": -1.0}, "using -torque_out is suggested", refused=True),
    "3 offset drift": Row({"offset_change_in": 0.1, "duration": 34.0}, "the zero of torque_in drifts from"),
    "4 no standstill": Row(
        {"fixture": "no_standstill", "rundown_start": 28.0, "duration": 28.5},
        "no standstill tells the zero of torque_in and torque_out",
        null=_names("efficiency_fos", "torque_ratio_sos"),
        bound=[("torque_in_nominal", {"stage": "fos"}), ("torque_out_nominal", {"stage": "sos"})],
    ),
    "5 gain error": Row(
        {"fixture": "gain_error"},
        "or a torque sensor has the wrong gain",
        wrong=("torque_out", "inertia", "drag_", "efficiency", "torque_ratio", "torque_transfer", "slip", "lock", "startup_excess_out"),
    ),
    "6 saturation": Row(
        {"torque_span": 4.0},
        "saturated",
        null=[*_names("lock_torque", "torque_relief_in", "breakaway_rise_in"), ("event_time", {"event": "unlock"})],
        bound=[("torque_in_peak", {"stage": "brake"})],
    ),
    "7 encoder decoded x1": Row({}, "by the factor 4; 512 fits", stated(encoder_decoding=1.0), refused=True),
    "7 encoder decoded x2": Row({}, "by the factor 2; 512 fits", stated(encoder_decoding=2.0), refused=True),
    "7 wrong pulses a turn": Row({}, "by the factor", stated(encoder_ppr=64.0), refused=True),
    "8 speed in rpm": Row({"speed_only": True}, "the speed is in rpm", in_another_unit(60 / (2 * np.pi)), refused=True),
    "8 speed in Hz": Row({"speed_only": True}, "the speed is in Hz", in_another_unit(1 / (2 * np.pi)), refused=True),
    "9 encoder dropout": Row({"fixture": "encoder_dropout"}, "a dropout, not a stop"),
    "9 encoder dropout, counts lost": Row({"fixture": "encoder_dropout", "dropout_lost": True}, "not a stop"),
    "10 clock offset between boards": Row({"encoder_shift": 0.3}, "encoder board"),
    "11 aliased vibration": Row({"vibration": True, "vibration_rate": 800.0}, "aliased vibration"),
    "12 brake never unlocks": Row({"fixture": "weak_brake"}, "step 4", null=OF_SOS),
    "12 brake never frees": Row(
        {"brake_off": 60.0, "rundown_start": 28.0},
        "step",
        null=[("torque_in_nominal", {"stage": "fos_after"}), ("event_time", {"event": "relock"})],
    ),
    "13 partial slip in FOS": Row({"vibration": True, "creep": 0.5}, "not fully locked; eta_FOS is not a rigid-body value"),
}  # fmt: skip


@pytest.mark.parametrize("name", ROWS)
def test_the_row_of_the_sheet_is_named_and_no_wrong_number_is_told_as_good(name: str) -> None:
    row = ROWS[name]
    options = {**PLAIN, **row.truth}
    recording = row.change(synthesize(options, SEED)[0])
    if row.refused:
        _is_refused(recording, row.words)
        return
    findings = identify([recording], LoadExchangeSettings(), Context("test", {}))
    said = [*findings.reasons, *(f"{q.channel} {q.message}" for q in findings.quality if q.level != "note")]
    assert any(row.words in one for one in said), said
    assert findings.verdict != "ok"
    for parameter, at in row.null:
        (found,) = findings.find(parameter, run="g3", **at)
        assert found.value is None
        assert len(found.description) > 20
    for parameter, at in row.bound:
        (found,) = findings.find(parameter, run="g3", **at)
        assert found.ci95 is None
    known = gearbox_truth(options)
    truth = Truth(known, {run.name: run for run, _ in known_runs(known, SEED)})
    wrong = [
        _told(p)
        for p in findings.parameters
        if not p.name.startswith(tuple(row.wrong) or ("-",)) and not _holds(p, truth)
    ]
    assert not wrong


def _is_refused(recording: Recording, words: str) -> None:
    with pytest.raises(InputError) as caught:
        identify([recording], LoadExchangeSettings(), Context("test", {}))
    assert words in str(caught.value)
    (first, *_) = [finding.message for finding in check(recording) if finding.level == "error"]
    assert first.removeprefix(f"run '{recording.run}' ").rstrip(".")[:60] in str(caught.value)


def _holds(p: Parameter, truth: Truth) -> bool:
    """Tell whether a number with an interval is right: within three standard errors, or one and a half intervals."""
    if p.value is None or p.ci95 is None or p.std_error is None or p.name == "vibration_rms":
        return True
    true = truth.of(p)
    if true is None or math.isnan(true):
        return True
    middle, half = 0.5 * (p.ci95[0] + p.ci95[1]), 0.5 * (p.ci95[1] - p.ci95[0])
    return abs(middle - true) <= max(3.0 * p.std_error, 1.5 * half)


def _told(p: Parameter) -> str:
    return f"{p.name} {p.at} {p.value} +- {p.std_error}"


def test_the_sound_run_of_which_all_others_are_made_has_none_of_these_messages() -> None:
    recording = synthesize({**PLAIN, "vibration": True}, SEED)[0]
    findings = identify([recording], LoadExchangeSettings(), Context("test", {}))
    assert not [q.message for q in findings.quality if q.level != "note"]
    assert not [
        row.words for row in ROWS.values() for one in findings.reasons if row.words in one and "gain" not in row.words
    ]
