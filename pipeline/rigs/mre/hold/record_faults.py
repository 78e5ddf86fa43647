"""What is doubtful about a hold test whatever is fitted to it: set-point, short holds, a gap that moves, a hot coil."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.declaration import HoldSettings
from pipeline.rigs.mre.hold.law_faults import plain
from pipeline.rigs.mre.hold.record import Record

_SHORT, _LONG = 4.0, 1000.0  # s
_COPPER = 3.9e-3  # 1/K


def judge_record(record: Record, settings: HoldSettings, doubts: Doubts) -> None:
    """Say what is doubtful about a log whatever is fitted to it."""
    doubts.hand_on(record.findings)
    run = record.run
    if record.stairs.is_set_point and not record.swept:
        doubts.doubt(
            run,
            "the current does not vary at all within a hold: it looks like the set-point, or a meter with coarse steps. What the coil really "
            "got (heating, droop of the supply) is not in it.",
            "Log the measured coil current.",
            "current",
        )
    if record.recording.conditions.get("gap_held") is False:
        doubts.doubt(
            run, "the conditions say that the gap was not held: the force then follows the press and not the field."
        )
    short = np.array([hold.duration for hold in record.holds])
    if not record.swept and float(np.median(short)) < _SHORT:
        doubts.doubt(
            run,
            f"the holds last {np.median(short):.2g} s: too short for the force to settle (0.5 s time constant on the way down); the second half "
            "of each was used.",
            "Hold each level for 5 s or longer.",
        )
    if not record.swept and float(np.median(short)) > _LONG:
        doubts.doubt(
            run,
            f"the holds last {np.median(short):.4g} s: ms taken as s (factor 1000)? Relaxation and the force at 10 s depend on the clock.",
            "Check the unit of time.",
        )
    _gap(record, settings, doubts)
    _heat(record, settings, doubts)


def _gap(record: Record, settings: HoldSettings, doubts: Doubts) -> None:
    gap = record.of("displacement_axial")
    if gap is None or not np.isfinite(gap.mean).any():
        return
    moved = float(np.nanmax(gap.mean) - np.nanmin(gap.mean))
    if moved > settings.gap_limit:
        doubts.doubt(
            record.run,
            f"the gap moves by {1e6 * moved:.3g} um during the sweep: it was not held. A pad of 500 N/mm changes its force by "
            f"{5e5 * moved:.2g} N by that alone.",
            "Stiffen or lock the press, and log the gauge.",
            "displacement_axial",
        )


def _heat(record: Record, settings: HoldSettings, doubts: Doubts) -> None:
    """Tell coil resistance and its change from voltage over current."""
    volts = record.of("voltage")
    if volts is not None:
        there = np.isfinite(volts.mean) & (np.abs(record.level) > 0.9)
        if there.sum() >= 2:
            R = np.abs(volts.mean[there] / record.level[there])
            time = record.time[there]
            first, last = float(R[time.argmin()]), float(R[time.argmax()])
            hot = (float(R.max()) / first - 1) / _COPPER
            told = (
                f"coil resistance {first:.4g} ohm at the start, {last:.4g} ohm at the end, {R.max():.4g} ohm at most: the copper is up to "
                f"{plain(hot)} K warmer than at the start"
            )
            if hot > settings.heating_limit:
                doubts.doubt(
                    record.run,
                    f"{told}; pad and gap warm up with it.",
                    "Shorten the holds or let the coil cool.",
                    "voltage",
                )
            elif 0.1 < first < 1e3:
                doubts.note(record.run, f"{told}.", "voltage")
            else:
                doubts.doubt(
                    record.run, f"{told}: no coil has that; check the units of voltage and current.", channel="voltage"
                )
    warm = record.of("temperature")
    if warm is not None and np.isfinite(warm.mean).any():
        rise = float(np.nanmax(warm.mean) - np.nanmin(warm.mean))
        if rise > settings.heating_limit:
            doubts.doubt(
                record.run,
                f"the temperature changes by {plain(rise)} K during the sweep.",
                "Let the rig cool.",
                "temperature",
            )
