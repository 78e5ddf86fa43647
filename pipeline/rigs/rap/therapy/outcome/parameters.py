"""From the numbers of the runs to the parameters of the findings (rap.md, sections 10 and 11); nothing is computed anew."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.findings import Parameter
from pipeline.findings.findings import OperatingPoint
from pipeline.rigs.rap.therapy.declaration import PARAMETERS
from pipeline.rigs.rap.therapy.disagreement import widened
from pipeline.rigs.rap.therapy.record import ALARMS, BATTERY, MEMBRANE, REDUNDANCY, TEMPERATURE, VOLUME
from pipeline.rigs.rap.therapy.run_numbers import RunNumbers
from pipeline.rigs.rap.therapy.volume_numbers import VolumeNumbers

_SPECS = {spec.name: spec for spec in PARAMETERS}
_FITTED = ("temperature_initial", "temperature_final", "time_constant")
# A volume known to no better than that share of the tank is not known.
_VAGUE = 0.1
_METHODS = {
    **dict.fromkeys(_FITTED, "least squares of eq. (7) to one sensor"),
    "temperature_error_max": "device less bench at the device's samples",
    "uf_volume_error_rms": "Kalman filter of eq. (9) against the scale",
    "uf_volume_final": "Kalman filter of eq. (9)",
    "uf_pump_gain": "Kalman filter and smoother of eq. (9)",
    "k_uf_initial": "K_0/(1 + a t/5 h) to 60 s means, block bootstrap",
    "k_uf_decline": "K_0/(1 + a t/5 h) to 60 s means, block bootstrap",
    "energy_used": "voltage times current, integrated",
    "runtime_projected": "battery's energy over mean power",
    "alarm_count": "state machine re-derived from the log",
    "alarm_time": "state machine re-derived from the log",
    "mismatch_time": "threshold and cumulative sums, whichever is first",
}


def parameter(found: Estimate, at: OperatingPoint, description: str = "", method: str = "") -> Parameter:
    """Return an estimate as a parameter of the findings; `method` where it is not the usual one."""
    spec = _SPECS[found.name]
    determined = found.value is not None and math.isfinite(found.value)
    told = spec.description if determined else f"not determined: {found.reason or 'the data do not tell it'}"
    remark = found.reason if determined else ""
    known = determined and found.std_error is not None and math.isfinite(found.std_error)
    interval = found.ci95 if known and found.ci95 and all(map(math.isfinite, found.ci95)) else None
    return Parameter(
        name=found.name, symbol=spec.symbol, value=found.value if determined else None,
        std_error=found.std_error if known else None, type_b=found.type_b if known else None, ci95=interval, unit=spec.unit, at=at,
        description="; ".join(part for part in (told, remark, description) if part), source=spec.source,
        method=(method or _METHODS[found.name]) if determined else "",
    )  # fmt: skip


def in_order(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return parameters in the order of their declaration, of each name the determined ones first, the runs' order kept."""
    order = {name: place for place, name in enumerate(_SPECS)}
    return sorted(parameters, key=lambda one: (order[one.name], one.value is None))


def parameters_of(run: RunNumbers) -> list[Parameter]:
    """Return the parameters of a run: what its channels ask for, null with the reason where the data do not tell it."""
    return [one for part, numbers in _parts() if part in run.record.asked for one in numbers(run)]


def untold_by(run: RunNumbers) -> set[str]:
    """Return the names of the parameters of those parts that a run has channels for and tells nothing of."""
    silent = [numbers for part, numbers in _parts() if part in run.record.asked and not run.tells[part]]
    return {one.name for numbers in silent for one in numbers(run)}


def _parts() -> Sequence[tuple[str, Callable[[RunNumbers], list[Parameter]]]]:
    return (
        (TEMPERATURE, _temperature), (VOLUME, _volume), (MEMBRANE, _membrane), (BATTERY, _battery), (ALARMS, _alarms),
        (REDUNDANCY, _mismatches),
    )  # fmt: skip


def _temperature(run: RunNumbers) -> list[Parameter]:
    found = []
    for source in ("rap", "bench"):
        at: OperatingPoint = {"run": run.run, "source": source}
        fit = run.temperatures.get(source)
        if fit is None:
            reason = run.reasons.get(f"temperature {source}", "")
            found += [parameter(undetermined(name, reason), at) for name in _FITTED]
        else:
            found += [parameter(one, at) for one in fit.estimates]
    error = run.temperature_error
    largest = (
        error.largest if error else undetermined("temperature_error_max", run.reasons.get("temperature error", ""))
    )
    return [*found, parameter(largest, {"run": run.run})]


def _volume(run: RunNumbers) -> list[Parameter]:
    volume = run.volume
    at: OperatingPoint = {"run": run.run}
    if volume is None:
        return []
    no_course = next((r for name in ("levels", "command", "course") if (r := volume.reasons.get(name))), "")
    no_scale = volume.reasons.get("scale") or volume.reasons.get("error") or no_course
    rms = volume.error.rms if volume.error else undetermined("uf_volume_error_rms", no_scale)
    final = _final(volume) if volume.course else volume.by_levels or undetermined("uf_volume_final", no_course)
    final = widened(final, volume.place_u, "the unstated place of the level sensor is in the standard error")
    gain = volume.gain.gain if volume.gain else undetermined("uf_pump_gain", volume.reasons.get("gain") or no_course)
    apart = volume.disagreement
    if apart is not None:
        remark = f"level and scale disagree by {1e6 * apart.final:+.1f} mL at the end, {100 * apart.mean_share:+.1f} % in the rate: in the standard error"
        final = widened(final, abs(apart.final), remark)
        gain = widened(gain, abs(apart.mean_share) * (gain.value or 0.0), remark)
    method = "straight line through the last levels" if volume.by_levels else ""
    return [parameter(final, at, method=method), parameter(rms, at), parameter(gain, at)]


def _final(volume: VolumeNumbers) -> Estimate:
    """Return the volume at the end, undetermined where neither an echo nor a known start tells it."""
    final, tank = (volume.course.final if volume.course else None), volume.tank
    if final is None or tank is None or final.std_error is None or final.std_error < _VAGUE * tank.capacity:
        return final or undetermined("uf_volume_final", "")
    return undetermined(
        "uf_volume_final",
        f"no usable level tells what is in the tank, and nothing tells what was in it at the start (standard error "
        f"{1e3 * final.std_error:.2g} L); log valid echoes, or drain_pressed when the tank is emptied before the run",
    )


def _membrane(run: RunNumbers) -> list[Parameter]:
    found = run.membrane
    reason = run.reasons.get(MEMBRANE, "")
    estimates = (
        (found.initial, found.decline)
        if found
        else (undetermined("k_uf_initial", reason), undetermined("k_uf_decline", reason))
    )
    return [parameter(one, {"run": run.run}) for one in estimates]


def _battery(run: RunNumbers) -> list[Parameter]:
    found, reason = run.battery, run.reasons.get(BATTERY, "")
    method = "fall of battery_level times battery_energy" if found is not None and found.source == "level" else ""
    estimates = (
        (found.used, found.runtime)
        if found
        else (undetermined("energy_used", reason), undetermined("runtime_projected", reason))
    )
    return [parameter(one, {"run": run.run}, method=method) for one in estimates]


def _alarms(run: RunNumbers) -> list[Parameter]:
    alarms, reason = run.alarms, run.reasons.get(ALARMS, "")
    told = () if alarms is None else alarms.alarms
    count = undetermined("alarm_count", reason) if reason else Estimate("alarm_count", float(len(told)))
    found = [
        parameter(
            estimate("alarm_time", one.time, one.std_error),
            {"run": run.run, "alarm": one.code, "index": float(one.index)},
            one.cause,
        )
        for one in told
    ]
    if reason and not found:
        found.append(parameter(undetermined("alarm_time", reason), {"run": run.run}))
    return [parameter(count, {"run": run.run}), *found]


def _mismatches(run: RunNumbers) -> list[Parameter]:
    if run.alarms is None:
        return [parameter(undetermined("mismatch_time", run.reasons.get(ALARMS, "")), {"run": run.run})]
    return [
        parameter(
            estimate("mismatch_time", one.time, one.std_error),
            {"run": run.run, "channel": one.tap, "index": float(one.index)},
            f"{one.kind}, {'threshold' if one.by_threshold == one.time else 'cumulative sum'} first",
        )
        for tap in run.alarms.redundancy
        for one in tap.mismatches
    ]
