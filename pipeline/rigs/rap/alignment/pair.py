"""Which channels of two clocks see the same thing: what a lag can be found from."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from pipeline.ingest.stamps import rows_per_stamp
from pipeline.recording import Recording
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.tables import Signal, signal

# Two sensors give the same number now and then; a copy gives it nearly always.
_SAME, _ENOUGH = 0.8, 50


@dataclass(frozen=True)
class Pair:
    """A channel of the device and one of the bench, each on its own clock.

    `alike` tells that both are the same quantity: then harmonics are compared as well, else only steps. `rows_per_stamp` is
    how many samples shared a stamp in the log, before ingest spread them.
    """

    name: str
    device: Signal
    bench: Signal
    alike: bool = True
    rows_per_stamp: float = 1.0

    @property
    def usable(self) -> bool:
        """Tell whether both have samples enough, and more than one value."""
        both = (self.device, self.bench)
        return all(s.time.size >= 20 and float(np.ptp(s.values)) > 0.0 for s in both)

    def copied(self, lag: float) -> bool:
        """Tell whether one is a copy of the other at about that lag (s): most numbers are the same while the signal moves."""
        ours, theirs = self.device, self.bench
        start = round((ours.time[0] + lag - theirs.time[0]) * theirs.rate)
        for shift in range(start - 2, start + 3):
            first, skipped = max(shift, 0), max(-shift, 0)
            count = min(ours.values.size - skipped, theirs.values.size - first)
            if count < _ENOUGH:
                continue
            x, y = ours.values[skipped : skipped + count], theirs.values[first : first + count]
            moves = np.r_[False, np.diff(x) != 0.0]
            if moves.sum() > _ENOUGH and float(np.mean(x[moves] == y[moves])) > _SAME:
                return True
        return False


def pairs_of(recording: Recording, without: Collection[str] = ()) -> tuple[Pair, ...]:
    """Return the pressures that both device and bench read; where there is none, a pressure and the flow meter.

    Empty where the run holds no two clocks that see the same thing. Taps named in `without` are left out.
    """
    wanted = [tap for tap in TAPS if tap not in without]
    taps = tuple(_pair(recording, tap, pressure(tap, "rap"), pressure(tap, "bench")) for tap in wanted)
    alike = tuple(pair for pair in taps if pair is not None and pair.usable)
    if alike:
        return alike
    for tap in (tap for tap in ("prefilter", "access", "return") if tap in wanted):
        found = _pair(recording, tap, pressure(tap, "rap"), "blood_flow_bench", alike=False)
        if found is not None and found.usable:
            return (found,)
    return ()


def _pair(recording: Recording, name: str, device: str, bench: str, alike: bool = True) -> Pair | None:
    ours, theirs = signal(recording, device), signal(recording, bench)
    if ours is None or theirs is None:
        return None
    return Pair(name, ours, theirs, alike, rows_per_stamp(recording.quality))
