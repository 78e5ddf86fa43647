"""Resistances from 1 s means, zeroed, over a baseline that the faults themselves do not move (rap.md, 3.9).

r_a = -P_a/(Q R_a0), r_f = (P_pre - P_ret)/((Q - Q_uf/2) R_f0), r_r = P_ret/((Q - Q_uf) R_r0), r_m = TMP K_uf0/Q_uf.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.limits import AlarmLimits
from pipeline.rigs.rap.alarms.pump import RATE_NEEDED, PumpRun, pump_run
from pipeline.rigs.rap.alarms.results import RATIOS, DeviceLog, Ratios
from pipeline.rigs.rap.alarms.spans import since
from pipeline.rigs.rap.alarms.strokes import averaging
from pipeline.rigs.rap.alarms.unfit import leave_out_frozen, leave_out_slow_pump
from pipeline.rigs.rap.alarms.windows import held, trailing_mean
from pipeline.rigs.rap.alarms.zeros import zeros
from pipeline.rigs.rap.conditions import TAP_NAMES, TAPS

# The baseline is what the first minutes of running say, s.
_FIRST = 300.0
# A change of the set-point may be logged this long after the pump has followed it, s.
_LOGGED_AFTER = 1.0
# After a start or a change of the ultrafiltration the transmembrane pressure levels out, s.
_UF_SETTLED = 10.0
# P_uf moving by more than this share of the usual TMP a second says that the membrane is not in balance.
_UF_MOVING = 0.1
# Between moments where no pressure gives them, s.
_STEP = 0.05
_NO_PRESSURE = (
    "the run holds no pressure of the device, so of all alarms only those of stagnation and of flags can be re-derived"
)
# Ratios that scatter more than this are no ground for an alarm.
_NOISE_MOST = 0.10
_MEANT = {"access": "access line", "filter": "filter", "return": "return line", "membrane": "membrane"}
_TAPS_OF = {"access": ("access",), "filter": ("prefilter", "return"), "return": ("return",), "membrane": ("prefilter", "return", "uf")}  # fmt: skip


@dataclass(frozen=True, eq=False)
class RatioResult:
    """Ratios of a run (None with the reason in `undetermined`), the pump, the means by tap on the grid, and what was noticed."""

    ratios: Ratios | None
    pump: PumpRun | None
    grid: np.ndarray
    means: dict[str, np.ndarray]
    problems: tuple[QualityFinding, ...]
    undetermined: str = ""


def pressure_ratios(log: DeviceLog, limits: AlarmLimits) -> RatioResult:
    """Return the four ratios of a run at the device's stamps."""
    grid = _grid(log)
    if grid.size < 2:
        return RatioResult(None, None, grid, {}, (), _NO_PRESSURE)
    pump = pump_run(log, grid)
    if not log.control and not log.protective:
        return RatioResult(None, pump if pump.source else None, grid, {}, (), _NO_PRESSURE)
    signals = {tap: log.control.get(tap) or log.protective.get(tap) for tap in TAPS}
    uf, uf_changes, uf_known = _ultrafiltration(log, grid, pump)
    pulsating = [s for s in (signals["prefilter"], signals["return"], signals["access"]) if s is not None]
    width = averaging(pulsating, grid, pump)
    means = {tap: trailing_mean(s, grid, width) for tap, s in signals.items() if s is not None}
    problems: list[QualityFinding] = []
    leave_out_frozen(grid, signals, means, pump, log.run, problems)
    if not pump.on.any():
        return RatioResult(None, pump, grid, means, (), "the blood pump never runs in this log")
    zero = zeros(grid, means, pump, uf, log.run, problems)
    zeroed = {tap: mean - zero[tap] for tap, mean in means.items()}
    raw = _resistances(zeroed, pump.flow, uf, uf_known)
    starts = np.array([start for start, _ in pump.running])
    # A set-point logged once a second stands in the log after the pump has followed it.
    coming = -since(-grid[::-1], -pump.set_changes[::-1])[::-1]
    settled = pump.on & (since(grid, starts) >= limits.blanking) & (since(grid, pump.set_changes) >= limits.blanking)
    settled &= np.abs(coming) > _LOGGED_AFTER
    uf_starts = np.sort(np.concatenate([starts, uf_changes]))
    balanced = settled & (uf > 0.0) & (since(grid, uf_starts) >= max(_UF_SETTLED, limits.blanking))
    values: dict[str, np.ndarray] = {}
    baseline: dict[str, float] = {}
    noise: dict[str, float] = {}
    for name in RATIOS:
        missing = [TAP_NAMES[tap] for tap in _TAPS_OF[name] if tap not in means]
        if missing:
            problems.append(_told(log.run, f"no alarm of the {_MEANT[name]} can be re-derived: the device's pressure {' and '.join(missing)} is not in the log"))  # fmt: skip
            continue
        judged = (balanced if name == "membrane" else settled) & np.isfinite(raw[name])
        if name == "membrane" and not uf_known:
            problems.append(_told(log.run, "no alarm of the membrane can be re-derived: no rate of ultrafiltration is logged (uf_flow_set or uf_pump_command)"))  # fmt: skip
            continue
        if not judged.any():
            if name != "membrane":
                problems.append(_told(log.run, f"no alarm of the {_MEANT[name]} can be re-derived: the pump never runs longer than {limits.blanking:g} s at one set-point"))  # fmt: skip
            continue
        base, doubt = _baseline(grid, raw[name], judged, limits)
        if base <= 0.0:
            problems.append(_told(log.run, f"no alarm of the {_MEANT[name]} can be re-derived: its resistance comes out {base:.3g} Pa s/m^3, which is not positive; look for exchanged channels or a turned sign"))  # fmt: skip
            continue
        if doubt:
            problems.append(_told(log.run, f"{_MEANT[name]}: {doubt}"))
        ratio = np.where(judged, raw[name] / base, np.nan)
        scatter = _scatter(grid, ratio)
        if scatter > _NOISE_MOST:
            problems.append(_told(log.run, f"no alarm of the {_MEANT[name]} can be re-derived: its ratio to the baseline scatters by {100 * scatter:.0f} % from second to second (the alarm is due at {limits.high:g}); log the pressures at 20 Hz"))  # fmt: skip
            continue
        if name == "membrane":
            ratio = np.where(_in_balance(grid, zeroed, ratio), ratio, np.nan)
        values[name], baseline[name], noise[name] = ratio, (1.0 / base if name == "membrane" else base), scatter
    leave_out_slow_pump(grid, values, log.run, problems)
    if not pump.flow_source:
        problems.append(_told(log.run, "no blood flow is logged (blood_flow_set, blood_flow_rap or blood_pump_speed): it is taken as constant, and a change of the set-point looks like an occlusion"))  # fmt: skip
    ratios = Ratios(grid, values, baseline, noise, zero, pump.on, pump.flow, uf)
    return RatioResult(
        ratios, pump, grid, means, tuple(problems), "" if values else "no ratio of pressures can be formed"
    )


def _told(run: str, message: str) -> QualityFinding:
    return QualityFinding("warning", f"{message[0].upper()}{message[1:]}.", run)


def _grid(log: DeviceLog) -> np.ndarray:
    """Return the moments of the pressures; without any, moments as close over all that the device wrote."""
    found = [*log.control.values(), *log.protective.values()]
    if found:
        return max((s.time for s in found), key=len)
    others = [s for s in (log.flow_set, log.flow_device, log.pump_speed, *log.flags.values()) if s is not None]
    ends = [t for s in others for t in (s.time[0], s.time[-1])] + [e.time for e in (*log.states, *log.codes)]
    return np.arange(min(ends), max(ends) + _STEP, _STEP) if ends else np.zeros(0)


def _ultrafiltration(log: DeviceLog, grid: np.ndarray, pump: PumpRun) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return the rate of ultrafiltration (m^3/s, (n,)), the moments of its changes, and whether the log tells it.

    Without the pump's command the set-point holds only while the blood pump runs: it stands in the log during a pause.
    """
    if log.uf_command is not None:
        rate, signal = held(log.uf_command, grid), log.uf_command
    elif log.uf_set is not None:
        rate, signal = np.where(pump.on, held(log.uf_set, grid), 0.0), log.uf_set
    else:
        return np.zeros(grid.size), np.zeros(0), False
    usual = float(np.median(signal.values[signal.values > 0.0])) if (signal.values > 0.0).any() else 1.0
    place = np.flatnonzero(np.abs(np.diff(signal.values)) > 0.1 * usual) + 1
    return rate, np.asarray(signal.time[place], float), True


def _resistances(
    zeroed: dict[str, np.ndarray], flow: np.ndarray, uf: np.ndarray, uf_known: bool
) -> dict[str, np.ndarray]:
    blank = np.full(flow.shape, np.nan)
    access, pre, ret, filtrate = (zeroed.get(tap, blank) for tap in TAPS)
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "access": -access / np.where(flow > 0.0, flow, np.nan),
            "filter": (pre - ret) / np.where(flow > uf, flow - 0.5 * uf, np.nan),
            "return": ret / np.where(flow > uf, flow - uf, np.nan),
            "membrane": (0.5 * (pre + ret) - filtrate) / np.where(uf > 0.0, uf, np.nan) if uf_known else blank,
        }


def _baseline(grid: np.ndarray, raw: np.ndarray, judged: np.ndarray, limits: AlarmLimits) -> tuple[float, str]:
    """Return the baseline of a resistance and what is doubtful about it ('' for nothing).

    The first minutes of running, by the densest half of their values: a fault within them does not move it. Where most
    of the run would then be one alarm, the fault lay at the start.
    """
    step = float(np.median(np.diff(grid)))
    place = np.flatnonzero(judged)
    early = place[: max(int(_FIRST / step), 1)]
    first = densest(raw[early])
    whole = densest(raw[place[:: max(place.size // 20000, 1)]])
    share = (
        float(np.mean((raw[place] > limits.high * first) | (raw[place] < limits.low * first))) if first > 0.0 else 0.0
    )
    if share > 0.5 and whole > 0.0:
        return whole, (
            f"the first minutes differ from most of the run by the factor {first / whole:.2g}; most of the run is taken as "
            "the baseline. If the start was sound, the line has been obstructed or open ever since"
        )
    return first, ""


def densest(values: np.ndarray) -> float:
    """Return the middle of the shortest interval that holds half of `values` (n,): not moved by up to half of outliers."""
    x = np.sort(values)
    half = x.size // 2 + 1
    if x.size < 3:
        return float(np.median(x))
    i = int(np.argmin(x[half - 1 :] - x[: x.size - half + 1]))
    return float(np.median(x[i : i + half]))


def _scatter(grid: np.ndarray, ratio: np.ndarray) -> float:
    """Return the standard deviation of the ratio from one second to the next, which steps do not inflate.

    A log too slow for the pulsation may carry it as a slow wave that seconds do not show: there the spread of the whole
    run counts.
    """
    step = float(np.median(np.diff(grid)))
    every = max(round(1.0 / step), 1)
    changes = np.abs(ratio[every:] - ratio[:-every])
    changes = changes[np.isfinite(changes)]
    scatter = float(np.median(changes) / 0.6745 / np.sqrt(2.0)) if changes.size else 0.0
    known = ratio[np.isfinite(ratio)]
    if 1.0 / step >= RATE_NEEDED or known.size == 0:
        return scatter
    return max(scatter, float(np.median(np.abs(known - np.median(known))) / 0.6745))


def _in_balance(grid: np.ndarray, zeroed: dict[str, np.ndarray], ratio: np.ndarray) -> np.ndarray:
    """Tell where the membrane passes what the pump takes: C_u dP_uf/dt is small, or it makes the ratio no less extreme.

    A pressure that jumps for another reason moves TMP until P_uf has followed; that is no change of the membrane.
    """
    filtrate = zeroed["uf"]
    step = max(round(1.0 / float(np.median(np.diff(grid)))), 1)
    rise = np.full(filtrate.shape, np.nan)
    rise[step:] = filtrate[step:] - filtrate[:-step]
    tmp = np.abs(0.5 * (zeroed["prefilter"] + zeroed["return"]) - filtrate)[np.isfinite(ratio)]
    usual = float(np.median(tmp)) if tmp.size else np.inf
    follows = np.where(ratio > 1.0, rise, -rise) > _UF_MOVING * usual
    return ~follows
