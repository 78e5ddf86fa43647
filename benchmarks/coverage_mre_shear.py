"""Do the 95 % intervals of mre.shear hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_mre_shear [SEEDS] [--scatter 0.004] [--campaign full|smallest] [--first 0]

Per parameter: how often its interval holds the truth, bias over mean standard error, actual over
claimed spread, and rms error in per cent (force lag: microseconds). Loop metrics count over all runs.
"""

from __future__ import annotations

import os
from collections import defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.model.loop import Loop, fit_loop
from pipeline.rigs.mre.pads import Pads
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics
from pipeline.rigs.mre.synthetic import ShearTruth, shear_runs, shear_truth, synthesize_shear, true_loop

PADS = Pads(diameter=0.05, height=0.006)
_METRICS = ("stiffness_secant", "stiffness_storage", "damping", "loss_factor", "shear_modulus_storage")
_METRICS += ("shear_modulus_loss", "loop_area", "amplitude", "force_amplitude")


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--scatter", type=float, default=None, help="relative gain scatter; default: 0, then 0.004")
    options.add_argument("--campaign", default="full", choices=("full", "smallest"))
    arguments = options.parse_args()
    for scatter in (0.0, 0.004) if arguments.scatter is None else (arguments.scatter,):
        print(f"\n{arguments.campaign} campaign, gain scatter {100 * scatter:g} %, {arguments.seeds} seeds")
        found = study(seeds_of(arguments), scatter, arguments.campaign)
        print(table(found, {"force_lag": (1e-6, "us")}))


def study(seeds: range, scatter: float, campaign: str) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name (and current)."""
    overrides = {"gain_scatter": scatter, "campaign": campaign, "preload_runs": False}
    truth = shear_truth(overrides)
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    for seed in seeds:
        loops = [
            fit_loop(
                recording.run,
                *recording.signal("displacement"),
                recording.values("force"),
                frequency=recording.condition("frequency"),
                current=float(recording.values("current").mean()),
            )
            for recording in synthesize_shear(overrides, seed)
        ]
        identification = identify_loops(loops, FitOptions(variants=("ks",)))
        for estimate in identification.selected.estimates:
            at = estimate.at.get("coil_current")
            name = estimate.name if at is None else f"{estimate.name} {at:g} A"
            found[name].append((estimate, true_parameter(truth, estimate)))
        for name, pair in metric_pairs(truth, identification, loops):
            found[name].append(pair)
    return found


def true_parameter(truth: ShearTruth, estimate: Estimate) -> float:
    """Return what an estimate of the dynamic fit should be."""
    derived = {
        "tau": truth.s1 / truth.k1,
        "run_scatter": truth.gain_scatter,
        "k1_plus_k2": truth.k1 + truth.k2,
        "k2_plus_alpha_rho": truth.k2 + truth.alpha_bw * truth.rho,
    }
    if estimate.name in ("k_mr", "s_mr"):
        current = float(estimate.at["coil_current"])
        return truth.k_mr_at(current) if estimate.name == "k_mr" else truth.s_mr_at(current)
    return derived[estimate.name] if estimate.name in derived else float(getattr(truth, estimate.name))


def metric_pairs(
    truth: ShearTruth, identification: Identification, loops: list[Loop]
) -> list[tuple[str, tuple[Estimate, float]]]:
    """Return the loop metrics of every run beside those of its true loop."""
    fit = identification.selected
    lag = fit.force_lag
    pairs = []
    for loop, run in zip(loops, shear_runs(truth), strict=True):
        claimed = loop_metrics(
            loop,
            force_lag=lag.value or 0.0,
            force_lag_sd=lag.std_error or 0.0,
            run_scatter=fit.run_scatter,
            scatter_dof=fit.scatter.dof,
            pads=PADS,
        )
        actual = {e.name: e.value for e in loop_metrics(true_loop(truth, run, loop.frequency), pads=PADS)}
        pairs += [(e.name, (e, float(actual[e.name] or 0.0))) for e in claimed]
    return pairs


if __name__ == "__main__":
    main()
