"""Runs that contradict all others: found by leaving sets of runs out, set aside, and told with what explains them.

Gain errors, late forces, swapped current labels or bent signals of a few runs spoil the fit of all
(mre.md section 8); without them the others agree. Nothing is set aside unless they do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from pipeline.rigs.in_words import times_noise
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.shear.linearised import Linearised
from pipeline.rigs.mre.shear.odd_causes import causes_of, told_causes

# So many runs must stay for each that is set aside, and so many at least.
_STAY_PER_ODD, _FEWEST = 5, 4
# Beside runs without which the fit is no longer rejected, runs of another gain are looked for up to this share.
_SHARE_ODD = 0.25
# More sets of runs than this are not tried.
_MOST_SETS = 3000
# Gains are odd that honest scatter brings about in less than this share of campaigns, and only if so large.
_CHANCE, _GAIN_SIZE = 0.003, 0.01
_CERTAIN = 1e-8
# Twice the log-likelihood by which another set of as many runs may be worse and be a rival all the same.
_GAIN_RIVAL = 6.0
# Of rejected fits: so many of the best sets are fitted without, if to first order none is this much better.
_FITTED, _WORSE = 4, 20.0
# By so much must the deviance, less its degrees of freedom, fall for more runs to be left out; sets of as many runs
# are rivals within it.
_DECISIVE = 30.0
# So many exchanges of current labels are fitted; beyond this share of the runs rivals are too many to be listed.
_EXCHANGES, _LISTED = 3, 1 / 3
# Where no few runs can be spared, those are told that bring chi2 of the others down to this share at least.
_HELPS = 0.5


@dataclass(frozen=True)
class OddRun:
    """A run set aside, and in one sentence why."""

    run: str
    reason: str


def set_odd_runs_aside(
    found: Identification, loops: Sequence[Loop], options: FitOptions
) -> tuple[Identification, tuple[OddRun, ...], tuple[str, ...]]:
    """Return the identification without the runs that contradict the others, those runs, and rivals.

    `loops` are those that `found` was made from. Where no few runs explain the contradiction, or others
    would explain it as well, `found` comes back as it is; the rivals are those runs, in words.
    """
    fit = found.selected
    kept = [loop for loop in loops if loop.kept.any()]
    most = (len(kept) - _FEWEST + _STAY_PER_ODD - 1) // _STAY_PER_ODD
    if most < 1 or not (fit.rejected or fit.run_scatter > 0):
        return found, (), ()
    search = _Search(fit, kept, options, most)
    odd, rivals = search.contradicting() if fit.rejected else search.of_other_gain()
    if not odd:
        few = len(rivals) <= max(_LISTED * len(kept), 2)
        if rivals and few:
            return found, (), search.told(rivals)
        return found, (), search.told_strongest() if rivals or fit.rejected else ()
    best = _without(odd, kept, options)
    if best is None or best.selected.rejected:
        return found, (), ()
    if fit.rejected:
        best, odd = _with_other_gains(best, odd, kept, options)
    elif best.selected.run_scatter >= fit.run_scatter:
        return found, (), ()
    reasons = tuple(
        OddRun(loop.run, _reason(loop, best.selected, fit, len(odd))) for loop in fit.loops if loop.run in odd
    )
    return best, reasons, ()


def _with_other_gains(
    found: Identification, odd: tuple[str, ...], loops: Sequence[Loop], options: FitOptions
) -> tuple[Identification, tuple[str, ...]]:
    """Look for runs of another gain beside those that are out already."""
    most = int(_SHARE_ODD * len(loops)) - len(odd)
    if most < 1 or not found.selected.run_scatter > 0:
        return found, odd
    others = [loop for loop in loops if loop.run not in odd]
    more, _ = _Search(found.selected, others, options, most).of_other_gain()
    best = _without((*odd, *more), loops, options) if more else None
    if best is None or best.selected.rejected or best.selected.run_scatter >= found.selected.run_scatter:
        return found, odd
    return best, (*odd, *more)


class _Search:
    """The search for odd runs about one fit; runs are named by their index in `loops`."""

    def __init__(self, fit: DynamicFit, loops: Sequence[Loop], options: FitOptions, most: int) -> None:
        self.fit, self.loops, self.options, self.most = fit, loops, options, most
        self.linear = Linearised(fit, options.scatter_cap)

    def _sets(self, size: int) -> list[tuple[int, ...]]:
        if math.comb(len(self.loops), size) > _MOST_SETS:
            return []
        return list(combinations(range(len(self.loops)), size))

    def _names(self, runs: Sequence[int]) -> tuple[str, ...]:
        return tuple(self.loops[i].run for i in runs)

    def of_other_gain(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the runs whose gain stands out of honest scatter, else sets of runs that would do as well.

        Of several sizes the largest set is taken of which no run could be spared.
        """
        n = len(self.loops)
        for size in range(self.most, 0, -1):
            ranked = self.linear.ranked_gains(self._sets(size), self.fit.run_scatter)[:6]
            tests = sorted(((self.linear.test_gains(runs), runs) for runs in ranked), key=lambda t: t[0].deviance)
            if not tests:
                continue
            test, runs = tests[0]
            if test.chance * math.comb(n, size) > _CHANCE or abs(test.coefficients).min() < _GAIN_SIZE:
                continue
            others = [(run, [other for other in runs if other != run]) for run in runs]
            if size > 1 and any(self.linear.test_gains([run], rest).chance * n > _CHANCE for run, rest in others):
                continue
            alike = [other for rival, other in tests[1:] if rival.deviance < test.deviance + _GAIN_RIVAL]
            return self._decided(runs, alike, certain=test.chance < _CERTAIN)
        return (), ()

    def _decided(
        self, runs: tuple[int, ...], alike: Sequence[tuple[int, ...]], certain: bool = False
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return `runs` as odd, or as rivals with sets `alike` or with the one run that stays at their current.

        The field terms of a current follow its only run, whichever that is; only the terms that all currents
        share tell then, which counts where they do so with certainty.
        """
        level = [self.fit.level_of(loop.current) for loop in self.loops]
        left = [level[i] for i in range(len(level)) if i not in runs]
        alone = {level[i] for i in runs if left.count(level[i]) == 1 and len(set(level)) > 1}
        beside = [i for i in range(len(level)) if level[i] in alone and not certain]
        if alike or beside:
            return (), self._names(_all_of(runs, *alike, beside))
        return self._names(runs), ()

    def contradicting(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the fewest runs without which the fit is not rejected, else sets that would do as well.

        None of both where no few runs can be spared.
        """
        sets = {size: sorted(self._sets(size), key=self.linear.without)[:_FITTED] for size in range(1, self.most + 1)}
        worst = _WORSE * min(self.linear.without(tried[0]) for tried in sets.values() if tried)
        accepted: list[tuple[float, tuple[int, ...]]] = []
        for tried in sets.values():
            fitted = self._fitted([runs for runs in tried if self.linear.without(runs) < worst])
            least, best = min(fitted, default=(math.inf, ()))
            if best and (not accepted or least < accepted[0][0] - _DECISIVE):
                accepted = sorted(entry for entry in fitted if entry[0] < least + _DECISIVE)
        exchanged = self._exchanged() if len(accepted) != 1 else ()
        if exchanged:
            return self._names(exchanged), ()
        return self._decided(accepted[0][1], [runs for _, runs in accepted[1:]]) if accepted else ((), ())

    def _fitted(self, sets: Sequence[tuple[int, ...]]) -> list[tuple[float, tuple[int, ...]]]:
        """Return the deviance without each set, less its degrees of freedom, where the fit is not rejected."""
        tried = []
        for runs in sets:
            without = _without(self._names(runs), self.loops, _quick(self.options))
            if without is not None and not without.selected.rejected:
                fit = without.selected
                tried.append((Linearised(fit, self.options.scatter_cap).deviance_at(fit) - fit.dof, runs))
        return tried

    def _exchanged(self) -> tuple[int, ...]:
        """Return the two runs whose current labels need but be exchanged for all runs to agree; () if none."""
        current = [loop.current for loop in self.loops]
        level = [self.fit.level_of(value) for value in current]
        pairs = [pair for pair in self._sets(2) if level[pair[0]] != level[pair[1]]]
        pairs.sort(key=self.linear.without)
        found = []
        for one, two in pairs[:_EXCHANGES]:
            loops = list(self.loops)
            loops[one] = replace(loops[one], current=current[two])
            loops[two] = replace(loops[two], current=current[one])
            agreed = _without((), loops, _quick(self.options))
            if agreed is not None and not agreed.selected.rejected:
                found.append((one, two))
        return found[0] if len(found) == 1 else ()

    def told(self, rivals: Sequence[str]) -> tuple[str, ...]:
        """Return runs that contradict each other, each with what explains it by a fit without them."""
        causes = self._causes(rivals)
        return tuple(f"{run} ({causes[run]})" if run in causes else run for run in rivals)

    def told_strongest(self) -> tuple[str, ...]:
        """Return the runs that stand out most and have an explanation, against all others as a whole."""
        sets = next((sets for size in range(self.most, 0, -1) if (sets := self._sets(size))), [])
        strongest = min(sets, key=self.linear.without, default=())
        if not self.linear.without(strongest) < _HELPS * self.linear.without(()):
            return ()
        causes = self._causes(self._names(strongest))
        others = f"the other {len(self.loops) - len(causes)} runs as a whole"
        return (*(f"{run} ({cause})" for run, cause in causes.items()), others) if causes else ()

    def _causes(self, runs: Sequence[str]) -> dict[str, str]:
        """Return in words what explains runs by a fit of the others, or by one without each where too few are left."""
        told = {}
        together = _without(runs, self.loops, _quick(self.options)) if len(runs) <= self.most else None
        for loop in self.fit.loops:
            if loop.run in runs:
                without = together or _without((loop.run,), self.loops, _quick(self.options))
                causes = causes_of(loop, without.selected) if without is not None else []
                if causes:
                    told[loop.run] = ", or ".join(cause.text for cause in causes)
        return told


def _all_of(*sets: Sequence[int]) -> tuple[int, ...]:
    return tuple(dict.fromkeys(i for runs in sets for i in runs))


def _quick(options: FitOptions) -> FitOptions:
    """Return options for fits that only rank."""
    return replace(options, starts=1)


def _without(runs: Sequence[str], loops: Sequence[Loop], options: FitOptions) -> Identification | None:
    """Return the identification without some runs; None where too few data are left."""
    try:
        return identify_loops([loop for loop in loops if loop.run not in runs], options)
    except ValueError:
        return None


def _reason(loop: Loop, fit: DynamicFit, before: DynamicFit, together: int) -> str:
    without = "without it" if together == 1 else f"without these {together} runs"
    if before.rejected:
        gained = (
            f"{without} the misfit of the other runs falls from {times_noise(before.chi2 / max(before.dof, 1))} "
            f"to {times_noise(fit.chi2 / max(fit.dof, 1))}"
        )
    else:
        gained = (
            f"{without} the scatter of the other runs falls from {100 * before.run_scatter:.2g} % to "
            f"{100 * fit.run_scatter:.2g} %"
        )
    return f"it contradicts the other runs: {told_causes(loop, fit)}; {gained}"
