"""The differences as parameters, null with the reason where there is none."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Parameter
from pipeline.findings.findings import OperatingPoint
from pipeline.rigs.in_words import chance
from pipeline.rigs.rap.cytotoxicity.analysis import Culture, Outcome
from pipeline.rigs.rap.cytotoxicity.declaration import OUTCOMES, PARAMETERS, CytotoxicitySettings

_SPECS = {spec.name: spec for spec in PARAMETERS}
_WHICH = {
    "once": "one control for all times",
    "each": "control of the same time",
    "some": "control of the same time or, without one, of all times",
}


def parameters_of(cultures: Sequence[Culture], settings: CytotoxicitySettings) -> list[Parameter]:
    """Return the differences of all runs; `at` names the run where there are several."""
    found = []
    for culture in cultures:
        at: OperatingPoint = {"run": culture.run} if len(cultures) > 1 else {}
        for name in OUTCOMES:
            if name in culture.outcomes:
                found += _of_outcome(culture.outcomes[name], culture.control, at)
            else:
                reason = f"the log holds no {name}"
                found += [_undetermined(name, reason, {**at, "time": float(time)}) for time in settings.times]
    return found


def _of_outcome(outcome: Outcome, control: str, at: OperatingPoint) -> list[Parameter]:
    told = {time: _undetermined(outcome.name, why, {**at, "time": time}) for time, why in outcome.undetermined.items()}
    found = outcome.found
    if found is not None:
        for i, time in enumerate(outcome.times.tolist()):
            told[time] = _determined(outcome, control, i, {**at, "time": time})
    return [told[time] for time in sorted(told)]


def _determined(outcome: Outcome, control: str, i: int, at: OperatingPoint) -> Parameter:
    found, treated, own = outcome.found, outcome.treated[i], outcome.controls[i]
    assert found is not None
    spec = _SPECS[f"{outcome.name}_difference"]
    inside = -outcome.margin < found.low90[i] and found.high90[i] < outcome.margin
    words = (
        f"Treated less control. 90 % interval {signed(found.low90[i])} to {signed(found.high90[i])} points, "
        f"{'within' if inside else 'not within'} ±{100 * outcome.margin:g}. Over all times: {outcome.verdict}"
    )
    return Parameter(
        name=spec.name,
        symbol=spec.symbol,
        value=float(found.value[i]),
        std_error=float(found.std_error[i]),
        ci95=(float(found.low95[i]), float(found.high95[i])),
        unit="1",
        at=at,
        description=words,
        source=spec.source,
        method=f"means of {treated.n} treated and {own.n} control cultures ({_WHICH[control]}), variance pooled over all groups "
        f"({found.dof} degrees of freedom), two one-sided tests, chance of so small a difference if there were one as large as the margin: {chance(found.p[i])}",
    )


def signed(share: float) -> str:
    """Return a share in percentage points with its sign: ``"+2.31"``."""
    return f"{100 * share:+.2f}".replace("-", "−")


def _undetermined(outcome: str, reason: str, at: OperatingPoint) -> Parameter:
    spec = _SPECS[f"{outcome}_difference"]
    return Parameter(
        name=spec.name, symbol=spec.symbol, value=None, unit="1", at=at, description=reason, source=spec.source
    )
