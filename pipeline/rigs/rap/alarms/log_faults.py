"""What the device's own list of events tells against itself: unknown words, states that cannot follow one another."""

from __future__ import annotations

import itertools

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.codes import CODES
from pipeline.rigs.rap.alarms.record import is_flag
from pipeline.rigs.rap.alarms.results import Comparison, DeviceLog
from pipeline.rigs.rap.alarms.transitions import STATES, may_follow


def log_faults(log: DeviceLog, comparison: Comparison) -> list[QualityFinding]:
    """Return what is wrong with the logged flags, states and codes."""
    found = []
    if comparison.unknown:
        words = sorted({f"'{entry.text}'" for entry in comparison.unknown})
        found.append(
            QualityFinding(
                "warning",
                f"{len(comparison.unknown)} logged alarm codes are not understood: {listing(words, 6)}. They stand beside no "
                f"re-derived alarm. Write them as {listing(CODES, len(CODES))}.",
                log.run,
                "alarm_code",
            )
        )
    for name, flag in log.flags.items():
        if not is_flag(flag):
            other = flag.values[(flag.values != 0.0) & (flag.values != 1.0)]
            message = f"{name} holds {other[0]:.4g}, but is 0 or 1; no alarm is read from it. Name another channel in the recipe, or mend its scale."
            found.append(QualityFinding("warning", message, log.run, name))
    states = [(entry.time, entry.text.upper().strip()) for entry in log.states]
    strange = sorted({word for _, word in states if word not in STATES})
    if strange:
        found.append(
            QualityFinding(
                "warning",
                f"logged states {listing(strange, 6)} are not known; expected {', '.join(STATES)}.",
                log.run,
                "therapy_state",
            )
        )
    known = [(time, word) for time, word in states if word in STATES]
    for (_, earlier), (time, later) in itertools.pairwise(known):
        if not may_follow(earlier, later):
            found.append(
                QualityFinding(
                    "warning",
                    f"the log goes from state {earlier} to {later}, which the device's state machine does not know: rows are "
                    "missing, or the device skipped a check.",
                    log.run,
                    "therapy_state",
                    (time, time),
                )
            )
    return found
