"""The state machine run over what a log holds: states and alarms as they were due (rap.md, 3.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.rigs.rap.alarms.causes import Cause
from pipeline.rigs.rap.alarms.limits import AlarmLimits
from pipeline.rigs.rap.alarms.pump import PumpRun
from pipeline.rigs.rap.alarms.results import Alarm, DeviceLog, StateSpan
from pipeline.rigs.rap.alarms.transitions import EVENT_OF_STATE, STATES, WITH_PUMPS, target

# An alarm stops the pump within this, s; a stop at another time was a pause.
_STOPS_WITHIN = 3.0
# Standard errors of the moment of a stop: written by the device, seen in the pulsation alone, s.
_WRITTEN, _SEEN = 0.03, 0.4
# Order of what happens at the same moment.
_STATE, _CAUSE, _GONE, _PUMP, _END = range(5)


@dataclass
class _Machine:
    """State, causes at work and the standstill while the events go by; `written` are the stops that the device wrote, s.

    `waiting` are causes that were there before any pump ran: they are alarms from the start of it. `by_alarm` says that
    an alarm stopped the pump, other than the emergency button: the device has told somebody already.
    """

    limits: AlarmLimits
    moments: np.ndarray
    written: np.ndarray
    state: str
    entered: float
    reason: str
    running: bool = False
    stopped: float | None = None
    told_stagnation: bool = False
    by_alarm: bool = False
    active: set[Cause] = field(default_factory=set)
    waiting: set[Cause] = field(default_factory=set)
    states: list[StateSpan] = field(default_factory=list)
    raised: list[Cause] = field(default_factory=list)

    def event(self, time: float, event: str, reason: str = "") -> None:
        """Let `event` happen; what the table does not know changes nothing."""
        new = target(self.state, event)
        if new is not None and new != self.state:
            self.states.append(StateSpan(self.state, self.entered, time, self.reason))
            self.state, self.entered, self.reason = new, time, reason or event

    def stand(self, time: float) -> None:
        """Raise the alarm of stagnation if it was due before `time`."""
        if self.stopped is None or self.told_stagnation or not self._counts():
            return
        due = self.stopped + self.limits.stagnation
        place = int(np.searchsorted(self.moments, due, side="right"))
        if place < self.moments.size and self.moments[place] <= time:
            seen = float(self.moments[place])
            self.told_stagnation = True
            words = f"blood stood longer than {self.limits.stagnation:g} s"
            error = _WRITTEN if self.written.size and np.min(np.abs(self.written - self.stopped)) < 0.1 else _SEEN
            cause = Cause("PROLONGED_STAGNATION", self.stopped, seen, None, words, error)
            self.raised.append(cause)
            self.active.add(cause)
            self.event(seen, "blood stood too long", words)

    def _counts(self) -> bool:
        return self.state in ("PAUSE", "ALARM") and not self.by_alarm


def rederive(
    log: DeviceLog,
    pump: PumpRun,
    moments: np.ndarray,
    causes: Sequence[Cause],
    limits: AlarmLimits,
    uf: np.ndarray | None,
) -> tuple[tuple[StateSpan, ...], tuple[Alarm, ...]]:
    """Return the states and the alarms of a run.

    Parameters
    ----------
    log, pump
        What the device wrote, and when its blood pump ran.
    moments
        Stamps at which the device looks, (n,), s.
    causes
        As of `causes.causes`.
    uf
        Rate of ultrafiltration at `moments`, m^3/s; None where no log tells it.
    """
    begin, end = float(moments[0]), float(moments[-1])
    first = _first_state(log, pump, begin)
    machine = _Machine(limits, moments, pump.written_stops, first, begin, "the log begins")
    machine.running = first in ("THERAPY", "ALARM") and bool(pump.on[0])
    machine.stopped = begin if first == "PAUSE" else None
    for time, kind, what in _events(log, pump, causes, begin, end):
        machine.stand(time)
        if kind == _STATE:
            machine.event(time, EVENT_OF_STATE[str(what)], f"logged: {what}")
        elif kind == _PUMP:
            _pump(machine, time, bool(what))
        elif kind == _CAUSE and isinstance(what, Cause):
            _raise(machine, time, what)
        elif kind == _GONE and isinstance(what, Cause):
            _clear(machine, time, what)
    machine.states.append(StateSpan(machine.state, machine.entered, end, machine.reason))
    return tuple(machine.states), _numbered(machine.raised, moments, uf, pump)


def _first_state(log: DeviceLog, pump: PumpRun, begin: float) -> str:
    logged = [entry.text.upper() for entry in log.states if entry.time <= begin + 1.0 and entry.text.upper() in STATES]
    if logged:
        return logged[-1]
    return "THERAPY" if pump.on.size and pump.on[0] else "READY"


def _events(
    log: DeviceLog, pump: PumpRun, causes: Sequence[Cause], begin: float, end: float
) -> list[tuple[float, int, object]]:
    events: list[tuple[float, int, object]] = [(end, _END, None)]
    events += [
        (e.time, _STATE, e.text.upper()) for e in log.states if e.text.upper() in EVENT_OF_STATE and e.time > begin
    ]
    for start, stop in pump.running:
        events += [(start, _PUMP, True)] if start > begin else []
        events += [(stop, _PUMP, False)] if stop < end else []
    for cause in causes:
        events.append((cause.due, _CAUSE, cause))
        if cause.ended is not None:
            events.append((max(cause.ended, cause.due), _GONE, cause))
    return sorted(events, key=lambda event: (event[0], event[1]))


def _pump(machine: _Machine, time: float, starts: bool) -> None:
    machine.running = starts
    if starts:
        machine.stopped, machine.told_stagnation = None, False
        machine.active = {cause for cause in machine.active if cause.code != "PROLONGED_STAGNATION"}
        if not machine.active:
            machine.event(time, "cause gone, pump runs")
        machine.event(time, "pump starts")
        for cause in sorted(machine.waiting, key=lambda cause: cause.due):
            _raise(machine, time, cause)
        machine.waiting.clear()
    else:
        machine.stopped = time if machine.state in WITH_PUMPS else None
        reasons = [c.code for c in machine.raised if time - _STOPS_WITHIN <= c.due <= time + _STOPS_WITHIN]
        machine.by_alarm = bool(reasons) and "EMERGENCY_STOP" not in reasons
        machine.event(time, "pump stops")


def _raise(machine: _Machine, time: float, cause: Cause) -> None:
    if machine.state not in WITH_PUMPS:
        machine.waiting.add(cause)
        return
    if machine.stopped is not None and time - machine.stopped <= _STOPS_WITHIN:
        machine.by_alarm = cause.code != "EMERGENCY_STOP"
    machine.active.add(cause)
    machine.raised.append(replace(cause, due=max(cause.due, time)))
    machine.event(time, "cause of an alarm", cause.words)


def _clear(machine: _Machine, time: float, cause: Cause) -> None:
    machine.active.discard(cause)
    machine.waiting.discard(cause)
    if not machine.active and machine.running:
        machine.event(time, "cause gone, pump runs")


def _numbered(raised: Sequence[Cause], moments: np.ndarray, uf: np.ndarray | None, pump: PumpRun) -> tuple[Alarm, ...]:
    count: dict[str, int] = {}
    alarms = []
    for cause in raised:
        count[cause.code] = count.get(cause.code, 0) + 1
        ended = cause.ended
        if cause.code == "PROLONGED_STAGNATION":
            again = [start for start, _ in pump.running if start > cause.due]
            ended = again[0] if again else None
        removed, stopped = _removed(cause.began, ended, moments, uf)
        alarms.append(
            Alarm(
                cause.code,
                count[cause.code],
                cause.due,
                cause.std_error,
                cause.began,
                ended,
                cause.words,
                removed,
                stopped,
            )
        )
    return tuple(alarms)


def _removed(
    began: float, ended: float | None, moments: np.ndarray, uf: np.ndarray | None
) -> tuple[float | None, bool]:
    """Return the fluid taken from `began` until the ultrafiltration stops or the cause ends, and whether it stopped."""
    if uf is None:
        return None, False
    last = moments[-1] if ended is None else ended
    i, k = np.searchsorted(moments, [began, last])
    rate = uf[i : k + 1]
    off = np.flatnonzero(rate <= 0.0)
    stop = int(off[0]) if off.size else rate.size
    steps = np.diff(moments[i : i + stop + 1]) if i + stop < moments.size else np.diff(moments[i:])
    return float(np.sum(rate[: steps.size] * steps)), bool(off.size)
