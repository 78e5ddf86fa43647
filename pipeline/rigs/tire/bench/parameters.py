"""The findings' parameters: each number of section 10 once at each of its operating points, with its interval or the reason for none."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.findings import Parameter
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.campaign import Campaign
from pipeline.rigs.tire.bench.declaration import PARAMETERS
from pipeline.rigs.tire.bench.identifiability import PARAMETERS as RING
from pipeline.rigs.tire.bench.identifiability import contact_lengths, told
from pipeline.rigs.tire.bench.same_tire import in_words
from pipeline.rigs.tire.bench.speed_line import CLOCKS_U
from pipeline.rigs.tire.conditions import DIVIDER

_SPECS = {spec.name: spec for spec in PARAMETERS}
_LENGTHS = {"deformation_length": "deformation", "slope_length": "slope", "zero_length": "zero"}
_MARKS = {"peak_resistance": "peak", "dip_leading": "dip_leading", "dip_trailing": "dip_trailing"}
_CALIBRATION = ("load_sensitivity", "calibration_0", "calibration_1", "calibration_2")
# Reduced chi-square of the PVDF's ratio to the flex sensor above which it is no constant law.
_LAWLESS = 4.0
# Shared errors below that are not told one by one (relative).
_SLIGHT = 1e-3
# Lengths with larger errors than that are none (relative).
_HIDDEN = 0.25
_SOURCES = {
    "pressure": "p0",
    "load_gain": "load cell",
    "belt_radius": "R",
    "outer_radius": "Ro",
}
_NEVER_NEGATIVE = {
    "loss_factor": "the sense of rotation is reversed, or the wheel is driven",
    "sensor_lag": "the log runs backward, or the runs do not tell lag and loss apart",
}
_TIMES = ("sensor_lag", "pvdf_time_constant")
FILM = ("pvdf_gain", "pvdf_time_constant", "pvdf_offset_angle")


def parameters_of(found: Campaign, others: Sequence[BenchRun] = ()) -> list[Parameter]:
    """Return all parameters; of `others`, runs that are left out, the packet loss only."""
    waveform, circuit = "averaged waveform, jackknife over groups of revolutions", _circuit(found)
    type_b = _type_b(found)
    rows = [
        *_told([_radius(found)], "line through the origin, weights by the errors of both means"),
        *_told(_ring(found), _ring_method(found), circuit),
        *_told(map(_length, _contact(found)), "joint ring fit, contact solved"),
        *_told(map(_length, _by_point(found)), waveform),
        *_told(_of_runs(found), waveform, circuit),
        *_told(_calibration(found), "peaks regressed on loads", circuit),
        *_told(_film(found), "order by order, weighted least squares", circuit),
        *_told(_loss([*found.runs, *others]), "counted"),
    ]
    return [
        p.model_copy(update={"type_b": min(type_b[p.name], p.std_error)})
        if p.name in type_b and p.std_error is not None and not p.at
        else p
        for p in rows
    ]


def _type_b(found: Campaign) -> dict[str, float]:
    """Return what gauges, radii and clocks leave uncertain of the numbers of the campaign, standard errors, SI."""
    parts: dict[str, float] = {}
    if found.line is not None and found.line.radius.value is not None:
        parts["rolling_radius"] = max(CLOCKS_U, found.clock_u) * found.line.radius.value
    if found.ring is not None:
        for name in RING:
            whole, own = (found.ring.std_error(name, combined) for combined in (True, False))
            parts[name] = math.sqrt(max(whole**2 - own**2, 0.0))
    if found.calibration is not None and found.calibration.curve is not None:
        gain = found.tire.load_gain_u
        orders = {"calibration_1": 1.0, "calibration_2": 2.0, "load_sensitivity": 1.0}
        for name, order in orders.items():
            parts[name] = order * gain * abs(found.calibration.estimates[name].value or 0.0)
    return parts


def _circuit(found: Campaign) -> str:
    """Return what numbers in ohm rest on."""
    taken = {name: value for name, value in found.tire.assumed.items() if name in DIVIDER}
    how = f"{in_words(taken)} as assumed" if taken else "R1 and VIN as stated"
    return f"rests on {how}, taken as exact: 1 % of R1 is 1 % of it"


def _length(e: Estimate) -> Estimate:
    """Null a length that the noise hides."""
    if e.value is None or e.std_error is None or e.std_error < _HIDDEN * e.value:
        return e
    return undetermined(e.name, "its error is as large as a quarter of it or more: the noise hides the passage", e.at)


def _told(estimates: Iterable[Estimate], method: str, circuit: str = "") -> list[Parameter]:
    """Return findings of estimates; `circuit` is said of all whose unit has ohm in it."""
    rows = []
    for e in estimates:
        spec = _SPECS[e.name]
        described = "; ".join(filter(None, (spec.description, e.reason, circuit if "ohm" in spec.unit else "")))
        value = e.value if e.value is not None and math.isfinite(e.value) else None
        known = value is not None and e.std_error is not None and math.isfinite(e.std_error)
        rows.append(
            Parameter(
                name=e.name, symbol=spec.symbol, value=value, std_error=e.std_error if known else None, ci95=e.ci95 if known else None,
                unit=spec.unit, at=dict(e.at), description=described if value is not None else (e.reason or "not determined"), source=spec.source,
                method=method if value is not None else "",
            )
        )  # fmt: skip
    return rows


def _radius(found: Campaign) -> Estimate:
    if found.line is None:
        return undetermined("rolling_radius", found.no_line)
    if found.line.suspicion:
        return undetermined("rolling_radius", found.line.suspicion)
    radius = found.line.radius
    if found.clock_u and radius.value is not None:
        why = "widened by what contradicts it: " + ("the tire's size" if found.size_doubted else "the two clocks")
        return estimate("rolling_radius", radius.value, found.radius_u * radius.value, reason=why)
    return replace(
        radius,
        reason="gain of road_speed and the rate that both clocks share taken as exact: 1 % of either is 1 % of it",
    )


def _ring_method(found: Campaign) -> str:
    n = len(found.ring.runs) if found.ring is not None else 0
    return f"bounded least squares on {n} averaged waveforms; errors of type A and B"


def _ring(found: Campaign) -> list[Estimate]:
    if found.ring is None or found.verdict is None:
        return [undetermined(name, found.no_ring) for name in RING]
    by = told(found.ring, found.verdict)
    if found.tire.pressure is None and by["belt_width"].value is not None:
        by["belt_width"] = undetermined(
            "belt_width",
            "no run states its inflation pressure, and the waveforms only tell p0 b; state inflation_pressure",
        )
    for name, why in _NEVER_NEGATIVE.items():
        if (known := by[name]).ci95 is not None and known.ci95[1] < 0.0:
            by[name] = undetermined(name, f"it comes out negative, which cannot be: {why}")
    by["sensor_lag"] = _timed(found, by["sensor_lag"])
    words = "type A"
    shared = [
        f"{_SOURCES.get(i.source, i.source)} {100 * i.relative:.2g} %"
        for i in found.ring.influences
        if i.relative > _SLIGHT
    ]
    if shared:
        words = f"type B in it: {', '.join(shared)}"
    return [
        replace(e, reason="; ".join(filter(None, (e.reason, words)))) if e.value is not None else e for e in by.values()
    ]


def _timed(found: Campaign, e: Estimate) -> Estimate:
    """Widen a time by the doubt of the transmitter's clock."""
    if not found.clock_u or e.value is None or e.std_error is None or e.name not in _TIMES:
        return e
    error = math.hypot(e.std_error, found.clock_u * e.value)
    return estimate(e.name, e.value, error, at=e.at, reason="widened by the doubt of the clock")


def _contact(found: Campaign) -> list[Estimate]:
    if found.ring is None or found.verdict is None:
        return [undetermined("contact_length", found.no_ring, at) for at in _points(found)]
    known = list(contact_lengths(found.ring, found.verdict))
    others = [at for at in _points(found) if not any(dict(e.at) == at for e in known)]
    return known + [undetermined("contact_length", _why_not(found, at), at) for at in others]


def _points(found: Campaign) -> list[dict[str, float | str | bool]]:
    points = dict.fromkeys(
        (run.nominal_load, run.nominal_speed) for run in found.runs if math.isfinite(run.nominal_load)
    )
    return [{"load": load, "speed": speed} for load, speed in points]


def _runs_at(found: Campaign, at: dict[str, float | str | bool]) -> list[BenchRun]:
    return [run for run in found.runs if (run.nominal_load, run.nominal_speed) == (at["load"], at["speed"])]


def _why_not(found: Campaign, at: dict[str, float | str | bool]) -> str:
    """Return why none of the runs of an operating point serves."""
    odd = {one.run: one.text for one in found.odd if one.cause != "film"}
    why = {**found.unfitted, **odd, **found.doubted}
    return next(
        (f"{run.name}: {why[run.name]}" for run in _runs_at(found, at) if run.name in why), "no run of it can be used"
    )


def _by_point(found: Campaign) -> list[Estimate]:
    """Return the lengths of the waveform at each load and speed as set, runs of one point pooled by weight."""
    rows = []
    for at in _points(found):
        odd = {one.run for one in found.odd if one.cause != "film"}
        runs = [run for run in _runs_at(found, at) if run.name not in odd and run.name not in found.doubted]
        for name, field in _LENGTHS.items():
            whole = [r for r in runs if name != "zero_length" or math.isfinite(r.waveform.level)]
            pairs = np.array([
                (getattr(found.features[r.name].value, field), getattr(found.features[r.name].error, field)) for r in whole
            ]).reshape(-1, 2)  # fmt: skip
            rows.append(_pooled(name, pairs[np.isfinite(pairs).all(axis=1)], found, runs, at))
    return rows


def _pooled(
    name: str, pairs: np.ndarray, found: Campaign, runs: Sequence[BenchRun], at: dict[str, float | str | bool]
) -> Estimate:
    if not len(pairs):
        none = "the waveform has no such marks: part of the revolution is not recorded"
        return undetermined(name, none if runs else _why_not(found, at), at)
    values, errors = pairs[:, 0], np.maximum(pairs[:, 1], 1e-9)
    weights = errors**-2.0 / np.sum(errors**-2.0)
    mean = float(weights @ values)
    dof = sum(found.features[r.name].groups - 1 for r in runs)
    scatter = float(np.sum(errors**-2.0)) ** -0.5
    if len(pairs) > 1:
        chi2 = float(np.sum(((values - mean) / errors) ** 2)) / (len(pairs) - 1)
        scatter *= math.sqrt(max(chi2, 1.0))
    return estimate(name, mean, math.hypot(scatter, found.radius_u * mean), dof=dof, at=at)


def _of_runs(found: Campaign) -> list[Estimate]:
    rows = []
    for run in found.runs:
        at: dict[str, float | str | bool] = {"run": run.name}
        lift = run.lift
        marks, wave = found.features[run.name], run.waveform
        if run.name in found.doubted:
            rows += [undetermined(name, found.doubted[run.name], at) for name in ("sensor_resistance", *_MARKS)]
            continue
        if math.isfinite(wave.level):
            rows.append(
                estimate("sensor_resistance", wave.level, wave.level_se, dof=max(wave.revolutions - 2, 1), at=at,
                         reason="type A")
            )  # fmt: skip
        else:
            reason = "part of the revolution is never recorded, so that its mean is not known"
            rows.append(undetermined("sensor_resistance", reason, at))
        for name, field in _MARKS.items():
            value, error = getattr(marks.value, field) + lift, getattr(marks.error, field)
            if name.startswith("dip") and run.name in found.mirrored:
                rows.append(undetermined(name, found.mirrored[run.name], at))
            elif math.isfinite(value):
                rows.append(estimate(name, value, error, dof=marks.groups - 1, at=at))
            else:
                rows.append(
                    undetermined(name, "the mean of the revolution is not known: part of it is not recorded", at)
                )
    return rows


def _calibration(found: Campaign) -> list[Estimate]:
    if found.calibration is None:
        return [undetermined(name, "no run has a load and a peak that can be used") for name in _CALIBRATION]
    words = f"type B in it: load cell {100 * found.tire.load_gain_u:.2g} %"
    own = [found.calibration.estimates[name] for name in _CALIBRATION]
    return [replace(e, reason=words) if e.value is not None and e.name != "calibration_0" else e for e in own]


def lawless(found: Campaign) -> str:
    """Return why the law of the PVDF's ratio to the flex sensor is not believed; empty where it is."""
    film = found.film
    if film is None or film.chi2_reduced < _LAWLESS:
        return ""
    if found.verdict is not None and not found.verdict.fits:
        return "the flex sensor does not follow its model, see the ring fit, nor does the PVDF's ratio to it"
    if film.verdict == "good" and not found.mirrored:
        return ""
    return (
        f"the PVDF's ratio to the flex sensor departs from its law ({times_noise(film.chi2_reduced)}): sensor_length_pvdf or "
        "sensor_length_flex are not as stated, a bond yields, or the log runs backward. Measure both lengths"
    )


def _film(found: Campaign) -> list[Estimate]:
    if found.film is None:
        return [undetermined(name, found.no_film) for name in FILM]
    why = lawless(found)
    rows = [undetermined(name, why) if why else _timed(found, found.film.estimates[name]) for name in FILM]
    if 2 * len(found.mirrored) > len(found.runs):
        backward = "its sign turns with the sense of rotation, which looks reversed"
        rows = [undetermined(e.name, backward) if e.name == "pvdf_offset_angle" else e for e in rows]
    rows += [Estimate("pvdf_nrmse", run.nrmse, at={"run": run.run}) for run in found.film.runs]
    return rows + [undetermined("pvdf_nrmse", why, {"run": run}) for run, why in found.film.left_out.items()]


def _loss(runs: Sequence[BenchRun]) -> list[Estimate]:
    rows = []
    for run in runs:
        share, at = run.device.loss.share, {"run": run.name}
        if math.isfinite(share):
            rows.append(Estimate("packet_loss", float(share), at=at))
        else:
            rows.append(undetermined("packet_loss", "neither sample_index nor packet_counter tells what was lost", at))
    return rows
