"""What `rigfit check` can tell of one dynamic log, in the words of `identify`: what rejects it is an error.

That a second excitation is needed one log alone does not tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tpjb.dynamic.record import Record


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Return what would keep this log out of the identification, and what it lacks.

    Raises
    ------
    InputError
        If this log alone leaves nothing to identify: too short, a direction without a probe, no tones.
    """
    from pipeline.rigs.tpjb.dynamic.declaration import DynamicSettings
    from pipeline.rigs.tpjb.dynamic.inertia import inertia_of
    from pipeline.rigs.tpjb.dynamic.motion import ACCELEROMETERS
    from pipeline.rigs.tpjb.dynamic.sorting import read_record
    from pipeline.rigs.tpjb.probes import GAPS, probes_of

    run = recording.run
    test = str(recording.conditions.get("test", "dynamic")).strip()
    if test.lower() != "dynamic":
        raise InputError(f"run '{run}' is a run of the test '{test}', not of the dynamic test.")
    fatal = []
    for axis in "uv":
        if not any(name in recording for name in ACCELEROMETERS if name[4] == axis):
            fatal.append(f"no accelerometer along {axis}: the inertia of the stator cannot be taken off the force.")
    inertia = inertia_of([recording], {})
    if inertia.mass is None:
        fatal.append(inertia.source)
    try:
        probes_of(recording.names, recording.conditions, run=run)
    except InputError as error:
        raise InputError(" ".join([str(error), *fatal])) from error
    try:
        record = read_record(recording, [*GAPS, *ACCELEROMETERS], DynamicSettings().shaft_orders)
        fatal += _of_motion(record, recording)
    except InputError as error:
        raise InputError(" ".join([str(error), *fatal])) from error
    said = [finding for finding in record.quality if finding.level != "note"]
    told = [replace(f, level="error") if f.message in fatal else f for f in said]
    missing = [QualityFinding("error", text, run) for text in fatal if not any(f.message == text for f in said)]
    return [*told, *missing]


def _of_motion(record: Record, recording: Recording) -> list[str]:
    """Return what rejects a log by how forces, displacement and acceleration go together."""
    from pipeline.rigs.tpjb.dynamic import motion
    from pipeline.rigs.tpjb.dynamic.pooling import check_state
    from pipeline.rigs.tpjb.dynamic.record import in_xy

    check_state(record, recording)
    if record.unusable:
        return []
    if not record.usable.any():
        return ["neither force_u nor force_v holds a tone; was the drive on?"]
    D, _, _ = motion.displacement_of(record, recording)
    A = motion.acceleration_of(record, D)
    D, F = D[record.usable], in_xy(*(record.amplitudes[n] for n in ("force_u", "force_v")))[record.usable]
    fatal = [record.no_acceleration] if record.no_acceleration else []
    stiffness = float(np.linalg.norm(F) / max(float(np.linalg.norm(D)), 1e-30))
    if not motion.PLAUSIBLE[0] < stiffness < motion.PLAUSIBLE[1]:
        fatal.append(
            f"force over displacement is {stiffness:.3g} N/m, where {motion.PLAUSIBLE[0]:.0e} to {motion.PLAUSIBLE[1]:.0e} N/m are a "
            "bearing's: unit of a force (kN) or of a gap (um, mil = 25.4 um)?"
        )
    elif (D.conj() * F).sum().real < 0:
        fatal.append(
            "the displacement goes against the force: probe u/v swapped, or sign of the force or of the gaps inverted?"
        )
    elif A is not None and (
        reason := motion.opposed(A[record.usable], -((2 * np.pi * record.tones[:, None]) ** 2) * D)
    ):
        fatal.append(f"{reason}.")
    return fatal
