"""The paper's numbers of its therapy trials beside what a run gives (rap.md, section 4); `paper` holds the paper alone."""

from __future__ import annotations

import math

from pipeline.findings import Published
from pipeline.rigs.rap.therapy.outcome.paper import CELSIUS, HOUR, MINUTE, ML_H, ML_MIN, PRINTED, WH, heparin_flow
from pipeline.rigs.rap.therapy.run_numbers import RunNumbers

_POWER, _RATE, _TEMPERATURE = 0.05, 0.05, 1.0
_SETTLED, _FIRST_HOUR = 0.95, 3600.0


def published_of(run: RunNumbers) -> list[Published]:
    """Return the paper's numbers that this run can stand beside."""
    return [*_battery(run), *_volume(run), *_heparin(run), *_temperature(run), *_stagnation(run)]


def _row(
    run: RunNumbers, name: str, published: str, found: str, agrees: bool | None, remark: str, where: str
) -> Published:
    return Published(
        name=f"{name} ({run.run})", published=published, found=found, agrees=agrees, remark=remark, where=f"row {where}"
    )


def _battery(run: RunNumbers) -> list[Published]:
    battery, p = run.battery, PRINTED
    if battery is None or battery.used.value is None:
        return []
    power, used = battery.mean_power, battery.used.value
    rows = [
        _row(
            run, "mean power", f"{p.power:g} W", f"{power:.2f} W", abs(power / p.power - 1.0) < _POWER,
            f"{used / WH:.2f} Wh used, {100 * used / p.battery_energy:.1f} % of the paper's {p.battery_energy / WH:g} Wh", "1",
        )
    ]  # fmt: skip
    if battery.runtime.value is not None:
        runtime = battery.runtime.value
        rows.append(
            _row(
                run, "battery runtime", f"up to {p.runtime / HOUR:g} h", f"{runtime / HOUR:.2f} h", runtime >= p.runtime,
                "full battery at the mean power, with the efficiency stated for this run", "1",
            )
        )  # fmt: skip
    return rows


def _volume(run: RunNumbers) -> list[Published]:
    rate, p = run.set_points.get("uf_flow_set"), PRINTED
    course = run.volume.course if run.volume else None
    if rate is None or course is None:
        return []
    duration = float(course.time[-1] - course.time[0])
    asked, total = p.uf_rate * duration, course.total
    same = abs(rate / p.uf_rate - 1.0) < 0.01
    return [
        _row(
            run, "ultrafiltration", f"{p.uf_rate / ML_MIN:g} mL/min for {p.uf_trial / HOUR:g} h",
            f"{rate / ML_MIN:.3g} mL/min set for {duration / MINUTE:.0f} min", None if not same else True,
            f"{1e3 * total:.3f} L in the tank's account; {p.uf_rate / ML_MIN:g} mL/min would give {1e3 * asked:.3f} L in that time. "
            f"{total / duration / ML_MIN:.2f} mL/min on the mean", "4",
        )
    ]  # fmt: skip


def _heparin(run: RunNumbers) -> list[Published]:
    flow, uf = run.set_points.get("heparin_flow_set"), run.set_points.get("uf_flow_set")
    if flow is None:
        return []
    low, high = heparin_flow()
    share = f", {100 * flow / uf:.2g} % of the ultrafiltration set" if uf else ""
    return [
        _row(
            run, "heparin flow", f"{PRINTED.heparin_flow[0] / ML_H:g} to {PRINTED.heparin_flow[1] / ML_H:g} mL/h",
            f"{flow / ML_H:.3g} mL/h", 0.999 * low <= flow <= 1.001 * high,
            f"held against {low / ML_H:g} to {high / ML_H:g} mL/h, which the printed doses need{share}", "6",
        )
    ]  # fmt: skip


def _temperature(run: RunNumbers) -> list[Published]:
    rows, p = [], PRINTED
    error = run.temperature_error
    if error is not None:
        share = error.percent_max / 100.0
        rows.append(
            _row(
                run, "largest temperature error", f"{100 * p.temperature_error:g} %", f"{100 * share:.2f} %", share < p.temperature_error,
                f"of the bench in °C; {float(abs(error.error).max()):.2f} K", "7",
            )
        )  # fmt: skip
    fit = run.temperatures.get("bench") or run.temperatures.get("rap")
    if fit is None or fit.final.value is None or fit.initial.value is None:
        return rows
    final, initial = fit.final.value, fit.initial.value
    rows.append(
        _row(
            run, "air in the housing", f"{p.temperature_first - CELSIUS:g} to {p.temperature_stable - CELSIUS:g} °C",
            f"{initial - CELSIUS:.1f} to {final - CELSIUS:.1f} °C",
            abs(final - p.temperature_stable) < _TEMPERATURE and abs(initial - p.temperature_first) < _TEMPERATURE,
            f"agrees within {_TEMPERATURE:g} K; {'bench' if fit.source == 'bench' else 'device'}'s sensor", "7",
        )
    )  # fmt: skip
    tau = fit.time_constant.value
    if tau is not None:
        reached = 1.0 - math.exp(-_FIRST_HOUR / tau)
        rows.append(
            _row(
                run, "stable within the first hour", "stated", f"{100 * reached:.0f} % of the rise after 1 h", reached >= _SETTLED,
                f"time constant {tau / MINUTE:.1f} min; {100 * _SETTLED:g} % of the rise within the hour need "
                f"{-_FIRST_HOUR / math.log(1.0 - _SETTLED) / MINUTE:.1f} min or less", "7",
            )
        )  # fmt: skip
    return rows


def _stagnation(run: RunNumbers) -> list[Published]:
    alarms = run.alarms
    stood = [one for one in alarms.alarms if one.code == "PROLONGED_STAGNATION"] if alarms else []
    if not stood:
        return []
    delays = [one.time - one.began for one in stood]
    text = ", ".join(f"{delay:.2f} s" for delay in delays)
    return [
        _row(
            run, "stagnation alarm", f"{PRINTED.stagnation:g} s", text, all(abs(d - PRINTED.stagnation) < 2.0 for d in delays),
            "re-derived: from the stop of the blood pump to the alarm", "15",
        )
    ]  # fmt: skip
