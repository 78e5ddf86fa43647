"""From one run to its windows: where nothing changes, what the device sees there, what the meter says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.meter_clock import MeterClock, meter_clock
from pipeline.rigs.rap.flow.record import FlowRun
from pipeline.rigs.rap.flow.window_means import means
from pipeline.rigs.rap.flow.windows import FlowWindows
from pipeline.rigs.rap.flow.zero import Zero, resting, zero_of
from pipeline.rigs.rap.pulsation.harmonics import Harmonics, harmonics
from pipeline.rigs.rap.pulsation.passages import Passages, find_passages
from pipeline.rigs.rap.pulsation.pump import Pump, Turning, pump
from pipeline.rigs.rap.pulsation.steady import held, steady_windows, steps
from pipeline.rigs.rap.pulsation.windows import Windows, cut
from pipeline.rigs.rap.tables import Signal

# The meter reads another zero than 0 where it is so many standard errors, and so much (m^3/s), away from it.
_ZERO_SIGMA, _ZERO_LEAST = 4.0, 0.3e-6 / 60.0
# What reads more than that while the pressures do not pulsate is flow or a frozen meter, no zero, m^3/s.
ZERO_MOST = 10e-6 / 60.0
# Changes of the set flow and of the UF rate that count as such, as shares of the largest: a regulated UF rate wanders.
_SET, _UF = 0.01, 0.3
# Speeds closer than that share are one set-point; without logged set-points a step of that share between windows of so many s is told.
_ONE_SPEED, _STEP, _PROBE = 0.05, 0.03, 5.0


@dataclass(frozen=True, eq=False)
class RunNumbers:
    """What one run gives: the windows in which the pump turns steadily, how they were found, what was noticed."""

    run: FlowRun
    windows: FlowWindows
    passages: Passages | None
    pump: Pump
    zeros: dict[str, Zero]
    meter_zero: Zero
    meter_zeroed: bool
    meter_frozen: int
    lost_set_points: tuple[float, ...]
    clock: MeterClock | None
    source: str
    problems: list[QualityFinding] = field(default_factory=list)


def run_numbers(run: FlowRun, settings: FlowSettings) -> RunNumbers:
    """Find the windows of a run; means are zeroed at its own pump stops, where it has some."""
    turning = pump_of(run)
    rests = _rests(run, turning)
    own = {tap: zero_of(one, rests) for tap, one in run.pressures.items()}
    clock = meter_clock(run) if run.meter is not None else None
    windows = _windows(run, turning, clock, settings)
    looked_at = _set(run.flow_set, windows, np.nan)
    passages, f, f_error, source = _frequency(run, windows, (settings.slowest, settings.fastest))
    known = np.isfinite(f)
    lost = np.setdiff1d(looked_at[np.isfinite(looked_at)], looked_at[known])
    windows, f, f_error = windows.of(known), f[known], f_error[known]
    metered, metered_error = _meter(run, clock, windows, f)
    meter_zero = _meter_zero(run, clock, rests)
    frozen = _frozen(metered, metered_error, f)
    metered = np.where(frozen, np.nan, metered)
    least = max(_ZERO_SIGMA * meter_zero.error, _ZERO_LEAST)
    zeroed = meter_zero.known and least < abs(meter_zero.value) < ZERO_MOST
    if zeroed:
        metered = metered - meter_zero.value
    level = {tap: means(run.pressures.get(tap), windows, f)[0] - (own[tap].value if tap in own else 0.0)
             for tap in ("access", "prefilter", "return")}  # fmt: skip
    line = _line(run, windows, f)
    texts = {"run": run.name, "role": run.role, "group": "", "tube": run.tube}
    table = FlowWindows(
        **{name: np.full(f.size, text, dtype=object) for name, text in texts.items()},
        clamp=_clamps(run, windows.centre),
        time=windows.centre,
        flow_set=_set(run.flow_set, windows, np.nan) if run.flow_set is not None else _named(f, metered),
        uf=_set(run.uf, windows, 0.0),
        f=f,
        f_error=f_error,
        A_1=line.amplitude(1) if line is not None else np.full(f.size, np.nan),
        A_1_error=line.amplitude_error(1) if line is not None else np.full(f.size, np.nan),
        back_pressure=level["prefilter"] - level["access"],
        access=level["access"],
        prefilter=level["prefilter"],
        back=level["return"],
        metered=metered,
        metered_error=metered_error,
        flow=np.full(f.size, np.nan),
        own=means(run.own, windows)[0],
    )
    return RunNumbers(
        run,
        table,
        passages,
        turning,
        own,
        meter_zero,
        zeroed,
        int(frozen.sum()),
        tuple(float(level) for level in lost),
        clock,
        source,
        [replace(p, run=run.name) for p in clock.problems] if clock is not None else [],
    )


def pump_of(run: FlowRun) -> Pump:
    """Return when the pump turns: from the pulsation, else from the encoder."""
    pulsating = run.pulsating
    if pulsating is not None:
        return pump(pulsating[1].time, pulsating[1].values)
    assert run.speed is not None
    time, turns = run.speed.time, run.speed.values > 0.1
    edges = np.concatenate([[0], np.flatnonzero(np.diff(turns)) + 1, [time.size]])
    stretches = tuple(
        Turning(float(time[a]), float(time[b - 1]), float(time[a]) if a else None, float(time[b - 1]) if b < time.size else None)
        for a, b in pairwise(edges)
        if turns[a] and b - a > 2
    )  # fmt: skip
    return Pump(stretches, float(time[0]), float(time[-1]))


def _rests(run: FlowRun, turning: Pump) -> list[tuple[float, float]]:
    """Return settled stretches (device's clock) in which the pump stands and no ultrafiltrate is drawn."""
    settled = resting(turning.rests, turning.begin, turning.end)
    if run.uf is None:
        return settled
    at = [run.uf.values[(run.uf.time >= a) & (run.uf.time <= b)] for a, b in settled]
    return [span for span, uf in zip(settled, at, strict=True) if not np.any(uf > 0.0)]


def _windows(run: FlowRun, turning: Pump, clock: MeterClock | None, settings: FlowSettings) -> Windows:
    changes = [
        *(
            steps(one.time, one.values, share)
            for one, share in ((run.flow_set, _SET), (run.uf, _UF))
            if one is not None
        ),
        np.array([entry.time for entry in run.clamps]),
        _speed_steps(run, turning) if run.flow_set is None else np.empty(0),
    ]
    margin = clock.margin if clock is not None else 0.0
    stretches = [(one.first, one.last) for one in turning.stretches]
    return steady_windows(
        stretches, np.concatenate(changes), settings.window, settings.settle + margin, settings.before + margin
    )


def _frequency(
    run: FlowRun, windows: Windows, band: tuple[float, float]
) -> tuple[Passages | None, np.ndarray, np.ndarray, str]:
    """Return passages, frequency and its error (Hz, NaN where not usable), and which channel they were found in."""
    pulsating = run.pulsating
    if pulsating is not None:
        found = find_passages(pulsating[1].time, pulsating[1].values, windows, band)
        return found, found.frequency, found.frequency_error, pulsating[1].name
    assert run.speed is not None
    mean = means(run.speed, windows)[0]
    return None, mean, np.full(mean.size, np.nan), run.speed.name


def _line(run: FlowRun, windows: Windows, f: np.ndarray) -> Harmonics | None:
    """Return the pre-filter pressure's harmonics at the frequencies found; None where it is not logged fast enough."""
    pulsating = run.pulsating
    if pulsating is None or pulsating[0] != "prefilter":
        return None
    return harmonics(pulsating[1].time, pulsating[1].values, windows, f)


def _meter(run: FlowRun, clock: MeterClock | None, windows: Windows, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the meter's mean over the windows and its standard error, m^3/s, shape (w,) each."""
    if clock is None:
        return means(None, windows)
    return means(run.meter, Windows(clock.to_meter(windows.start), clock.to_meter(windows.end)), f)


def _frozen(metered: np.ndarray, error: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return windows in which the meter stands at one value, without noise, while the pump's speed changes, mask (w,)."""
    found = np.zeros(f.size, dtype=bool)
    level = np.nanmax(np.abs(metered), initial=0.0)
    still = np.flatnonzero(error <= 1e-6 * level)
    values = np.round(metered[still] / max(level, 1e-300), 6)
    for value in np.unique(values):
        same = still[values == value]
        if np.ptp(f[same]) > _ONE_SPEED * f[same].min():
            found[same] = True
    found[:-1] |= found[1:]  # it froze within the window before
    return found


def _meter_zero(run: FlowRun, clock: MeterClock | None, rests: Sequence[tuple[float, float]]) -> Zero:
    """Return what the meter reads while the pump stands."""
    if run.meter is None or clock is None:
        return Zero(0.0, float("nan"), known=False)
    narrowed = [(a + clock.margin, b - clock.margin) for a, b in rests if b - a > 2 * clock.margin + 2.0]
    ends = [clock.to_meter(np.array(span)) for span in narrowed]
    return zero_of(run.meter, [(float(a), float(b)) for a, b in ends])


def _named(f: np.ndarray, metered: np.ndarray) -> np.ndarray:
    """Return set-points of a run that logs none, shape (w,): windows of one speed, named after the meter to 1 mL/min."""
    order = np.argsort(f)
    group = np.zeros(f.size, dtype=int)
    group[order] = np.concatenate([[0], np.cumsum(np.diff(f[order]) > _ONE_SPEED * f[order][:-1])]) if f.size else []
    named = np.full(f.size, np.nan)
    for one in np.unique(group):
        inside = group == one
        if np.isfinite(metered[inside]).any():
            named[inside] = np.round(6e7 * np.nanmean(metered[inside])) / 6e7
    return named


def _speed_steps(run: FlowRun, turning: Pump) -> np.ndarray:
    """Return about when the speed changes in a run that logs no set-point, s: each step thrice, as far as it is uncertain."""
    pulsating = run.pulsating
    if pulsating is None:
        return np.empty(0)
    probe = find_passages(pulsating[1].time, pulsating[1].values, cut(turning.begin, turning.end, _PROBE))
    f = probe.harmonics.frequency
    jumps = np.flatnonzero(np.abs(f[1:] / f[:-1] - 1.0) > _STEP)
    borders = probe.windows.end[jumps]
    return np.concatenate([borders - _PROBE, borders, borders + _PROBE])


def _set(one: Signal | None, windows: Windows, without: float) -> np.ndarray:
    return (
        np.full(windows.size, without)
        if one is None or not windows.size
        else held(one.time, one.values, windows.centre)
    )


def _clamps(run: FlowRun, at: np.ndarray) -> np.ndarray:
    """Return the clamp's setting in words at times `at`: the last entry before, else what the run states."""
    words = np.full(at.size, run.clamp, dtype=object)
    for entry in run.clamps:
        words[at >= entry.time] = entry.text
    return words
