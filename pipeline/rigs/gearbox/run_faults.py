"""What the numbers of a run give away about its data (gearbox.md, 8): offsets, steps of the protocol, clocks, saturation, slip in FOS.

Wrong signs and units are found before, in `faults`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from pipeline.recording import QualityFinding
from pipeline.rigs.gearbox.nominal import difference_in_sigmas
from pipeline.rigs.gearbox.record import COUNT, SPEED, TORQUES
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.sos_speed import teeth_in
from pipeline.rigs.gearbox.stages import Problem
from pipeline.rigs.gearbox.teeth import assembly_faults, interference_warnings
from pipeline.rigs.gearbox.vibration_numbers import VibrationNumbers

_CLEAR = 3.0
# A change of the FOS torque below that share is warming up, beyond it the brake may still rub.
_HELD = 0.15
# Stages that tell one another apart in the trust of an inertia, sigmas.
_INERTIA = 3.0


def run_faults(run: RunNumbers, vibration: VibrationNumbers) -> list[QualityFinding]:
    """Return what is wrong with a run whose channels are sound."""
    encoder = COUNT if run.record.has_counts else SPEED
    return [
        *_told(run, run.counts.problems, encoder),
        *_told(run, run.alignment.problems, None),
        *_told(run, run.segmentation.problems, None),
        *_told(run, run.offsets.problems, None),
        *_offsets(run),
        *_saturated(run),
        *_not_freed(run),
        *_slips(run, vibration),
        *_aliased(run, vibration),
        *_inertia(run),
        *_dissipation(run),
        *_teeth(run),
    ]


def _told(run: RunNumbers, problems: Iterable[Problem], channel: str | None) -> list[QualityFinding]:
    return [
        QualityFinding(
            problem.level, problem.message, run.name, channel, (float(problem.span[0]), float(problem.span[1]))
        )
        for problem in problems
    ]


def _offsets(run: RunNumbers) -> list[QualityFinding]:
    found = []
    missing = [name for name in TORQUES if getattr(run.offsets, name) is None]
    if missing:
        text = (
            "no stretch of zero torque and zero speed before the motor starts: zero offsets unknown. Efficiency, torque ratios and "
            "T_0 are not given; differences of one sensor are still valid. Log 2 s or more at rest before each run"
        )
        found.append(QualityFinding("warning", text, run.name, missing[0] if len(missing) == 1 else None))
    return found


def _saturated(run: RunNumbers) -> list[QualityFinding]:
    found = []
    for (quantity, stage), peak in run.peaks.items():
        if peak.saturated:
            text = f"flat top at {peak.raw:.3g} N m in the {stage} peak: saturated, the peak is a lower bound"
            found.append(QualityFinding("warning", text, run.name, quantity, (peak.time - 0.05, peak.time + 0.05)))
    return found


def _not_freed(run: RunNumbers) -> list[QualityFinding]:
    """Compare FOS before and after SOS: a brake that still rubs, or a change by heating or drift."""
    found = []
    for quantity in TORQUES:
        before, after = run.levels.get((quantity, "fos")), run.levels.get((quantity, "fos_after"))
        if before is None or after is None:
            continue
        sigmas = difference_in_sigmas(before, after)
        change = after.value - before.value
        if abs(sigmas) < _CLEAR:
            continue
        rubs = quantity == "torque_out" and change > _HELD * abs(before.value)
        what = (
            "the brake does not free the load (step 6 of the protocol: brake off)"
            if rubs
            else "heating of the gears, or drift of the sensor"
        )
        text = f"FOS after SOS is {1e3 * change:+.0f} mN m from FOS before ({sigmas:+.1f} sigmas): {what}"
        found.append(QualityFinding("warning" if rubs else "note", text, run.name, quantity, after.span))
    return found


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


def _inertia(run: RunNumbers) -> list[QualityFinding]:
    """Compare the inertia of start-up with that of release."""
    parts = run.load_parts
    if not {"startup", "release"} <= set(parts):
        return []
    values = [float(parts[name].values[0]) for name in ("startup", "release")]
    errors = [float(parts[name].covariance.std_error[0]) for name in ("startup", "release")]
    spread = math.hypot(*errors)
    sigmas = (values[1] - values[0]) / spread if spread > 0 else 0.0
    if abs(sigmas) < _INERTIA or abs(values[1] - values[0]) < 0.05 * abs(values[0]):
        return []
    text = (
        f"the load's inertia is {1e3 * values[0]:.3g} g m2 from start-up and {1e3 * values[1]:.3g} g m2 from release ({sigmas:+.1f} "
        "sigmas): the brake is not free in one of them, or drag that grows with load is taken for inertia"
    )
    return [QualityFinding("warning", text, run.name, "torque_out", run.run.stages.get("release"))]


def _dissipation(run: RunNumbers) -> list[QualityFinding]:
    """Refuse heat that the gears would give: more power out than in."""
    t_in, t_out = run.level("torque_in", "fos"), run.level("torque_out", "fos")
    if t_in is None or t_out is None or math.isnan(t_in.zero):
        return []
    excess = t_out.value - t_in.value
    if excess < _CLEAR * math.hypot(t_in.std_error, t_out.std_error):
        return []
    text = (
        f"more power comes out than goes in: {t_out.value:.3g} N m out, {t_in.value:.3g} N m in at equal speed; channels swapped, "
        "or a sensor's gain"
    )
    return [QualityFinding("error", text, run.name, "torque_out", run.run.stages.get("fos"))]


def _teeth(run: RunNumbers) -> list[QualityFinding]:
    if "teeth" not in run.record.conditions:
        return []
    teeth = teeth_in(run.record)
    found = [QualityFinding("warning", text) for text in assembly_faults(teeth)]
    return found + [QualityFinding("note", text) for text in interference_warnings(teeth)]
