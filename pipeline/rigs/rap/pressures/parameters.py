"""The findings' parameters: each number of section 10 at each of its operating points, with its interval or the reason for none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.findings import Parameter
from pipeline.rigs.rap.conditions import TAPS
from pipeline.rigs.rap.pressures.agreement import Limits
from pipeline.rigs.rap.pressures.declaration import PARAMETERS
from pipeline.rigs.rap.pressures.hydraulics_fit import NAMES
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers

_SPECS = {spec.name: spec for spec in PARAMETERS}
_METHODS = {
    "lag": "phases of the pump's lines, nonlinear least squares of eq. (2), errors of groups of windows",
    "clock_rate": "phases of the pump's lines, nonlinear least squares of eq. (2), errors of groups of windows",
    "sensor_pole": "size and phase of the pump's lines, nonlinear least squares of eq. (2)",
    "gain": "Deming's regression of 5 s means, errors by their scatter and effective number",
    "offset": "Deming's regression of 5 s means, errors by their scatter and effective number",
    "bias": "Bland-Altman of samples, blocks of 20 s resampled within levels",
    "limit_lower": "Bland-Altman of samples, blocks of 20 s resampled within levels",
    "limit_upper": "Bland-Altman of samples, blocks of 20 s resampled within levels",
    "coherence": "Welch, Hann, half overlapping, at the line",
    "r_access": "line through the origin of window means, blocks left out in turn",
    "r_filter": "line through the origin of window means, blocks left out in turn",
    "r_return": "line through the origin of window means, blocks left out in turn",
    "c_return": "complex ratios of return to pre-filter pulsation, nonlinear least squares of eq. (4)",
    "l_return": "complex ratios of return to pre-filter pulsation, nonlinear least squares of eq. (4)",
    "k_uf": "UF rate over the transmembrane pressure that it adds, blocks left out in turn",
    "c_uf": "time constant of the switches of ultrafiltration times K_uf",
}


def parameters_of(runs: Sequence[RunNumbers]) -> list[Parameter]:
    """Return all parameters; `at` names the run where there is more than one."""
    several = len(runs) > 1
    return [_parameter(e, run.name if several else "") for run in runs for e in _estimates(run)]


def none_told(reason: str) -> list[Parameter]:
    """Return every parameter without a value, for one reason."""
    return [_parameter(undetermined(spec.name, reason), "") for spec in PARAMETERS]


def _estimates(run: RunNumbers) -> list[Estimate]:
    return [*_clock(run), *_taps(run), *_coherence(run), *_circuit(run)]


def _clock(run: RunNumbers) -> list[Estimate]:
    found = run.alignment
    if found is None:
        return [undetermined(name, run.no_alignment) for name in ("lag", "clock_rate", "sensor_pole")]
    poles = list(found.poles) or [undetermined("sensor_pole", "no line of the pump tells it")]
    return [found.lag, found.rate, *poles]


def _taps(run: RunNumbers) -> list[Estimate]:
    found: list[Estimate] = []
    for tap in TAPS:
        at: dict[str, float | str | bool] = {"channel": tap}
        if tap not in run.taps:
            names = ("gain", "offset", "bias", "limit_lower", "limit_upper")
            found += [undetermined(name, run.no_tap[tap], at) for name in names]
            continue
        numbers = run.taps[tap]
        limits = numbers.agreement.samples
        found += [numbers.deming.gain, numbers.deming.offset]
        found += [_with_means(e, numbers.agreement.means) for e in (limits.bias, limits.lower, limits.upper)]
    return found


def _with_means(found: Estimate, means: Limits) -> Estimate:
    """Add what means of 5 s give to the description of a limit of samples."""
    other = {"bias": means.bias, "limit_lower": means.lower, "limit_upper": means.upper}[found.name]
    if found.value is None or other.value is None:
        return found
    return replace(found, reason="; ".join(filter(None, (found.reason, f"of means of 5 s: {other.value:.1f} Pa"))))


def _coherence(run: RunNumbers) -> list[Estimate]:
    found = [line.coherence for numbers in run.taps.values() for at in numbers.coherence for line in at.lines]
    if found:
        return found
    reason = (
        next(iter(run.no_tap.values()), "")
        if not run.taps
        else "no line of the pump stands in enough windows, or the log is too slow for it"
    )
    return [undetermined("coherence", reason)]


def _circuit(run: RunNumbers) -> list[Estimate]:
    if isinstance(run.circuit, str):
        return [undetermined(name, run.circuit) for name in NAMES]
    return [run.circuit.found.estimates[name] for name in NAMES]


def _parameter(e: Estimate, run: str) -> Parameter:
    spec = _SPECS[e.name]
    value = e.value if e.value is not None and math.isfinite(e.value) else None
    known = value is not None and e.std_error is not None and math.isfinite(e.std_error)
    described = "; ".join(filter(None, (spec.description, e.reason)))
    return Parameter(
        name=e.name, symbol=spec.symbol, value=value, std_error=e.std_error if known else None, type_b=e.type_b if known else None, ci95=e.ci95 if known else None,
        unit=spec.unit, at={**({"run": run} if run else {}), **e.at}, description=described if value is not None else (e.reason or "not determined"),
        source=spec.source, method=_METHODS.get(e.name, "") if value is not None else "",
    )  # fmt: skip
