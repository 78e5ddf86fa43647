"""The device's state machine as a table (rap.md, 3.9), and what of a log is which event.

The table is data: a device with other transitions is another table. Timers and causes are `rederive`'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

STATES = ("OFF", "SETUP", "PRIMING", "READY", "THERAPY", "PAUSE", "ALARM", "TERMINATION")
WITH_PUMPS = ("THERAPY", "PAUSE", "ALARM")


@dataclass(frozen=True)
class Transition:
    """In `source`, `event` leads to `target`; `action` is what the device does."""

    source: str
    event: str
    target: str
    action: str = ""


TABLE = (
    Transition("OFF", "power on", "SETUP"),
    Transition("SETUP", "cartridge mounted", "PRIMING", "fill with saline, remove air, check circuit"),
    Transition("PRIMING", "circuit check passed", "READY", "patient connected"),
    Transition("READY", "pump starts", "THERAPY", "pumps on, clamp open"),
    Transition("THERAPY", "pump stops", "PAUSE", "blood pump, ultrafiltration and heparin off"),
    Transition("PAUSE", "pump starts", "THERAPY"),
    Transition("PAUSE", "blood stood too long", "ALARM", "PROLONGED_STAGNATION"),
    Transition("ALARM", "blood stood too long", "ALARM", "PROLONGED_STAGNATION"),
    *(Transition(state, "cause of an alarm", "ALARM", "pumps off, clamp closed, buzzer, code logged") for state in WITH_PUMPS),
    Transition("ALARM", "cause gone, pump runs", "THERAPY"),
    Transition("THERAPY", "therapy stopped", "TERMINATION", "ultrafiltration off, blood re-infused"),
    Transition("PAUSE", "therapy stopped", "TERMINATION", "blood re-infused"),
    Transition("ALARM", "therapy stopped", "TERMINATION", "blood re-infused"),
    Transition("THERAPY", "tank drained", "THERAPY", "volume segment closed, volume restarts at 0"),
    Transition("PAUSE", "tank drained", "PAUSE", "volume segment closed, volume restarts at 0"),
    Transition("TERMINATION", "switched off", "OFF"),
    # A log may begin anywhere: what came before the first event is not in it.
    *(Transition(state, "pump starts", "THERAPY", "the phases before are not in the log") for state in ("OFF", "SETUP")),
)  # fmt: skip

# What a state that the device logged says as an event; those of therapy are re-derived from the signals.
EVENT_OF_STATE = {
    "SETUP": "power on",
    "PRIMING": "cartridge mounted",
    "READY": "circuit check passed",
    "TERMINATION": "therapy stopped",
    "OFF": "switched off",
}
# States that may follow one another in a log, by the table; PAUSE and THERAPY may also be logged behind an alarm.
_FOLLOWS = {(t.source, t.target) for t in TABLE if "not in the log" not in t.action} | {("ALARM", "PAUSE")}


def target(state: str, event: str, table: Sequence[Transition] = TABLE) -> str | None:
    """Return the state to which `event` leads from `state`; None where the table knows no such transition.

    Examples
    --------
    >>> target("READY", "pump starts"), target("OFF", "pump stops")
    ('THERAPY', None)
    """
    return next((row.target for row in table if row.source == state and row.event == event), None)


def may_follow(earlier: str, later: str) -> bool:
    """Tell whether the device may log the state `later` behind `earlier`."""
    return earlier == later or (earlier, later) in _FOLLOWS
