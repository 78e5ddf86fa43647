"""`tpjb.dynamic`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError, counted
from pipeline.findings import Findings, Quality, Run, Verdict
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb.conditions import run_groups
from pipeline.rigs.tpjb.dynamic.declaration import DynamicSettings
from pipeline.rigs.tpjb.dynamic.inertia import inertia_of
from pipeline.rigs.tpjb.dynamic.nonlinearity import Products, second_order, slip
from pipeline.rigs.tpjb.dynamic.outcome import arrays_of, models_of, parameters_of, published_of
from pipeline.rigs.tpjb.dynamic.pooling import Pool, noticed, pool
from pipeline.rigs.tpjb.dynamic.solution import Solution, sentence, solve

# A slip of clocks that counts: standard errors, and seconds over the record.
_SLIP_SIGMA, _SLIP = 5.0, 2e-6


def identify(recordings: Sequence[Recording], settings: DynamicSettings, context: Context) -> Findings:
    """Identify a campaign of dynamic tests.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    pools, left_out = _pools(recordings, settings)
    solutions = [solve(one, inertia_of(one.members, context.uses), settings, len(pools)) for one in pools]
    products = [second_order(one) for one in pools]
    for solution, lines in zip(solutions, products, strict=True):
        _judge_products(solution, lines, settings)
        _judge_slip(solution)
    quality = [*noticed(pools), *(finding for solution in solutions for finding in solution.quality)]
    quality += [QualityFinding("error", f"left out: {reason}", run) for run, reason in left_out.items()]
    quality = list(dict.fromkeys(quality))
    verdict, reasons = _verdict(solutions, quality)
    return Findings(
        campaign=context.campaign,
        experiment="tpjb.dynamic",
        verdict=verdict,
        reasons=reasons,
        parameters=[parameter for solution in solutions for parameter in parameters_of(solution)],
        models=models_of(solutions),
        published=published_of(solutions),
        quality=[Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in quality],
        runs=[Run(run=r.run, used=r.run not in left_out, reason=left_out.get(r.run, "")) for r in recordings],
        advice=_advice(solutions),
        arrays=arrays_of(solutions, products),
    )


def _pools(recordings: Sequence[Recording], settings: DynamicSettings) -> tuple[list[Pool], dict[str, str]]:
    tests = {r.run: str(r.conditions.get("test", "dynamic")).strip() for r in recordings}
    wanted = [r for r in recordings if tests[r.run].lower() == "dynamic"]
    left_out = {
        run: f"is a run of the test '{test}', not of the dynamic test"
        for run, test in tests.items()
        if test.lower() != "dynamic"
    }
    bearings = {str(r.conditions.get("bearing", "")) for r in wanted}
    pools: list[Pool] = []
    first = ""
    for at, members in run_groups(wanted):
        if len(bearings) > 1:
            at = {"bearing": str(members[0].conditions.get("bearing", "")), **at}
        try:
            found, without = pool(at, members, settings.shaft_orders)
        except InputError as error:
            first = first or str(error)
            left_out |= dict.fromkeys((r.run for r in members), str(error))
            continue
        pools.append(found)
        left_out |= without
    if not pools:
        raise InputError(
            first or "no run of the dynamic test is given; the condition 'test' says otherwise of all runs."
        )
    return pools, left_out


def _judge_products(solution: Solution, lines: Sequence[Products], settings: DynamicSettings) -> None:
    for line in lines:
        if line.share > settings.nonlinear_share and line.share > 3 * line.share_error:
            solution.say(
                "warning",
                f"{line.kind.replace('_', '-')}: sums and differences of the tones hold "
                f"{100 * line.share:.2g} ± {200 * line.share_error:.1g} % of the motion at the tones; the bearing is not linear at "
                "this amplitude. Excite less.",
            )


def _judge_slip(solution: Solution) -> None:
    if solution.result is None or min(solution.pool.blocks, default=0) < 5:
        return
    keep = np.isin(solution.pool.tones, solution.tones)
    rate, error = slip(solution.pool, solution.result.H, keep)
    duration = max(float(r.start[-1] - r.start[0]) for r in solution.pool.records)
    if abs(rate) > _SLIP_SIGMA * error and abs(rate) * duration > _SLIP:
        solution.say(
            "warning",
            f"clocks slip: the displacement comes {60e6 * rate:.3g} us later against the force each minute; a displacement that is "
            "late by dt raises C by K dt. Log both by one clock.",
        )


def _verdict(solutions: Sequence[Solution], quality: Sequence[QualityFinding]) -> tuple[Verdict, list[str]]:
    reasons = []
    told = [solution for solution in solutions if not solution.fatal]
    for solution in solutions:
        if solution.fatal:
            reasons.append(f"{solution.pool.label}: no coefficient is given: {sentence(solution.fatal)}")
        else:
            reasons.append(_summary(solution))
    if not told:
        return "rejected", reasons
    grave = [q for q in quality if q.level != "note"]
    for finding in grave[:3]:
        where = f"run {finding.run}: " if finding.run else ""
        reasons.append(where + finding.message)
    if len(grave) > 3:
        reasons.append(f"{len(grave) - 3} more warnings below.")
    return ("warning" if grave else "ok"), reasons


def _summary(solution: Solution) -> str:
    blocks = " and ".join(
        f"{count} {kind.replace('_', '-')}"
        for count, kind in zip(solution.pool.blocks, solution.pool.kinds, strict=True)
    )
    laws = {name: entry.law for name, entry in solution.coefficients.items() if entry.law is not None}
    degrees = {name: law.degree for name, law in laws.items() if law.dof > 0}
    constant = [name for name, degree in degrees.items() if degree == 0]
    law = ""
    if degrees:
        law = (
            " All coefficients are constant over frequency."
            if len(constant) == len(degrees)
            else (f" With frequency change {', '.join(f'{n} (degree {d})' for n, d in degrees.items() if d)}.")
        )
    inertia = solution.inertia
    held = f" The stator's {inertia.mass:.5g} kg are from {inertia.source}." if inertia.mass is not None else ""
    return f"{solution.pool.label}: H at {counted(solution.tones.size, 'tone')} from {blocks} blocks.{law}{held}"


def _advice(solutions: Sequence[Solution]) -> list[str]:
    advice = []
    for solution in solutions:
        if solution.pool.missing:
            advice.append(
                "Record both excitations at the same load and speed: both actuators in phase, and in antiphase."
            )
        elif solution.inertia.mass is not None and np.isnan(solution.inertia.mass_error):
            advice.append(
                "Run tpjb.baseline and name that campaign under 'uses': mass and stiffness then carry their errors."
            )
        blocks = min(solution.pool.blocks, default=0)
        if not solution.fatal and blocks < 8:
            advice.append(f"{blocks} blocks tell the errors poorly; log at least ten blocks of each excitation.")
        shaft = solution.pool.shaft
        if not solution.fatal and shaft and not solution.tones.min() <= shaft <= solution.tones.max():
            side = "below" if solution.tones.min() > shaft else "above"
            advice.append(
                f"Add tones {side} the shaft's {shaft:.4g} Hz: the synchronous coefficients are interpolated between tones on both sides."
            )
        if any("shaft order" in reason for reason in solution.pool.dropped.values()):
            advice.append("Move the tones that stand on a shaft order, or log longer blocks.")
    return list(dict.fromkeys(advice))
