"""How a run's shaft turns: by its speed signal, else by the nominal speed and the shaft's own line in the gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tpjb.conditions import shaft_speed_of
from pipeline.rigs.tpjb.dynamic import tones
from pipeline.rigs.tpjb.dynamic.blocks import Lines, fit_blocks
from pipeline.rigs.tpjb.dynamic.shaft import ShaftPhase, followed
from pipeline.rigs.tpjb.dynamic.tones import BlockLength


def shaft_of(recording: Recording, noticed: list[QualityFinding]) -> tuple[ShaftPhase | None, bool]:
    """Return the shaft's angle and whether it was measured; None where it stands or nothing is known."""
    nominal = recording.conditions.get("shaft_speed_nominal")
    known = float(nominal) if isinstance(nominal, float | int) and not isinstance(nominal, bool) else None
    if "speed" in recording:
        phase = ShaftPhase.of(recording.stream_of("speed"))
        if phase is not None:
            span = float(phase.time[-1] - phase.time[0])
            found = 2 * np.pi * phase.frequency(float(phase.time[0] + span / 2), span)
            if known and abs(found / known - 1) > 0.02:
                noticed.append(
                    QualityFinding(
                        "warning",
                        f"the shaft turned at {abs(found):.5g} rad/s, {known:.5g} rad/s was set; the measured speed is used.",
                        recording.run,
                        "speed",
                    )
                )
            return (phase if abs(found) > 0.5 else None), True
    speed = shaft_speed_of(recording)
    if speed is None:
        noticed.append(
            QualityFinding(
                "warning",
                "neither 'speed' nor 'shaft_speed_nominal' is given: shaft orders stay in, and there is no synchronous "
                "value. Give the shaft speed.",
                recording.run,
            )
        )
        return None, False
    if abs(speed) < 0.5:
        return None, True
    noticed.append(
        QualityFinding(
            "note",
            "no 'speed' channel: the angle of the shaft is followed by the phase of its own line in the gaps.",
            recording.run,
        )
    )
    return ShaftPhase.steady(abs(speed) / (2 * np.pi)), False


def follow(
    recording: Recording, names: Sequence[str], lines: Lines, begin: float, block: BlockLength
) -> ShaftPhase | None:
    """Follow the shaft by its line in the gaps, first in blocks as short as part the lines, twice."""
    gaps = [name for name in names if name.startswith("gap")]
    if not gaps or lines.shaft is None:
        return lines.shaft
    stream = recording.stream_of(gaps[0])
    members = [name for name in gaps if name in stream.channels]
    middle = begin + block.length * block.blocks / 2
    shortest = tones.shortest_block(lines.tones, lines.shaft.frequency(middle), lines.orders)
    length = min(block.length, shortest)
    for _ in range(3):
        fit = fit_blocks(stream, members, lines, begin, length, int(block.length * block.blocks / length))
        lines = replace(
            lines, shaft=followed(fit.start, length, fit.shaft[:, 0], lines.shaft or ShaftPhase.steady(1.0))
        )
    return lines.shaft
