"""From the numbers of the drives to the parameters of the findings (tire.md, section 10); nothing is fitted here."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import effective_size
from pipeline.findings import Parameter
from pipeline.findings.findings import OperatingPoint
from pipeline.rigs.tire.road.declaration import PARAMETERS
from pipeline.rigs.tire.road.run_numbers import REVERSED, RunNumbers

_SPECS = {spec.name: spec for spec in PARAMETERS}
_REFERENCES = {"load_rms_error": ("vertical_load", "load"), "force_rms_error": ("longitudinal_force", "force")}


def parameters_of(runs: Sequence[RunNumbers]) -> list[Parameter]:
    """Return all parameters, run by run."""
    found: list[Parameter] = []
    for run in runs:
        found += [_of_reference(name, run) for name, (channel, _) in _REFERENCES.items() if run.references.get(channel)]
        found += _events(run)
        found.append(_loss(run))
    return found


def _parameter(found: Estimate, at: OperatingPoint, description: str = "", method: str = "") -> Parameter:
    spec = _SPECS[found.name]
    told = spec.description if found.determined else found.reason
    known = found.determined and found.std_error is not None and math.isfinite(found.std_error)
    return Parameter(
        name=found.name, symbol=spec.symbol, value=found.value, std_error=found.std_error if known else None,
        ci95=found.ci95 if known else None, unit=spec.unit, at=at,
        description="; ".join(part for part in (told, description) if part), source=spec.source, method=method,
    )  # fmt: skip


def _of_reference(name: str, run: RunNumbers) -> Parameter:
    """Return how far a track is from its reference channel."""
    at: OperatingPoint = {"run": run.run}
    channel, track = _REFERENCES[name]
    if run.carried.tire is None:
        return _parameter(undetermined(name, f"no load and no force: {run.carried.reason}"), at)
    if track == "force" and run.reversed:
        return _parameter(undetermined(name, f"no longitudinal force: {REVERSED}"), at)
    compared = run.comparison
    if compared is None or track not in run.tracks:
        return _parameter(undetermined(name, f"no revolution of this drive tells a {track}"), at)
    if run.clocks_unsure:
        reason = f"the clocks of transmitter and vehicle seem {compared.offset:+.2f} s apart, {compared.offset_verdict}"
        return _parameter(undetermined(name, reason), at)
    if not compared.follows:
        return _parameter(undetermined(name, "the vehicle's table does not belong to this log in time"), at)
    reference = getattr(compared, track)
    if reference is None:
        return _parameter(undetermined(name, f"{channel} is not in newtons: it looks like {compared.load_unit}"), at)
    left = (run.tracks[track].value - reference)[run.forces.fits]
    left = left[np.isfinite(left)]
    if left.size < 3:
        reason = f"{channel} and the passages have no time in common: do the two tables belong to one drive?"
        return _parameter(undetermined(name, reason), at)
    rms = float(np.sqrt(np.mean(left**2)))
    square = left**2
    error = float(np.std(square)) / math.sqrt(effective_size(square)) / (2.0 * rms)
    bias = float(left.mean())
    told = f"mean difference {bias:+.0f} N; the reference's own error is in it"
    low, high = max(0.0, rms - 1.96 * error), rms + 1.96 * error
    return _parameter(
        Estimate(name, rms, error, (low, high)), at, told, f"filtered track against {channel}, {left.size} revolutions"
    )


def _events(run: RunNumbers) -> list[Parameter]:
    found = []
    for number, event in enumerate(run.events):
        what = "longitudinal force" if event.kind == "longitudinal" else "load"
        told = f"{what} changes by {event.change:+.0f} N over {event.last - event.first:.1f} s"
        if event.cut:
            told += "; it reaches an end of the log or a gap, its centre is of the part that is seen"
        at: OperatingPoint = {"run": run.run, "event": float(number), "kind": event.kind}
        found.append(
            _parameter(estimate("event_time", event.time, event.time_se), at, told, "deviation from the running median")
        )
    return found


def _loss(run: RunNumbers) -> Parameter:
    at: OperatingPoint = {"run": run.run}
    loss = run.device.loss
    if not math.isfinite(loss.share):
        reason = "a gated transmitter whose counter does not stand while it sleeps: sleep and loss cannot be told apart"
        return _parameter(undetermined("packet_loss", reason), at)
    told = f"{loss.packets} packets, longest gap {1e3 * loss.longest:.0f} ms; counted, no estimate"
    return _parameter(Estimate("packet_loss", loss.share), at, told, "unwrapped counters")
