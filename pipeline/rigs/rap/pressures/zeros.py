"""Is the zero taken? What each pressure reads while the pump stands, and the head of fluid that would explain it (rap.md, 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.pressures.record import G0, WORDS, Record
from pipeline.rigs.rap.pressures.tap_levels import TapLevel

# A reading at rest beyond that is told, Pa (section 8).
ZERO_LIMIT = 100.0


def zero_faults(record: Record, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Return what is to be said of the zeros; a note where the pump never stops."""
    known = [level for level in levels if level.zeroed]
    if levels and not known:
        text = (
            "the log holds no stop of the blood pump, so no zero can be checked or taken off: offsets of the sensors stay in all means. Log 20 s with "
            "the pump off before the start and after the end"
        )
        return [QualityFinding("warning", text, record.run)]
    found = []
    for level in known:
        head = record.head(level.tap)
        left = level.off if head is None else min((level.off, level.off - head), key=abs)
        explained = head is not None and abs(level.off) > ZERO_LIMIT and abs(left) <= ZERO_LIMIT
        if head is not None and explained:
            text = (
                f"{level.channel} reads {level.off:+.0f} Pa with the pump off, as its height over the reservoir gives "
                f"({record.number(f'sensor_height_{level.tap}') or 0.0:+.3f} m of fluid are {head:+.0f} Pa)"
            )
            found.append(QualityFinding("note", text, record.run, level.channel))
        elif level.tap == "uf" and left < -ZERO_LIMIT and record.fluid == "blood":
            text = (
                f"{level.channel} rests at {level.off:+.0f} Pa ({level.off / 133.322:+.2f} mmHg) with the pump off: blood's proteins draw the "
                "ultrafiltrate down to their osmotic pressure, about -25 mmHg; no zero can be told apart from it. Take the zero with saline"
            )
            found.append(QualityFinding("note", text, record.run, level.channel))
        elif math.isfinite(left) and abs(left) > ZERO_LIMIT:
            stated = "" if not head else f" its stated height explains {head:+.0f} Pa of it;"
            text = (
                f"zero not taken: {level.channel} ({WORDS[level.reader]} reading) is {level.off:+.0f} Pa ({level.off / 133.322:+.2f} mmHg) with the pump "
                f"off;{stated} re-zero it; head = {abs(left) / (record.density * G0) * 100.0:.1f} cm: a sensor that much "
                f"{'below' if left > 0 else 'above'} the reservoir's level reads so (state sensor_height_{level.tap})"
            )
            found.append(QualityFinding("warning", text, record.run, level.channel))
    return found
