"""What `rigfit check` can tell of one dynamic log: probes, tones, length, accelerometers."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Return what would keep this log out of the identification, and what it lacks."""
    from pipeline.rigs.tpjb.dynamic import tones
    from pipeline.rigs.tpjb.dynamic.motion import ACCELEROMETERS
    from pipeline.rigs.tpjb.probes import probes_of

    found: list[QualityFinding] = []
    try:
        probes_of([channel.name for channel in recording], recording.conditions, run=recording.run)
        commanded = tones.commanded_tones(recording)
        if commanded is not None and commanded.size:
            duration = recording.stream_of("force_u").duration
            block = tones.block_length(commanded, None, 0, duration * (1 + 1e-3))
            if block.blocks < tones.LEAST_BLOCKS:
                found.append(
                    QualityFinding(
                        "error",
                        f"{duration:.4g} s hold {block.blocks} blocks of {block.length:.3g} s, which whole cycles of the tones take; at "
                        f"least {tones.LEAST_BLOCKS} are needed. Log longer.",
                    )
                )
    except InputError as error:
        found.append(QualityFinding("error", str(error)))
    for axis in "uv":
        if not any(name in recording for name in ACCELEROMETERS if name[4] == axis):
            text = f"no accelerometer along {axis}: the inertia of the stator cannot be taken off the force."
            found.append(QualityFinding("warning", text))
    return found
