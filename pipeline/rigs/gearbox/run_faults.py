"""What the numbers of a run give away about its data (gearbox.md, 8): offsets, steps of the protocol, clocks, saturation, slip in FOS.

Wrong signs and units are found before, in `faults`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from pipeline.recording import Level as Level_
from pipeline.recording import QualityFinding
from pipeline.rigs.gearbox.aligned_run import within
from pipeline.rigs.gearbox.load.checks import Misfit, dissipated_power, inertia_parts, ripple_share, slopes
from pipeline.rigs.gearbox.model.teeth import assembly_faults, interference_warnings
from pipeline.rigs.gearbox.record import COUNT, SPEED, TORQUES
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.stages.stage import Problem
from pipeline.rigs.gearbox.torques.lost_samples import standing_still
from pipeline.rigs.gearbox.torques.ripple import learn
from pipeline.rigs.gearbox.vibration.shaft_speed import mistake, true_speed
from pipeline.rigs.gearbox.vibration.sos_speed import teeth_in
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers

# Output torque in FOS that grows by more than that share: the brake may still rub. Less is warming up or drift, a
# warning from the second share on.
_HELD, _DRIFTS = 0.15, 0.05
# Hum below that share of the torque in FOS is a note.
_HUMS = 0.1
# The encoder agrees with the speed that was set within that share.
_SET = 0.15
_WARMS = (
    "its zero was read at both ends of the run, so bearings or gears warm up, or the zero moves in no straight line"
)
_OPEN = (
    "its zero drifts, or bearings warm up, which a standstill at the end of the log would tell. All torques of this channel, and "
    "what follows from them, carry that in their intervals, and the load fit leaves it out"
)


def run_faults(run: RunNumbers, vibration: VibrationNumbers) -> list[QualityFinding]:
    """Return what is wrong with a run whose channels are sound."""
    encoder = COUNT if run.record.has_counts else SPEED
    return [
        *_told(run, run.broken_off, None),
        *_told(run, run.counts.problems, encoder),
        *_told(run, run.alignment.problems, None),
        *_told(run, [one for one in run.segmentation.problems if one not in run.counts.problems], None),
        *_told(run, run.offsets.problems, None),
        *_hums(run),
        *_still(run),
        *_saturated(run),
        *_drifts(run),
        *vibration.findings,
        *_slips(run, vibration),
        *_aliased(run, vibration),
        *_misfits(run),
        *_teeth(run),
    ]


def _told(run: RunNumbers, problems: Iterable[Problem], channel: str | None) -> list[QualityFinding]:
    return [
        QualityFinding(
            problem.level, problem.message, run.name, channel, (float(problem.span[0]), float(problem.span[1]))
        )
        for problem in problems
    ]


def speed_faults(run: RunNumbers) -> list[QualityFinding]:
    """Tell an encoder, or a unit of speed, that ripple and mesh lines contradict."""
    true = true_speed(run.record, run.run, run.torques.steady)
    if true is None:
        return []
    channel = COUNT if run.record.has_counts else SPEED
    known, counted = mistake(true.factor), run.run.speed_nominal
    set_ = run.record.speed_nominal
    told = f"the shafts turn {true.factor:.3g} times as fast as the encoder says ({counted:.4g} rad/s in FOS): {true.shown_by}"
    if run.record.has_counts:
        cause = (
            f"encoder_ppr times encoder_decoding ({run.record.counts_per_turn:g} counts a turn) is wrong by that factor; "
            f"{run.record.counts_per_turn / (known or true.factor):.4g} fits"
        )
    else:
        units = {math.pi / 30.0: "rpm", 2.0 * math.pi: "Hz"}
        cause = f"the speed is in {units[known]} and not in rad/s" if known in units else "look at its unit and scale"
    borne_out = set_ is not None and abs(counted / set_ - 1.0) < _SET
    grave: Level_ = "error" if known is not None and not borne_out else "warning"
    if borne_out:
        cause = f"yet speed_nominal bears the encoder out; if both are wrong, {cause}"
    return [QualityFinding(grave, f"{told}; {cause}", run.name, channel, run.run.stages.get("fos"))]


def _hums(run: RunNumbers) -> list[QualityFinding]:
    found = []
    for name, hum in run.hums.items():
        level = run.levels.get((name, _first_fos(run)))
        slight = level is not None and hum.amplitude < _HUMS * abs(level.value)
        text = (
            f"{name} hums with {hum.amplitude:.2g} N m at {hum.frequency:.4g} Hz all through the log, also at rest: the mains, not the "
            "gearbox. It was taken off; look at the shield and the ground of the sensor's cable"
        )
        found.append(QualityFinding("note" if slight else "warning", text, run.name, name))
    return found


def _still(run: RunNumbers) -> list[QualityFinding]:
    """Tell torques whose reading stands still while the other goes on."""
    found = []
    for name in TORQUES:
        for start, end in standing_still(run.record.torque.time, run.record.torque[name]):
            text = (
                f"{name} stands still from {start:.4g} to {end:.4g} s, without even noise: the sensor, its cable or its converter hangs; what "
                "needs it there is left out"
            )
            found.append(QualityFinding("warning", text, run.name, name, (start, end)))
    return found


def _saturated(run: RunNumbers) -> list[QualityFinding]:
    found = []
    for (quantity, stage), peak in run.peaks.items():
        if peak.saturated:
            text = f"flat top at {peak.raw:.3g} N m in the {stage} peak: saturated, the peak is a lower bound"
            found.append(QualityFinding("warning", text, run.name, quantity, (peak.time - 0.05, peak.time + 0.05)))
    return found


def _drifts(run: RunNumbers) -> list[QualityFinding]:
    """Tell torques that change at equal speed: a brake that still rubs, else warming up or a zero that drifts."""
    found = []
    rubs = _rubs(run)
    for quantity, drift in run.torques.drifts.items():
        level, after = run.levels[quantity, _first_fos(run)], run.levels.get((quantity, "fos_after"))
        last = (after or level).span[1]
        change = drift.change(last) - drift.change(level.span[0])
        share = abs(change) / abs(level.value) if level.value else math.inf
        grave: Level_ = "warning" if share > _DRIFTS else "note"
        offset = getattr(run.offsets, quantity)
        known = offset is not None and offset.before is not None and offset.after is not None
        if quantity == "torque_out" and rubs:
            text = (
                f"the brake does not free the load (step 6 of the protocol, brake off): FOS after SOS is {1e3 * change:+.0f} mN m "
                f"above FOS before ({drift.sigmas:+.1f} sigma), and the input torque rises with it"
            )
        elif rubs:
            text = f"the input torque at equal speed rises by {1e3 * change:+.0f} mN m over SOS, with the brake that does not free the load"
        else:
            how = "steadily" if drift.shape == "line" else "over SOS"
            text = (
                f"the locked torque at equal speed changes {how}, by {change:+.3f} N m from FOS to FOS after SOS ({drift.sigmas:+.1f} "
                "sigma): " + (_WARMS if known else _OPEN)
            )
        found.append(QualityFinding(grave, text, run.name, quantity, (level.span[0], last)))
    return found


def _first_fos(run: RunNumbers) -> str:
    return "fos" if ("torque_in", "fos") in run.levels else "fos_after"


def _rubs(run: RunNumbers) -> bool:
    """Tell whether a brake explains a rise of the output torque: it comes over SOS, and the input torque carries it."""
    carried, driving = run.torques.drifts.get("torque_out"), run.torques.drifts.get("torque_in")
    before, after = run.levels.get(("torque_out", "fos")), run.levels.get(("torque_out", "fos_after"))
    if not carried or not driving or not before or not after:
        return False
    rise_out, rise_in = (one.change(after.span[1]) - one.change(before.span[0]) for one in (carried, driving))
    over_sos = "step" in (carried.shape, driving.shape)
    return over_sos and rise_out > _HELD * abs(before.value) and rise_in > 0.5 * rise_out


def _slips(run: RunNumbers, vibration: VibrationNumbers) -> list[QualityFinding]:
    if vibration.partial is None:
        return []
    slip = vibration.partial.speed
    text = (
        f"not fully locked; eta_FOS is not a rigid-body value: mesh lines in FOS at {slip:.3g} rad/s of slip (comb "
        f"{vibration.partial.contrast:.0f} times the noise)"
    )
    return [QualityFinding("warning", text, run.name, vibration.channel, run.run.stages.get("fos"))]


def _aliased(run: RunNumbers, vibration: VibrationNumbers) -> list[QualityFinding]:
    log = run.record.vibration
    if log is None or not vibration.aliased:
        return []
    lines = ", ".join(f"order {order:g} at {frequency:.4g} Hz" for order, frequency in vibration.aliased)
    text = (
        f"aliased vibration: mesh lines above half the sampling rate ({log.rate:.4g} Hz) show folded back ({lines}). Sample faster, "
        "with an anti-alias filter"
    )
    return [QualityFinding("warning", text, run.name, vibration.channel, run.run.stages.get("sos"))]


def _misfits(run: RunNumbers) -> list[QualityFinding]:
    """Return what contradicts the model, as `checks` says it."""
    found: list[tuple[Misfit, Level_, str]] = []
    parts, transfers = run.load_parts, run.transfers
    if {"startup", "release"} <= set(parts):
        found.append((inertia_parts(parts["startup"], parts["release"]), "warning", "torque_out"))
    if {"startup", "brake"} <= set(transfers):
        found.append((slopes(transfers["startup"], transfers["brake"]), "warning", "torque_out"))
    t_in, t_out = (run.levels.get((name, "fos")) for name in TORQUES)
    for name, level_ in zip(TORQUES, (t_in, t_out), strict=True):
        if level_ is not None:
            inside = within(run.run.time, level_.span)
            amplitude = learn(run.run.angle_at(run.run.time[inside]), getattr(run.run, name)[inside]).amplitude
            found.append((ripple_share(amplitude, level_.value, name), "warning", name))
    if t_in and t_out and not any(math.isnan(run.zero(name)) for name in TORQUES):
        found.append((dissipated_power(t_in, t_out, run.speed_out[0]), "error", "torque_out"))
    return [
        QualityFinding(level, f"{one.text} ({one.value:+.1f} {one.unit}, limit {one.limit:.1f})", run.name, channel)
        for one, level, channel in found
        if one.failed
    ]


def _teeth(run: RunNumbers) -> list[QualityFinding]:
    teeth = teeth_in(run.record)
    found = [QualityFinding("warning", text) for text in assembly_faults(teeth)]
    return found + [QualityFinding("note", text) for text in interference_warnings(teeth)]
