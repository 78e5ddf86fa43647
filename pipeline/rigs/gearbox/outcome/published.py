"""Published numbers and claims beside what these logs give (gearbox.md, 4); the paper's own arithmetic stands in `paper`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.findings import Parameter, Published
from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers
from pipeline.rigs.gearbox.outcome.paper import (
    BRAKE,
    EFFICIENCY,
    FOS,
    FRICTION_TORQUE,
    INERTIAL_MASS,
    REDUCTION,
    RPM,
    SOS,
    SPEEDS,
    STARTUP,
    TORQUES,
    paper_alone,
    paper_line,
)
from pipeline.rigs.gearbox.outcome.paper_kinematics import kinematics_alone
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers

# A run is held against the paper where its speed is that close, and agrees where a number is that close:
# another bench, other ramps, another brake.
_NEAR, _AGREES = 0.03, 0.10
Known = Mapping[tuple[str, Any, Any], Parameter]
_TORQUES = (
    (STARTUP, "torque_{}_peak", "startup"), (FOS, "torque_{}_nominal", "fos"), (BRAKE, "torque_{}_peak", "brake"),
    (SOS, "torque_{}_nominal", "sos"),
)  # fmt: skip


def published(
    campaign: CampaignNumbers, parameters: Sequence[Parameter], vibration: Mapping[str, VibrationNumbers]
) -> list[Published]:
    """Return what the logs say of the paper's numbers and claims, then the checks of the paper alone."""
    by: Known = {(p.name, p.at.get("run"), p.at.get("stage")): p for p in parameters if "phase" not in p.at}
    rows: list[Published] = []
    for rpm in SPEEDS:
        run = next((run for run in campaign.runs if abs(run.speed / RPM / rpm - 1.0) < _NEAR), None)
        if run is not None:
            rows += _of_run(run.name, rpm, by)
    return [
        *rows,
        *_line(campaign),
        *_speeds(campaign),
        *_vibration(campaign, vibration),
        *paper_alone(),
        *kinematics_alone(),
    ]


def _of_run(run: str, rpm: int, by: Known) -> list[Published]:
    rows = []
    for state, name, stage in _TORQUES:
        for side, words in enumerate(("in", "out")):
            found = by.get((name.format(words), run, stage))
            rows.append(_row(f"{state}, {words}put, {rpm} rpm ({run})", TORQUES[state][rpm][side], found, "N*m", ""))
    for side, words in ((1, "out"), (0, "in")):
        relief, residual = (
            by.get((f"torque_relief_{words}", run, None)),
            by.get((f"torque_residual_{words}", run, None)),
        )
        printed = REDUCTION[rpm][side]
        told = (
            f"relief 1 - nominal/peak; the paper printed the residual, which is {100 * residual.value:.1f} % here"
            if residual and residual.value is not None
            else "the paper printed the residual, nominal over peak"
        )
        rows.append(_row(f"torque reduction, {words}put, {rpm} rpm ({run})", printed, relief, "%", told))
    fos, sos = by.get(("efficiency_fos", run, None)), by.get(("torque_ratio_sos", run, None))
    told = "power efficiency while locked"
    if sos is not None and sos.value is not None:
        told += f"; the paper's 40 % is a torque ratio in SOS, here {100 * sos.value:.1f} %"
    rows.append(_row(f"efficiency, {rpm} rpm ({run})", EFFICIENCY, fos, "%", told))
    if rpm == SPEEDS[0]:
        excess, drop, rise = (
            by.get((name, run, None)) for name in ("startup_excess_in", "breakaway_drop_in", "breakaway_rise_in")
        )
        told = "start-up peak less FOS nominal: a torque, no inertia; not reproduced by the paper's own torques (0.44)"
        rows.append(_row(f'"inertial mass" M_I, {rpm} rpm ({run})', INERTIAL_MASS, excess, "N*m", told))
        told = "brake peak less SOS nominal, as defined"
        if rise is not None and rise.value is not None:
            told += f"; the paper's number is the peak less the FOS nominal, here {rise.value:.3f} N m"
        rows.append(_row(f"friction torque T_f, {rpm} rpm ({run})", FRICTION_TORQUE, drop, "N*m", told))
    return rows


def _row(name: str, printed: float, found: Parameter | None, unit: str, told: str) -> Published:
    value = found.value if found else None
    agrees = None
    remark = told
    if found is not None and value is None:
        remark = f"not determined: {found.description}"
    if value is not None:
        agrees = abs(value - printed) < _AGREES * abs(printed)
        own = f" (± {1.96 * found.std_error:.2g} N m)" if found and found.std_error and unit != "%" else ""
        remark = "; ".join(part for part in (f"{100 * (value / printed - 1.0):+.1f} %{own}", told) if part)
    return Published(
        name=name, published=printed, found=value, unit=unit, where="sections 4, 5", agrees=agrees, remark=remark
    )


def _line(campaign: CampaignNumbers) -> list[Published]:
    transfer = campaign.transfer
    if transfer is None:
        return []
    line = paper_line(120)
    return [
        Published(
            name="slope of T_out over T_in", published=line.slope, found=transfer.slope, where="section 4, four states at 120 rpm",
            agrees=abs(transfer.slope - line.slope) < 3.0 * math.hypot(transfer.slope_error, 0.012),
            remark=f"± {1.96 * transfer.slope_error:.2g} from the brake rises; a rigid box with drag that depends on speed alone has 1. Drag "
            "in proportion to load, or a sensor's gain: one bench does not tell",
        )
    ]  # fmt: skip


def _speeds(campaign: CampaignNumbers) -> list[Published]:
    rows = []
    for run in campaign.runs:
        speed, nominal = run.speed_in, run.speed
        if speed is None or speed.source == "nominal" or not math.isfinite(nominal):
            continue
        loss = speed.value / nominal - 1.0
        rows.append((abs(loss), loss, run, speed))
    if not rows:
        return []
    _, loss, run, speed = max(rows, key=lambda row: row[0])
    return [
        Published(
            name=f"input speed in SOS ({run.name})", published=run.speed, found=speed.value, unit="rad/s", where="section 4",
            agrees=abs(loss) < 0.01,
            remark=f"the paper assumes the nominal speed; here {100 * loss:+.2f} % off it, the most of {len(rows)} runs, from: {speed.told}",
        )
    ]  # fmt: skip


def _vibration(campaign: CampaignNumbers, vibration: Mapping[str, VibrationNumbers]) -> list[Published]:
    """Compare stages and places: stronger in SOS, stronger at the input."""
    stage_ratios, place_ratios = [], []
    for run in campaign.runs:
        rms = {(one.stage, one.channel): one.rms for one in vibration[run.name].levels}
        for (stage, channel), value in rms.items():
            if stage == "sos" and rms.get(("fos", channel)):
                stage_ratios.append(value / rms["fos", channel])
            other = rms.get((stage, channel.replace("_in_", "_out_")))
            if "_in_" in channel and stage in ("fos", "sos") and other:
                place_ratios.append(value / other)
    rows = []
    for name, ratios in (
        ("vibration in SOS over FOS", stage_ratios),
        ("vibration at the input over the output", place_ratios),
    ):
        if ratios:
            rows.append(
                Published(
                    name=name, published="more than 1", found=f"{min(ratios):.2f} to {max(ratios):.2f}", where="section 4, text",
                    agrees=True if min(ratios) > 1 else False if max(ratios) < 1 else None,
                    remark="root mean square above 2 Hz, all runs and channels; the paper's waveforms are lost",
                )
            )  # fmt: skip
    return rows
