"""Labels of runs held against what was measured: frequency, amplitude, coil current (mre.md section 8)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.errors import listing
from pipeline.rigs.mre.shear.runs import apart
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns

# An amplitude this many times its label, or less than the reciprocal.
_AMPLITUDE_RATIO = 1.25
# A frequency this far off its label, which may be rounded; and one that is off by the same factor in this share
# of several runs at different frequencies, or by itself while the others agree with theirs.
_FREQUENCY_APART, _TOGETHER_APART, _AGREES = 0.03, 0.01, 0.003
_SAME_FACTOR, _MOST_RUNS, _SEVERAL = 0.2, 0.8, 3
# By what a time is too long that was written in another unit than was said.
_UNITS_OF_TIME = {1e3: "ms taken as s", 1e6: "µs taken as s", 60.0: "s taken as min", 1e-3: "s taken as ms"}
_SAME_UNIT = 0.05


def say_labels(runs: SortedRuns) -> list[str]:
    """Say which labels the records contradict; return what casts doubt on the numbers."""
    conditions = {held.run: held.conditions for held in runs.held}
    return [
        doubt for doubt in (_frequencies(runs), _amplitudes(runs, conditions), _currents(runs, conditions)) if doubt
    ]


def _frequencies(runs: SortedRuns) -> str:
    """Doubt the time base where the frequencies are not those of the labels.

    Stamps that are too long by a factor make the motion slower by it, damping coefficients, relaxation
    time and lag larger; stiffness stays.
    """
    ratios = {
        u.run: u.loop.frequency / u.label_frequency for u in runs.loops if u.loop is not None and u.label_frequency
    }
    if not ratios:
        return ""
    labels = {u.label_frequency for u in runs.loops if u.run in ratios}
    middle = float(np.median(list(ratios.values())))
    alike = [run for run, ratio in ratios.items() if abs(ratio - middle) < _SAME_FACTOR * abs(middle - 1)]
    together = len(ratios) >= _SEVERAL and len(labels) > 1 and len(alike) >= _MOST_RUNS * len(ratios)
    if together and abs(middle - 1) > _TOGETHER_APART:
        doubt = (
            f"{len(alike)} of {len(ratios)} runs are {middle:.3g} times as fast as their labels say, at all frequencies alike: a "
            f"wrong time base (sample rate{_unit_of_time(1 / middle)}). If the labels are right, damping coefficients, relaxation time and lag come out "
            f"{1 / middle:.3g} times as large as they are; stiffness does not depend on it. Mend the time base, or the labels."
        )
        runs.say("warning", None, doubt, "displacement")
        return doubt
    exact = sum(abs(ratio - 1) < _AGREES for ratio in ratios.values()) >= max(_SEVERAL, _MOST_RUNS * len(ratios))
    limit = _TOGETHER_APART if exact else _FREQUENCY_APART
    off = {run: ratio for run, ratio in ratios.items() if abs(ratio - 1) > limit}
    for usable in runs.loops:
        if usable.run in off and usable.loop is not None:
            runs.say(
                "warning",
                usable.run,
                f"the displacement runs at {usable.loop.frequency:.4g} Hz but the label says {usable.label_frequency:.4g} Hz: a "
                f"wrong label, or a wrong time base{_unit_of_time(1 / off[usable.run]) or '.'} The measured one is used.",
                "displacement",
            )
    if not off:
        return ""
    run = max(off, key=lambda name: abs(np.log(off[name])))
    return (
        f"The measured frequency is not that of the label in {listing(off, 4)} ({off[run]:.3g} times it in {run}): a wrong label, "
        "or a wrong time base, which would make the damping of these runs wrong by this factor, and what is found from them."
    )


def _unit_of_time(factor: float) -> str:
    """Name the units that a time too long by `factor` speaks for, as an addition to a sentence."""
    return next((f": {told}?" for size, told in _UNITS_OF_TIME.items() if abs(factor / size - 1) < _SAME_UNIT), "")


def _amplitudes(runs: SortedRuns, conditions: Mapping[str, Mapping[str, object]]) -> str:
    ratios: dict[str, float] = {}
    for usable in runs.loops:
        amplitude = conditions[usable.run].get("amplitude")
        if usable.loop is not None and isinstance(amplitude, float) and amplitude > 0:
            ratio = usable.loop.amplitude / amplitude
            if not 1 / _AMPLITUDE_RATIO < ratio < _AMPLITUDE_RATIO:
                ratios[usable.run] = ratio
    if not ratios:
        return ""
    middle = float(np.median(list(ratios.values())))
    thousand = " A factor of about 1000: mm taken as m?" if not 1 / 300 < middle < 300 else ""
    double = " A factor of about 2: is the label peak to peak?" if 1.8 < 1 / middle < 2.2 else ""
    told = f"the amplitude is {middle:.3g} times what the label says ({listing(ratios, 4)}).{thousand}{double}"
    run = next(iter(ratios)) if len(ratios) == 1 else None
    runs.say("warning", run, f"{told} The measured one is used.", "displacement")
    return f"{told[0].upper()}{told[1:]} If the label is right, stiffness and damping are wrong by this factor."


def _currents(runs: SortedRuns, conditions: Mapping[str, Mapping[str, object]]) -> str:
    swapped = []
    for usable in runs.loops:
        current = conditions[usable.run].get("coil_current")
        if isinstance(current, float) and usable.current is not None and apart(usable.current, current):
            swapped.append(usable.run)
    if not swapped:
        return ""
    return f"The measured coil current contradicts the label of {listing(swapped, 6)}; the measured one was used."
