"""`tpjb.baseline`: from recordings to findings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.errors import InputError, listing
from pipeline.estimation.selection import Candidate
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Findings, ModelResult, Parameter, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.tpjb.baseline.declaration import PARAMETERS, BaselineSettings
from pipeline.rigs.tpjb.baseline.mass_and_spring import MassAndSpring, Ratios, fit, ratio
from pipeline.rigs.tpjb.dynamic import excitation
from pipeline.rigs.tpjb.dynamic.motion import ACCELEROMETERS
from pipeline.rigs.tpjb.dynamic.record import Record
from pipeline.rigs.tpjb.dynamic.sorting import read_record
from pipeline.rigs.tpjb.gains import Gains, gains_of, with_type_b

# Share by which u and v, or two accelerometers, may differ; by which a weighed mass may.
_ALIKE, _WEIGHED = 0.02, 0.05
_PAIR = 0.05
# Ratio of the highest to the lowest tone below which they are one tone.
_APART = 1.01


def identify(recordings: Sequence[Recording], settings: BaselineSettings, context: Context) -> Findings:
    """Identify a baseline campaign.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    wanted = [r for r in recordings if str(r.conditions.get("test", "baseline")).strip().lower() == "baseline"]
    used = {r.run for r in wanted}
    left_out = {r.run: "is not a run of the baseline test" for r in recordings if r.run not in used}
    records: list[Record] = []
    rows: list[tuple[float, str, complex, float, float, str]] = []
    for recording in wanted:
        try:
            record = read_record(recording, ACCELEROMETERS, 0, still=True)
            rows += _ratios(record, settings)
        except InputError as error:
            left_out[recording.run] = str(error)
            continue
        records.append(record)
    if not rows:
        raise InputError(
            next(iter(left_out.values()), "") or "no run holds a tone that stands out of force and acceleration."
        )
    quality = [finding for record in records for finding in record.quality]
    quality += [QualityFinding("error", f"left out: {reason}", run) for run, reason in left_out.items()]
    for campaign, other in context.uses.items():
        text = f"campaign '{campaign}' ({other.experiment}) was handed over and is not used: a baseline uses no other findings."
        quality.append(QualityFinding("note", text))
    ratios = Ratios(
        np.array([row[0] for row in rows]),
        tuple(row[1] for row in rows),
        np.array([row[2] for row in rows]),
        np.array([row[3] for row in rows]),
        np.array([row[4] for row in rows]),
    )
    several = bool(ratios.frequency.max() > _APART * ratios.frequency.min())
    spring = None if several else _stated_spring(wanted)
    found = fit(ratios, spring=several, stated=spring or 0.0)
    gains = gains_of(r.conditions for r in wanted)
    fatal = _judge(found, ratios, [] if not several and spring is None else wanted, quality)
    untold = "" if several else _one_tone(ratios, spring, quality)
    grave = [q for q in quality if q.level != "note"]
    reasons = [untold] if untold else []
    if several:
        reasons = [
            f"m_s = {found.mass:.5g} kg and k_s = {found.stiffness:.3g} N/m from {np.unique(ratios.frequency).size} tones, "
            f"{len(rows)} ratios of force to acceleration."
        ]
    models = [_model("mass and spring", found, ratios, True)] if several else []
    models.append(_model("mass", fit(ratios, spring=False), ratios, not several))
    return Findings(
        campaign=context.campaign,
        experiment="tpjb.baseline",
        verdict="rejected" if fatal else "warning" if grave else "ok",
        reasons=[fatal] if fatal else list(dict.fromkeys(reasons + [q.message for q in grave[:3]])),
        parameters=_parameters(found, ratios, gains, (fatal or (untold if spring is None else ""), fatal or untold)),
        models=models,
        advice=[]
        if several
        else ["Excite at least two tones, far apart: together they tell the mass from the stiffness."],
        quality=[Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in quality],
        runs=[Run(run=r.run, used=r.run not in left_out, reason=left_out.get(r.run, "")) for r in recordings],
        arrays=_arrays(found, rows),
    )


def _ratios(record: Record, settings: BaselineSettings) -> list[tuple[float, str, complex, float, float, str]]:
    """Return frequency, axis, ratio, its error, degrees of freedom and excitation of each tone that is driven."""
    if record.unusable:
        raise InputError(record.unusable)
    if not record.usable.any():
        raise InputError(f"run '{record.run}': neither force_u nor force_v holds a tone; was the drive on?")
    rows = []
    acceleration = {axis: _acceleration(record, axis) for axis in "uv"}
    silent = set()
    for kind, blocks in excitation.stretches(record.kinds, record.usable):
        if blocks.size < 3:
            continue
        for number, axis in enumerate("uv"):
            a = acceleration[axis]
            if a is None or kind == (excitation.V_ONLY, excitation.U_ONLY)[number]:
                continue
            for k, tone in enumerate(record.tones):
                F, A = record.force[blocks, k, number], a[blocks, k]
                noise = F.std(ddof=1) / math.sqrt(blocks.size)
                if abs(F.mean()) < settings.least_snr * noise or abs(A.mean()) < settings.least_snr * A.std(
                    ddof=1
                ) / math.sqrt(blocks.size):
                    silent.add(float(tone))
                    continue
                R, sd = ratio(F, A)
                rows.append((round(float(tone), 4), axis, R, sd, float(blocks.size - 1), kind))
    if silent:
        record.say(
            "warning", f"no sound force or acceleration at {listing(f'{f:g}' for f in sorted(silent))} Hz; not used."
        )
    if not rows:
        raise InputError(f"run '{record.run}': no tone stands out of both force and acceleration along u or v.")
    return rows


def _acceleration(record: Record, axis: str) -> np.ndarray | None:
    """Return the acceleration along an axis, shape (B, k): the mean of two, or the one that moves."""
    names = [name for name in ACCELEROMETERS if name[4] == axis and name in record.amplitudes]
    if not names:
        record.say("warning", f"no accelerometer along {axis}; that axis is not used.")
        return None
    size = {n: float(np.linalg.norm(np.nan_to_num(record.amplitudes[n][record.usable]))) for n in names}
    moving = [n for n in names if size[n] > 0.1 * max(size.values())]
    for name in names:
        if name not in moving:
            record.say("warning", f"{name} does not move while {listing(moving)} does; it is left out.", name)
    if len(moving) == 2:
        a, b = (record.amplitudes[n][record.usable] for n in moving)
        apart = float(2 * np.linalg.norm(a - b) / np.linalg.norm(a + b))
        if apart > _PAIR:
            record.say(
                "warning",
                f"{listing(moving)} differ by {100 * apart:.2g} % (gain, unit or sign of one of them, or the stator pitches); "
                "their mean is used.",
                moving[0],
            )
    return np.asarray(np.mean([record.amplitudes[n] for n in moving], axis=0))


def _stated_spring(recordings: Sequence[Recording]) -> float | None:
    """Return k_s (N/m) where all runs that state it state the same."""
    stated = {float(k) for r in recordings if isinstance(k := r.conditions.get("stabilizer_stiffness"), float)}
    return stated.pop() if len(stated) == 1 else None


def _one_tone(ratios: Ratios, spring: float | None, quality: list[QualityFinding]) -> str:
    """Say what one tone leaves untold."""
    text = f"one tone ({np.mean(ratios.frequency):.4g} Hz) does not tell a mass from a stiffness: at one tone they are one number"
    text += (
        "; neither is given. Excite two or more tones, or state 'stabilizer_stiffness' for the mass."
        if spring is None
        else f". The mass holds with the stated k_s = {spring:.4g} N/m, whose error is not in its interval; k_s itself is not given."
    )
    quality.append(QualityFinding("warning", text))
    return text


def _judge(found: MassAndSpring, ratios: Ratios, recordings: Sequence[Recording], quality: list[QualityFinding]) -> str:
    """Say what speaks against the model; return why nothing can be given, or ''."""
    if found.mass <= 0:
        return f"the mass comes out as {found.mass:.4g} kg: sign of the force or of the acceleration inverted?"
    if found.dof > 0 and found.chi2 > found.limit:
        text = (
            f"force over acceleration does not follow m - k/w^2 (it misses by {times_noise(found.chi2 / found.dof)}); "
            f"errors are widened {found.widening:.2g} times. Is there contact in the bearing, or a bench resonance?"
        )
        quality.append(QualityFinding("warning", text))
    means = [np.mean(ratios.value.real[np.array(ratios.axis) == axis]) for axis in "uv" if axis in ratios.axis]
    if len(means) == 2 and abs(means[0] / means[1] - 1) > _ALIKE:
        text = (
            f"force over acceleration is {means[0]:.4g} kg along u and {means[1]:.4g} kg along v; one stator has one mass: gain or "
            "unit of a force or an acceleration?"
        )
        quality.append(QualityFinding("warning", text))
    weighed = {r.conditions["stator_mass"] for r in recordings if isinstance(r.conditions.get("stator_mass"), float)}
    for mass in weighed:
        if abs(found.mass / float(mass) - 1) > _WEIGHED:
            hint = " As if the acceleration were in g." if 8 < found.mass / float(mass) < 12 else ""
            text = f"the runs state a stator mass of {float(mass):.4g} kg, found is {found.mass:.4g} kg.{hint} Unit of force or acceleration?"
            quality.append(QualityFinding("warning", text))
    late = np.angle(ratios.value) / (2 * np.pi * ratios.frequency)
    mean = float(np.median(late))
    if abs(mean) > 5e-6 and abs(mean) > 5 * float(np.median(np.abs(late - mean))):
        text = f"force leads the acceleration by {1e6 * mean:.3g} us in the median: a lag of one of them, or damping of the hoses."
        quality.append(QualityFinding("note", text))
    return ""


def _parameters(found: MassAndSpring, ratios: Ratios, gains: Gains, reasons: tuple[str, str]) -> list[Parameter]:
    dof = float(ratios.dof.sum())
    half = t_quantile(dof)
    out = []
    for number, spec in enumerate(PARAMETERS):
        value = (found.mass, found.stiffness)[number]
        sd = float(found.std_errors[number])
        reason = reasons[number]
        known = not reason
        out.append(
            Parameter(
                name=spec.name,
                symbol=spec.symbol,
                value=value if known else None,
                std_error=sd if known else None,
                ci95=(value - half * sd, value + half * sd) if known else None,
                unit=spec.unit,
                description=reason
                or f"{spec.description}; {gains.text(0, 1)}; gain of the accelerometers not in the interval",
                source=spec.source,
                method="weighted least squares on ratios of coherent means",
            )
        )
    return [with_type_b(p, gains.share(0, 1) * abs(p.value or 0.0)) for p in out]


def _model(name: str, found: MassAndSpring, ratios: Ratios, selected: bool) -> ModelResult:
    n, k = ratios.frequency.size, ratios.frequency.size - found.dof
    candidate = Candidate(name, found.chi2, n, k, sigma_known=True)
    return ModelResult(
        name=name,
        selected=selected,
        n_parameters=k,
        n_data=n,
        rms_residual=float(np.sqrt(np.mean(found.residual**2))),
        unit="kg",
        chi2_reduced=found.chi2 / found.dof if found.dof else None,
        bic=candidate.bic,
        aicc=candidate.aicc,
    )


def _arrays(
    found: MassAndSpring, rows: Sequence[tuple[float, str, complex, float, float, str]]
) -> dict[str, pd.DataFrame]:
    table = pd.DataFrame(
        [
            {"frequency": f, "axis": axis, "excitation": kind, "mass": R.real, "imaginary": R.imag, "std_error": sd}
            | {"low": R.real - t_quantile(dof) * sd, "high": R.real + t_quantile(dof) * sd}
            for f, axis, R, sd, dof, kind in rows
        ]
    )
    table["residual"] = found.residual
    f = np.linspace(table["frequency"].min(), table["frequency"].max(), 80)
    curve = pd.DataFrame({"frequency": f, "mass": found.mass - found.stiffness / (2 * np.pi * f) ** 2})
    sd = np.sqrt(np.diag(found.covariance))
    correlation = float(found.covariance[0, 1] / (sd[0] * sd[1])) if sd.all() else 0.0
    spread = pd.DataFrame({"correlation": [correlation], "widening": [found.widening]})
    return {"ratios": table, "curve": curve, "covariance": spread}
