"""Records held against each other: those of several currents in what the field is said to leave alone, which is a test
of the paper's assumption; those of one current and preload in everything, which is a test of the rig.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.rigs.mre.pads import group_levels
from pipeline.rigs.mre.rich.comparison import Comparison, compared, symbol
from pipeline.rigs.mre.rich.fits import RichFit

# k1, s1, a_BW, rho, C, n are taken for independent of the current (mre.md 3.6).
SHARED = ("k1", "tau", "alpha_bw", "rho", "c_bw", "n_bw")
_REPEATED = (*SHARED, "k2", "s_mr")
# Repeats are told apart from here on: two mountings never agree to the last digit.
_CONTRADICT, _LEAST, _SAME_CURRENT = 1e-4, 2e-3, 0.25  # of p, of a value, A


def agreement_of(fits: Sequence[RichFit]) -> Comparison | None:
    """Compare records at different currents; None where there are fewer than two that determine anything alike."""
    good = _comparable(fits)
    names = _common(good, SHARED)
    return compared(good, names) if len({fit.current for fit in good}) > 1 and names else None


def say_contradictions(fits: Sequence[RichFit]) -> list[str]:
    """Return the doubts that records of one current and preload throw on each other."""
    doubts = []
    good = [fit for fit in fits if not fit.batch.inadmissible and not fit.linear]
    labels, _ = group_levels([fit.current for fit in good], _SAME_CURRENT) if good else ([], [])
    groups: dict[tuple[int, float | None], list[RichFit]] = {}
    for fit, label in zip(good, labels, strict=True):
        groups.setdefault((label, fit.usable.preload), []).append(fit)
    for members in groups.values():
        current = members[0].current
        names = _common(members, _REPEATED)
        if len(members) < 2 or not names:
            continue
        found = compared(members, names)
        worst = max(names, key=lambda name: _range(found, name))
        if found.p_value >= _CONTRADICT or _range(found, worst) < _LEAST:
            continue
        at = f" at {current:.3g} A" if current is not None else ""
        told = ", ".join(_told(found, name) for name in found.apart[:3])
        doubts.append(
            f"Runs {' and '.join(found.runs)}{at} contradict each other beyond their errors: {told}. {_why(found)}"
        )
    return doubts


def say_gain(agreement: Comparison | None) -> str:
    """Return the doubt that a factor between records of several currents throws, empty where there is none."""
    if agreement is None or not agreement.gains:
        return ""
    same = ", ".join(symbol(name) for name in ("tau", "rho", "c_bw", "n_bw") if name in agreement.names)
    return (
        f"Stiffness, damping and a_BW differ between the currents by one factor while {same} agree: {gains_told(agreement)}. "
        "That is how the gain of a force sensor differs, not what a field does. Check range and amplifier of each run; "
        "intervals do not hold it."
    )


def gains_told(found: Comparison) -> str:
    """Return which run reads the force by how much too high or low."""
    parts = [
        f"run {run} by {100 * gain:+.2g} +- {100 * 2 * found.gain_sd:.1g} % against the others"
        for run, gain in found.gains.items()
    ]
    told = ", ".join(parts)
    return f"{told} (or the other run by as much the other way)" if len(found.runs) == 2 else told


def _why(found: Comparison) -> str:
    if found.gains:
        return f"One factor on the force explains it, a gain: {gains_told(found)}. Intervals do not hold it."
    return "Something changed between them: mounting, preload, heat, or a sensor. Intervals do not hold it."


def _told(found: Comparison, name: str) -> str:
    values = found.own[:, found.names.index(name)]
    return (
        f"{symbol(name)} {' and '.join(f'{value:.4g}' for value in values)} ({100 * _range(found, name):.2g} % apart)"
    )


def _range(found: Comparison, name: str) -> float:
    column = found.own[:, found.names.index(name)]
    return float((column.max() - column.min()) / max(abs(column.mean()), 1e-300))


def _comparable(fits: Sequence[RichFit]) -> list[RichFit]:
    return [fit for fit in fits if fit.current is not None and not fit.batch.inadmissible and not fit.linear]


def _common(fits: Sequence[RichFit], names: Sequence[str]) -> tuple[str, ...]:
    return tuple(n for n in names if fits and all(n in f.batch.names and n not in f.batch.undetermined for f in fits))
