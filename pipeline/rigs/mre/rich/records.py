"""Which recordings can be used as rich records, cleaned; the others are left out with the reason."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.separable import linear_fit
from pipeline.recording import Recording
from pipeline.rigs.mre.shear.runs import current_of, moving_part, without_flat_tops
from pipeline.rigs.mre.shear.samples import UnfitError, number_of, pads_of, samples_of
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun
from pipeline.signals.filtering import low_pass
from pipeline.signals.periodicity import classify

# Work over the path, as a share of what rms force would do: below its negative the loops run the wrong way round.
_BACKWARD = 0.02
_SHORTEST_STROKES = 12
_UNRELATED, _SEEN = 0.02, 60.0  # share of the force's power; Hz


def usable_records(recordings: Sequence[Recording]) -> SortedRuns:
    """Look at every recording; all that can be used end among `records`."""
    runs = SortedRuns()
    seen: dict[tuple[str, ...], str] = {}
    for recording in recordings:
        hashes = tuple(source.sha256 for source in recording.provenance.files)
        if hashes and hashes in seen:
            runs.left_out[recording.run] = f"the same file as run '{seen[hashes]}'"
            runs.say("warning", recording.run, f"holds the same bytes as run '{seen[hashes]}'; it is counted once.")
            continue
        seen[hashes] = recording.run
        try:
            usable = _usable(recording, runs)
            runs.records.append(usable)
        except UnfitError as error:
            runs.leave_out(recording.run, str(error), error.channel)
        except InputError as error:
            runs.leave_out(recording.run, str(error))
    return runs


def _usable(recording: Recording, runs: SortedRuns) -> UsableRun:
    series = samples_of(recording, runs.quality.append)
    excitation = classify(series.time, series.x)
    usable = UsableRun(
        run=recording.run,
        series=series,
        excitation=excitation,
        current=current_of(recording, runs),
        preload=number_of(recording, "preload"),
        pads=pads_of(recording),
        sequence=number_of(recording, "sequence_index"),
        test=str(recording.conditions.get("test", "")),
        told_lag=number_of(recording, "force_lag"),
    )
    if excitation.kind == "still":
        raise UnfitError(f"the displacement does not move: {excitation.reason}", "displacement")
    if excitation.kind in ("ramp", "half_cycle") or excitation.strokes < _SHORTEST_STROKES:
        raise UnfitError(
            f"only {excitation.strokes} strokes: a rich record swings many times at many amplitudes and frequencies; a "
            "few cycles go through mre.shear",
            "displacement",
        )
    if excitation.kind == "periodic":
        runs.say(
            "warning",
            recording.run,
            f"cycles of {excitation.frequency:.4g} Hz throughout and no sweep: one frequency may leave parameters open. "
            "mre.shear treats such runs better, several of them together.",
            "displacement",
        )
    usable = without_flat_tops(moving_part(usable), runs)
    _refuse_backward(usable)
    return usable


def _refuse_backward(usable: UsableRun) -> None:
    """Raise where force falls as displacement rises, or the loops give work."""
    kept = usable.series.counts
    x, F = usable.series.x[kept], usable.series.F[kept]
    x, F = x - x.mean(), F - F.mean()
    correlation = float(x @ F) / max(float(np.sqrt((x @ x) * (F @ F))), 1e-300)
    if correlation < -0.3:
        raise UnfitError(
            f"force falls as displacement rises (correlation {correlation:.2f}): one of the two has the wrong sign; mend it "
            "in the recipe with 'sign: -1'",
            "force",
        )
    velocity = np.gradient(low_pass(usable.series.time, usable.series.x, _SEEN), usable.series.time)[kept]
    motion = np.column_stack([x, velocity - velocity.mean()])
    explained = 1 - linear_fit(motion, F).chi2 / max(float(F @ F), 1e-300)
    if explained < _UNRELATED:
        raise UnfitError(
            f"displacement and velocity explain {100 * max(explained, 0.0):.2g} % of the force: wrong channels, or clocks that are "
            "far apart",
            "force",
        )
    work = float(np.trapezoid(F, x))
    if work < -_BACKWARD * float(np.abs(np.diff(x)).sum()) * float(np.sqrt(F @ F / F.size)):
        raise UnfitError(
            "the loops of force over displacement run the wrong way round, as if the sample gave energy: displacement and "
            "force may be swapped, or the displacement late (a filter, or clocks that are offset)",
            "force",
        )
