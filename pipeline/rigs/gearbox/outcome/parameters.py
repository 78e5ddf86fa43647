"""From the numbers of runs and campaign to the parameters of the findings (gearbox.md, section 10); nothing is computed anew."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import ModelResult, Parameter
from pipeline.findings.findings import OperatingPoint
from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers
from pipeline.rigs.gearbox.declaration import PARAMETERS, LoadExchangeSettings
from pipeline.rigs.gearbox.load.friction_fit import Curve, slip_torque_by_input
from pipeline.rigs.gearbox.load.inertia import NAMES, LoadFit
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.stages.stage import EventTime
from pipeline.rigs.gearbox.torques.derived import NO_OFFSET, difference, power, power_assumed, ratio, share
from pipeline.rigs.gearbox.torques.lost_samples import overlap
from pipeline.rigs.gearbox.torques.nominal import type_b
from pipeline.rigs.gearbox.torques.run_torques import NOMINAL_STAGES
from pipeline.rigs.gearbox.torques.torque_map import Transfer
from pipeline.rigs.gearbox.vibration.vibration_numbers import StageLevel

_SPECS = {spec.name: spec for spec in PARAMETERS}
_SIDES = ("in", "out")
_BOTH = ("torque_in", "torque_out")
_EVENTS = ("startup", "brake_onset", "unlock", "sos_start", "sos_end", "relock", "rundown")
_NO_FOS = "there is no settled FOS"
_NO_SOS = "there is no settled SOS: the output never stood under load"
_NO_BRAKE = "the brake did not unlock the gearbox"
_NO_START = "there is no start-up in the log"
_PHASES = {
    "steady": "the line through the levels of FOS (locked) and SOS (slipping), whose drags differ: not the slope a of the locked box"
}
# The input torque tells the brake's onset; it must be there within so many seconds of it.
_NEAR = 0.05
_STRIBECK = ("c0", "c_s", "w_s", "b0")


def parameter(found: Estimate, at: OperatingPoint, description: str = "", method: str = "") -> Parameter:
    """Return an estimate as a parameter of the findings."""
    spec = _SPECS[found.name]
    told = spec.description if found.determined else found.reason
    text = "; ".join(part for part in (told, description) if part)
    known = found.determined and found.std_error is not None and math.isfinite(found.std_error)
    return Parameter(
        name=found.name, symbol=spec.symbol, value=found.value, std_error=found.std_error if known else None,
        ci95=found.ci95 if known else None, unit=spec.unit, at=at, description=text, source=spec.source, method=method,
    )  # fmt: skip


def parameters_of(
    campaign: CampaignNumbers, vibration: Sequence[StageLevel], settings: LoadExchangeSettings
) -> list[Parameter]:
    """Return all parameters, those of the campaign first."""
    found = [*_load(campaign), *_transfer(campaign), *_friction(campaign, settings)]
    for run in campaign.runs:
        found += [*_torques(run, settings), *_shares(run), *_speeds(run), *_lock(run, campaign), *_events(run)]
    found += [
        parameter(one.estimate, {"run": one.run, "stage": one.stage, "channel": one.channel}) for one in vibration
    ]
    return found


def _load(campaign: CampaignNumbers) -> list[Parameter]:
    found = [
        parameter(one, {}, method="modulating functions, all runs together") for one in _of_load(campaign.load, NAMES)
    ]
    for run in campaign.runs:
        one = _of_load(run.load, NAMES[:1])[0]
        found.append(parameter(one, {"run": run.name}, method="modulating functions, this run alone"))
    return found


def _of_load(load: LoadFit | None, names: Sequence[str]) -> list[Estimate]:
    if load is None:
        reason = (
            "the output shaft hardly accelerates with a free brake in the log: eq. (A) has nothing to tell the load by"
        )
        return [undetermined(name, reason) for name in names]
    error = load.covariance.std_error
    return [
        undetermined(name, load.undetermined[name])
        if name in load.undetermined
        else estimate(name, load.values[i], error[i], dof=load.covariance.dof)
        for i, name in enumerate(names)
    ]


def _transfer(campaign: CampaignNumbers) -> list[Parameter]:
    several = len([run for run in campaign.runs if "brake" in run.transfers]) > 1
    told = "T_00 is a mean over the runs' speeds, with which it changes" if several else ""
    found = _of_transfer(
        campaign.transfer, {}, "brake rises of all runs, total least squares", told, reason=campaign.no_slope
    )
    for run in campaign.runs:
        for phase, transfer in run.transfers.items():
            words = _PHASES.get(phase, "")
            at: OperatingPoint = {"run": run.name, "phase": phase}
            found += _of_transfer(transfer, at, "total least squares", words, slope_told=words)
    return found


def _of_transfer(
    transfer: Transfer | None, at: OperatingPoint, method: str, told: str = "", slope_told: str = "", reason: str = ""
) -> list[Parameter]:
    names = ("torque_transfer_slope", "torque_transfer_intercept")
    if transfer is None:
        return [parameter(undetermined(name, reason), at) for name in names]
    found = [
        parameter(estimate(names[0], transfer.slope, transfer.slope_error, dof=transfer.dof), at, slope_told, method)
    ]
    if math.isfinite(transfer.intercept):
        one = estimate(
            names[1], transfer.intercept, transfer.intercept_error, dof=transfer.intercept_dof or transfer.dof
        )
    else:
        why = "the drag changes with speed meanwhile" if transfer.phase == "startup" else NO_OFFSET
        one = undetermined(names[1], why)
    return [*found, parameter(one, at, told if one.determined else "", method)]


def _friction(campaign: CampaignNumbers, settings: LoadExchangeSettings) -> list[Parameter]:
    found = []
    for speed, names in campaign.speeds.items():
        one, runs = campaign.mean_drag(names)
        told = f"mean of {runs} runs" if runs > 1 else ""
        found.append(parameter(one, {"speed": speed}, told))
    speeds = len(campaign.speeds)
    least = settings.least_speeds
    law = campaign.drag_law if speeds >= least or campaign.drag_law is None or campaign.drag_law.law == "line" else None
    few = f"{speeds} speeds; the drag's four parameters need {least}, and a straight line three"
    found += _of_curve(law, _STRIBECK, few)
    few = "the slip torque is known at fewer than two slip speeds"
    return found + _of_curve(campaign.slip_law, ("slip_torque_slope", "slip_torque_intercept"), few)


def _of_curve(curve: Curve | None, names: Sequence[str], few: str) -> list[Parameter]:
    found = []
    for name in names:
        if curve is None or name not in curve.names:
            reason = few if curve is None else f"{curve.n} runs at too few speeds: only c0 + b0 w was fitted"
            found.append(parameter(undetermined(name, reason), {}))
            continue
        place = curve.names.index(name)
        if name in curve.at_bound:
            found.append(
                parameter(undetermined(name, f"the fit runs to its bound, {curve.values[place]:.3g} rad/s"), {})
            )
            continue
        error = float(curve.covariance.std_error[place])
        told = (
            "strongly correlated with the other parameters of the curve: quote the curve" if name in _STRIBECK else ""
        )
        found.append(
            parameter(estimate(name, curve.values[place], error, dof=curve.covariance.dof), {}, told, "weighted fit")
        )
    return found


def _torques(run: RunNumbers, settings: LoadExchangeSettings) -> list[Parameter]:
    found = []
    for side in _SIDES:
        quantity = f"torque_{side}"
        told = _type_b(run, side, settings)
        zero = run.zero(quantity)
        unknown = (
            "as read: the zero offset is unknown (no standstill), so there is no interval" if math.isnan(zero) else ""
        )
        for stage in NOMINAL_STAGES:
            at: OperatingPoint = {"run": run.name, "stage": stage}
            level = run.levels.get((quantity, stage))
            if level is None:
                one = undetermined(f"{quantity}_nominal", _no_level(run, quantity, stage))
            elif unknown:
                one = Estimate(f"{quantity}_nominal", level.value)
            else:
                one = estimate(f"{quantity}_nominal", level.value, level.std_error, dof=level.dof)
            found.append(parameter(one, at, _joined(unknown, told) if level else "", "mean over whole turns"))
        for stage, missing in (("startup", _NO_START), ("brake", _NO_BRAKE)):
            at = {"run": run.name, "stage": stage}
            peak = run.peaks.get((quantity, stage))
            if peak is None:
                reason = run.torques.withheld.get((quantity, stage), missing)
                found.append(parameter(undetermined(f"{quantity}_peak", reason), at))
                continue
            one = Estimate(f"{quantity}_peak", peak.value)
            if not unknown and not peak.saturated:
                one = Estimate(f"{quantity}_peak", peak.value, peak.std_error, peak.ci95, dof=peak.dof)
            flat = "flat at its top (saturated): a lower bound" if peak.saturated else ""
            bias = f"noise and ripple add {1e3 * peak.bias:.0f} mN m on average, which the interval allows for"
            found.append(parameter(one, at, _joined(flat, unknown, bias, told), "20 Hz zero-phase low-pass"))
    return found


def _joined(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


def _type_b(run: RunNumbers, side: str, settings: LoadExchangeSettings) -> str:
    """Say what the sensor's own limits of error leave; it is not in the interval."""
    reach = run.record.conditions.get(f"torque_range_{side}")
    if not isinstance(reach, int | float) or isinstance(reach, bool):
        return "type A; the sensor's range was not stated"
    own = type_b(float(reach), settings.torque_accuracy)
    return (
        f"type A; type B ±{1e3 * own:.2g} mN m (standard, {100 * settings.torque_accuracy:g} % of the sensor's range)"
    )


def _shares(run: RunNumbers) -> list[Parameter]:
    at: OperatingPoint = {"run": run.name}
    found: list[Estimate] = []
    for side in _SIDES:
        quantity = f"torque_{side}"
        sos, peak = run.level(quantity, "sos"), run.peak(quantity, "brake")
        missing = _no_peak(run, quantity, "brake") if peak is None else _missing(run, "sos", quantity)
        found.append(share(f"torque_relief_{side}", sos, peak, missing, residual=False))
        found.append(share(f"torque_residual_{side}", sos, peak, missing, residual=True))
        start, fos = run.peak(quantity, "startup"), run.level(quantity, "fos")
        found.append(
            difference(
                f"startup_excess_{side}",
                start,
                fos,
                _no_peak(run, quantity, "startup") if start is None else _missing(run, "fos", quantity),
            )
        )
    peak, sos, fos = run.peak("torque_in", "brake"), run.level("torque_in", "sos"), run.level("torque_in", "fos")
    no_peak = _no_peak(run, "torque_in", "brake")
    found.append(
        difference("breakaway_drop_in", peak, sos, no_peak if peak is None else _missing(run, "sos", "torque_in"))
    )
    found.append(
        difference("breakaway_rise_in", peak, fos, no_peak if peak is None else _missing(run, "fos", "torque_in"))
    )
    found.append(ratio("efficiency_fos", run.level("torque_out", "fos"), fos, _missing(run, "fos", *_BOTH)))
    found.append(ratio("torque_ratio_sos", run.level("torque_out", "sos"), sos, _missing(run, "sos", *_BOTH)))
    told = [parameter(each, at) for each in found]
    speed = run.speed_in
    missing = _missing(run, "sos", "torque_in") if sos is None else "the input speed in SOS is not known"
    if speed is None:
        return [*told, parameter(undetermined("power_dissipated_sos", missing), at)]
    if speed.source == "nominal":
        one = power_assumed("power_dissipated_sos", sos, speed.value, missing)
        remark = f"{speed.told}: an upper limit, the interval allows for 30 % less speed"
    else:
        one, remark = power("power_dissipated_sos", sos, speed.value, speed.std_error, missing), speed.told
    return [*told, parameter(one, at, remark if one.determined else "")]


def _no_level(run: RunNumbers, quantity: str, stage: str) -> str:
    """Say why a stage has no nominal torque."""
    if (quantity, stage) in run.torques.withheld:
        return run.torques.withheld[quantity, stage]
    if (quantity, stage) in run.torques.cut:
        return f"{quantity} is saturated in {stage.upper().replace('_', ' ')}: only a lower bound of its level is known"
    if stage in run.run.stages:
        start, end = run.run.stages[stage]
        return f"stage '{stage}' lasts {end - start:.2g} s: too short for a nominal value, which takes two turns and 0.5 s settled"
    return {"fos": "there is no FOS", "sos": _NO_SOS}.get(stage, f"there is no stage '{stage}'")


def _missing(run: RunNumbers, stage: str, *quantities: str) -> str:
    """Say why a number that needs levels of a stage is missing: the reason of the first level that is."""
    lacking = [quantity for quantity in quantities if (quantity, stage) not in run.levels]
    return _no_level(run, (lacking or list(quantities))[0], stage)


def _no_peak(run: RunNumbers, quantity: str, stage: str) -> str:
    if (quantity, stage) in run.torques.withheld:
        return run.torques.withheld[quantity, stage]
    if run.saturated(quantity, stage):
        return "the peak is saturated: only a lower bound of it is known"
    return _NO_BRAKE if stage == "brake" else _NO_START


def _speeds(run: RunNumbers) -> list[Parameter]:
    at: OperatingPoint = {"run": run.name}
    value, error = run.speed_out
    out = (
        _bounded_by_clock(run, "encoder", estimate("speed_out_nominal", value, error))
        if math.isfinite(value)
        else undetermined("speed_out_nominal", _NO_FOS)
    )
    told = _with_clock(run, "encoder", parameter(out, at, _clock_told(run, "encoder", out), "slope of the counts"))
    speed = run.speed_in
    if speed is None:
        return [told, parameter(undetermined("speed_in_sos", _NO_SOS), at)]
    if speed.source == "nominal":
        reason = f"{speed.told}: {speed.value:.4g} rad/s, neither measured nor seen in the vibration"
        return [told, parameter(undetermined("speed_in_sos", reason), at)]
    own = estimate("speed_in_sos", speed.value, speed.std_error, dof=speed.dof)
    if speed.source != "mesh lines":
        return [told, parameter(own, at, speed.told, speed.source)]
    own = _bounded_by_clock(run, "vibration", own)
    words = "; ".join(part for part in (speed.told, _clock_told(run, "vibration", own)) if part)
    return [told, _with_clock(run, "vibration", parameter(own, at, words, speed.source))]


def _bounded_by_clock(run: RunNumbers, board: str, speed: Estimate) -> Estimate:
    """Return a speed whose interval allows for a clock that is off by its limits at the most, anywhere as likely."""
    clock = run.run.rate_sd.get(board, 0.0) * abs(speed.value or 0.0)
    if not clock or speed.value is None or speed.std_error is None or speed.ci95 is None:
        return speed
    own = math.sqrt(max(speed.std_error**2 - clock**2, 0.0))
    half = math.hypot(0.95 * math.sqrt(3.0) * clock, t_quantile(speed.dof) * own)
    return replace(speed, ci95=(speed.value - half, speed.value + half))


def _with_clock(run: RunNumbers, board: str, speed: Parameter) -> Parameter:
    """Return a speed with the share of its error that is the clock's (type B)."""
    clock = run.run.rate_sd.get(board, 0.0) * abs(speed.value or 0.0)
    return speed.model_copy(update={"type_b": clock}) if clock and speed.std_error is not None else speed


def _clock_told(run: RunNumbers, board: str, speed: Estimate) -> str:
    """Say which part of a speed's standard error is type B: what is unknown of a board's clock."""
    rate = run.run.rate_sd.get(board, 0.0)
    if not rate or speed.value is None or not speed.std_error:
        return ""
    clock = rate * speed.value
    own = math.sqrt(max(speed.std_error**2 - clock**2, 0.0))
    return (
        f"standard error: {1e3 * clock:.2g} mrad/s for the rate of the {board} board's clock ({1e6 * rate:.0f} ppm, type B) and "
        f"{1e3 * own:.2g} mrad/s from the data"
    )


def _lock(run: RunNumbers, campaign: CampaignNumbers) -> list[Parameter]:
    at: OperatingPoint = {"run": run.name}
    slip, drag, sos = campaign.slip[run.name], campaign.drag[run.name], run.level("torque_in", "sos")
    told = ""
    if slip.determined and drag.value is not None and sos is not None:
        by_input = slip_torque_by_input(sos.value, drag.value)
        told = f"T_out/a, the output held; T_in less the drag found while locked gives {by_input:.3f} N m"
    lock = campaign.lock[run.name]
    if "sos" in run.run.stages and not slip.determined and ("torque_out", "sos") not in run.levels:
        slip = undetermined("slip_torque", _missing(run, "sos", "torque_out"))
    if ("unlock", "brake") in run.torques.withheld:
        lock = undetermined("lock_torque", run.torques.withheld["unlock", "brake"])
    elif run.saturated("torque_in", "brake"):
        lock = undetermined("lock_torque", _no_peak(run, "torque_in", "brake"))
    return [
        parameter(lock, at, method="peak, without ripple and what noise adds to it, less T_0"),
        parameter(slip, at, method=told),
    ]


def _events(run: RunNumbers) -> list[Parameter]:
    found = []
    for event in _EVENTS:
        time = run.segmentation.events.get(event)  # type: ignore[call-overload]
        own = undetermined("event_time", "it did not happen or cannot be seen") if time is None else None
        lost = run.torques.withheld.get(("event", "brake"), "")
        if event == "unlock" and run.saturated("torque_in", "brake"):
            own = undetermined(
                "event_time", "torque_in stands at its end stop when the lock breaks: its peak tells no moment"
            )
        if lost and (event == "unlock" or (event == "brake_onset" and _lost_at(run, time))):
            own = undetermined("event_time", lost)
        one = own or estimate("event_time", time.time, time.sd)
        found.append(parameter(one, {"run": run.name, "event": event}))
    return found


def _lost_at(run: RunNumbers, event: EventTime | None) -> bool:
    """Tell whether the input torque tells nothing at an event."""
    around = 0.0 if event is None else event.time
    return overlap(run.run.lost.get("torque_in", ()), (around - _NEAR, around + _NEAR)) > 0


def models_of(campaign: CampaignNumbers) -> list[ModelResult]:
    """Return how the laws of friction fit."""
    laws = [
        (campaign.drag_law, "drag of the locked gearbox", {"stribeck": "c0 + c_S exp(-(ω/ω_S)²) + b0 ω", "line": "c0 + b0 ω"}),
        (campaign.slip_law, "slip torque", {"slip": "M_c + M_v s"}),
    ]  # fmt: skip
    return [
        ModelResult(
            name=words[law.law], family=family, selected=True, n_parameters=len(law.names), n_data=law.n,
            chi2_reduced=law.chi2 / (law.n - len(law.names)) if law.n > len(law.names) else None,
        )
        for law, family, words in laws
        if law is not None
    ]  # fmt: skip
