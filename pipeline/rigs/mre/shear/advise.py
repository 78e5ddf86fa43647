"""What to measure next: loops whose Fisher information about the fitted model shrinks its intervals most (`rigfit advise`).

From the findings and their tables alone; `design` knows the model. Nothing is fitted here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pipeline.estimation.design import Information
from pipeline.findings import Findings, Parameter
from pipeline.rigs.advice import Advice, Proposal, Shrinkage
from pipeline.rigs.mre.model.determination import LARGEST_RELATIVE
from pipeline.rigs.mre.model.fit_errors import shared_name
from pipeline.rigs.mre.shear.design import INFORMATION, NOISE, Fitted
from pipeline.rigs.over_runs import natural

_MOST = 6
# How far beyond the campaign a proposed run may go, as factors of its lowest and highest frequency and amplitude.
_FREQUENCIES, _AMPLITUDES = (0.4, 1.8), (0.5, 1.6)
_GRID = 7
# Proposals at one current differ by at least this factor in frequency or amplitude.
_APART = 1.3
# Standard errors beyond a parameter's own size are as good as none.
_NOTHING_KNOWN = 1.0
_SURE = 0.3  # relative standard error with which an undetermined stiffness or damper counts as told
_WORTH = 0.03  # a smaller share of the standard error is no gain
_OF_FIT = ("tau", "k1", "s1", "k2", "alpha_bw", "rho", "c_bw", "n_bw", "k_mr", "s_mr", "force_lag")


@dataclass(frozen=True)
class _Run:
    frequency: float
    amplitude: float
    level: int


def advise(findings: Findings) -> Advice:
    """Return up to six single runs, the most telling first."""
    table, noise, runs = (findings.arrays.get(name) for name in (INFORMATION, NOISE, "runs"))
    if table is None or noise is None or runs is None:
        return Advice(
            remarks=[
                "The findings hold no fit of loops that tells what further runs would add: none was made, or an earlier version of rigfit "
                "wrote them. Identify again."
            ]
        )
    if findings.verdict == "rejected":
        return Advice(remarks=["The findings are rejected: what a model that does not hold would gain is no advice."])
    fitted = Fitted.of(table, noise)
    loops = runs[runs["chi2_reduced"].notna()]
    frequencies, amplitudes = loops["frequency"].to_numpy(float), _amplitudes(findings, list(loops["run"]))
    candidates = [
        _Run(f, X, level)
        for f, X, level in product(
            _grid(frequencies, _FREQUENCIES), _grid(amplitudes, _AMPLITUDES), range(len(fitted.layout.levels))
        )
    ]
    mains = float(findings.settings.get("mains_frequency", 50.0))
    told = fitted.told_by([(c.frequency, c.amplitude, c.level) for c in candidates], mains)
    base, size = fitted.information, _sizes(fitted)
    gains = [_gain(base, base + one, size) for one in told]
    proposals: list[Proposal] = []
    chosen: list[_Run] = []
    for number in np.argsort(-np.array(gains)).tolist():
        run = candidates[number]
        if len(chosen) == _MOST or any(_alike(run, other) for other in chosen):
            continue
        shrinks = _shrinks(findings, fitted, base + told[number])
        if not shrinks:
            continue
        chosen.append(run)
        conditions = {"frequency": run.frequency, "amplitude": run.amplitude}
        current = _named(findings, fitted.layout.levels[run.level])
        if len(fitted.layout.levels) > 1 or current:
            conditions["coil_current"] = current
        if fitted.preload is not None:
            conditions["preload"] = round(fitted.preload, 1)
        proposals.append(Proposal(conditions, 1, _why(run, frequencies, amplitudes, shrinks), shrinks))
    return Advice(proposals, _remarks(findings, fitted))


def _amplitudes(findings: Findings, runs: Sequence[str]) -> np.ndarray:
    told = [findings.find("stiffness_storage", run=run) for run in runs]
    return np.array([float(found[0].at["amplitude"]) for found in told if found and "amplitude" in found[0].at])


def _grid(values: np.ndarray, reach: tuple[float, float]) -> list[float]:
    points = np.geomspace(reach[0] * values.min(), reach[1] * values.max(), _GRID)
    return sorted({float(f"{value:.2g}") for value in points})


def _sizes(fitted: Fitted) -> np.ndarray:
    """Return the size of each parameter that counts as nothing known; field terms and lag against what they add to."""
    stiffness = abs(fitted.value("k1")) + abs(fitted.value("k2"))
    typical = {"k_mr": stiffness, "s_mr": abs(fitted.value("k1")) * fitted.value("tau"), "force_lag": 1e-3}
    typical |= {"moving_mass": 1.0}

    def own(text: str) -> float:
        name = shared_name(text.split(" at ")[0])
        return typical[name] if name in typical else abs(fitted.value(name))

    return _NOTHING_KNOWN * np.array([own(text) for text in fitted.information.names])


def _gain(before: Information, after: Information, size: np.ndarray) -> float:
    """Return the gain of information in nats, a parameter of no known size counting as known to its own size."""
    scale = np.outer(size, size)
    return 0.5 * float(
        np.linalg.slogdet(after.matrix * scale + np.eye(size.size))[1]
        - np.linalg.slogdet(before.matrix * scale + np.eye(size.size))[1]
    )


def _alike(a: _Run, b: _Run) -> bool:
    apart = max(abs(math.log(a.frequency / b.frequency)), abs(math.log(a.amplitude / b.amplitude)))
    return (a.level == b.level and apart < math.log(_APART)) or apart == 0


def _shrinks(findings: Findings, fitted: Fitted, after: Information) -> list[Shrinkage]:
    """Return what a run does to the parameters of the findings, the greatest gain first."""
    found = []
    for p in findings.parameters:
        gradient = _gradient(fitted, p)
        if gradient is None or (p.value is not None and not p.std_error):
            continue
        now, then = fitted.information.std_error(gradient), after.std_error(gradient)
        size = abs(sum(slope * fitted.value(name) for name, slope in gradient.items()))
        if p.value is None:
            limit = LARGEST_RELATIVE.get(p.name, _SURE if p.name in ("k2", "s1") else 0.0)
            if math.isfinite(then) and then < limit * size:
                found.append((math.inf, Shrinkage(p.name, p.at, None, then, p.unit)))
        elif math.isfinite(now) and then < (1 - _WORTH) * now:
            # What the findings tell holds more than the information does (type B): only the rest shrinks.
            own = math.sqrt(max((p.std_error or 0.0) ** 2 - (p.type_b or 0.0) ** 2, 0.0))
            error = math.hypot(own * then / now, p.type_b or 0.0)
            if error < (1 - _WORTH) * (p.std_error or 0.0):
                found.append((now / then, Shrinkage(p.name, p.at, p.std_error, error, p.unit)))
    return [shrinkage for _, shrinkage in sorted(found, key=lambda pair: -pair[0])]


def _gradient(fitted: Fitted, p: Parameter) -> dict[str, float] | None:
    """Return a parameter's derivatives with respect to those of the fit; None where the fit does not tell it."""
    if p.name not in _OF_FIT or "run" in p.at or "group" in p.at:
        return None
    names = fitted.information.names
    if p.name == "s1":
        return {"k1": fitted.value("tau"), "tau": fitted.value("k1")} if {"k1", "tau"} <= set(names) else None
    current = p.at.get("coil_current")
    if current is None:
        return {p.name: 1.0} if p.name in names else None
    level = min(fitted.layout.levels, key=lambda one: abs(one - float(current)))
    own, more = f"{p.name} at {level:g} A", f"{p.name}_increment at {level:g} A"
    if own in names:
        return {own: 1.0}
    if p.name in names:  # a total: the shared coefficient and what this current adds
        return {p.name: 1.0, **({more: 1.0} if more in names else {})}
    return None


def _named(findings: Findings, level: float) -> float:
    """Return what the findings call a level of the current."""
    told = [float(p.at["coil_current"]) for p in findings.parameters if "coil_current" in p.at and "run" not in p.at]
    near = min(told, key=lambda one: abs(one - level), default=level)
    return near if abs(near - level) < 0.05 else round(level, 2)


def _why(run: _Run, frequencies: np.ndarray, amplitudes: np.ndarray, shrinks: Sequence[Shrinkage]) -> str:
    where = []
    for value, known, low, high in (
        (run.frequency, frequencies, "slower than", "faster than"),
        (run.amplitude, amplitudes, "smaller than", "larger than"),
    ):
        if value < 0.95 * known.min():
            where.append(f"{low} any run so far")
        elif value > 1.05 * known.max():
            where.append(f"{high} any run so far")
    first = [s.name for s in shrinks if s.now is None]
    words = " and ".join(where) if where else "within the range of the runs so far"
    if first:
        return f"{words[0].upper()}{words[1:]}: it would tell {_listed(first)}, which the runs so far do not."
    return f"{words[0].upper()}{words[1:]}: it tells most of {_listed([s.name for s in shrinks[:3]])}."


def _listed(names: Sequence[str]) -> str:
    *others, last = sorted(dict.fromkeys(names), key=natural)
    return f"{', '.join(others)} and {last}" if others else last


def _remarks(findings: Findings, fitted: Fitted) -> list[str]:
    remarks = [
        f"Each run is taken to last {fitted.duration:.3g} s with the noise of the runs so far, and the model as fitted to hold there."
    ]
    if fitted.run_scatter > 0:
        remarks.append(
            f"From run to run the force scatters by {100 * fitted.run_scatter:.2g} %: of each run only its form beyond that gain counts, "
            "and what all runs share is averaged over them."
        )
    open_ = [p.name for p in findings.parameters if p.value is None and p.name in _OF_FIT]
    if open_:
        remarks.append(
            f"{_listed(open_)} {'is' if len(open_) == 1 else 'are'} not determined yet: what further runs tell is reckoned at the values "
            "where the search ended, and rougher for that. Ask again after the first of them."
        )
    if len(fitted.layout.levels) == 1:
        remarks.append("All runs are at one current: only runs at another tell k_mr and s_mr.")
    return remarks
