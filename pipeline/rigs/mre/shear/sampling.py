"""Is a run sampled fast enough for its motion? Motion above half the rate is seen as an alias (mre.md section 8).

An alias is slower than the motion, and every second one runs the loop backwards. From the samples alone
it cannot be told: the label's frequency tells it, or the few samples a cycle make it likely.
"""

from __future__ import annotations

from pipeline.errors import listing
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun

# Below this the force's harmonics, which fall to a part in a thousand near the tenth, fold onto those that are fitted.
ENOUGH_A_CYCLE = 20
_ALIAS_APART = 0.03


def rate_of(usable: UsableRun) -> float:
    """Return the samples per second of a run."""
    return usable.rate


def alias_of(frequency: float, rate: float) -> float:
    """Return at which frequency (Hz) a motion of `frequency` is seen with `rate` samples a second.

    Examples
    --------
    >>> alias_of(5.0, 8.0), alias_of(5.0, 20.0)
    (3.0, 5.0)
    """
    return abs(frequency - rate * round(frequency / rate))


def said_alias(usable: UsableRun) -> str:
    """Say that the labelled motion cannot be in this log; an empty text where it can, or where something else is."""
    label, rate = usable.label_frequency, rate_of(usable)
    if not label or label < 0.5 * rate:
        return ""
    seen, expected = usable.excitation.frequency, alias_of(label, rate)
    resolution = 2 / (usable.series.time[-1] - usable.series.time[0])
    if seen is not None and not any(
        abs(k * seen - expected) < max(_ALIAS_APART * expected, resolution) for k in range(1, 5)
    ):
        return ""
    return (
        f"logged at {rate:.4g} samples a second, which cannot hold the {label:.4g} Hz of its label (half the rate is "
        f"{rate / 2:.4g} Hz): what is seen is an alias at {expected:.3g} Hz. Log at {40 * label:.4g} Hz or more, or mend the "
        "label"
    )


def may_be_alias(usable: UsableRun, frequency: float) -> bool:
    """Tell whether motion seen at `frequency` (Hz) may be the alias of a faster one."""
    coarse = rate_of(usable) < ENOUGH_A_CYCLE * frequency
    known = usable.label_frequency is not None and usable.label_frequency < 0.45 * rate_of(usable)
    return coarse and not known


def say_coarse(runs: SortedRuns) -> str:
    """Say which loops have few samples a cycle; return what that casts doubt on."""
    coarse = {
        u.run: rate_of(u) / u.loop.frequency
        for u in runs.loops
        if u.loop is not None and rate_of(u) < ENOUGH_A_CYCLE * u.loop.frequency
    }
    if not coarse:
        return ""
    worst = min(coarse, key=lambda run: coarse[run])
    usable = next(u for u in runs.loops if u.run == worst)
    told = (
        f"only {coarse[worst]:.3g} samples a cycle ({rate_of(usable):.4g} a second, run {worst}): harmonics of the force above "
        f"half the rate fold onto those that are fitted"
    )
    alias = ", and a motion faster than that would look like this one (alias)" if usable.label_frequency is None else ""
    more = "" if usable.label_frequency is not None else " Give 'frequency' to rule out an alias."
    runs.say("warning", worst if len(coarse) == 1 else None, f"{told}{alias}.", "force")
    return f"Few samples a cycle in {listing(coarse, 6)}: {told}{alias}. Log {2 * ENOUGH_A_CYCLE} samples a cycle or more.{more}"
