"""Do the 95 % intervals of mre.shear hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_mre_shear [SEEDS] [--scatter 0.004] [--campaign full|smallest] [--first 0]

Per parameter: how often its interval holds the truth, bias over mean standard error, actual over
claimed spread, and rms error in per cent (force lag: microseconds). Loop metrics count over all runs.
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.mre.harmonic_fit import FitOptions, Identification, identify_loops
from pipeline.rigs.mre.loop import Loop, Pads, fit_loop, loop_metrics
from pipeline.rigs.mre.synthetic import ShearTruth, shear_runs, shear_truth, synthesize_shear, true_loop

PADS = Pads(diameter=0.05, height=0.006)
_METRICS = ("stiffness_secant", "stiffness_storage", "damping", "loss_factor", "shear_modulus_storage")
_METRICS += ("shear_modulus_loss", "loop_area", "amplitude", "force_amplitude")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="?", type=int, default=100)
    parser.add_argument("--scatter", type=float, default=None, help="relative gain scatter; default: 0, then 0.004")
    parser.add_argument("--campaign", default="full", choices=("full", "smallest"))
    parser.add_argument("--first", type=int, default=0, help="first seed")
    arguments = parser.parse_args()
    for scatter in (0.0, 0.004) if arguments.scatter is None else (arguments.scatter,):
        print(f"\n{arguments.campaign} campaign, gain scatter {100 * scatter:g} %, {arguments.seeds} seeds")
        print(table(study(range(arguments.first, arguments.first + arguments.seeds), scatter, arguments.campaign)))


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


def table(found: dict[str, list[tuple[Estimate, float]]]) -> str:
    lines = [f"{'':24} {'covered':>12} {'bias/se':>8} {'spread/se':>9} {'rms error':>10}   undetermined"]
    for name, pairs in found.items():
        known = [(e, t) for e, t in pairs if e.value is not None and e.ci95 is not None]
        error = np.array([float(e.value or 0.0) - t for e, t in known])
        sd = np.array([e.std_error if e.std_error else np.nan for e, _ in known])
        size = np.array([1e-4 if name == "force_lag" else abs(t) or np.nan for _, t in known])
        covered = sum(e.ci95[0] <= t <= e.ci95[1] for e, t in known if e.ci95 is not None)
        z = error / sd
        z = z[np.isfinite(z)]
        bias, spread = (f"{z.mean():8.2f}", f"{z.std():9.2f}") if z.size else (f"{'':8}", f"{'':9}")
        rms = 100 * np.sqrt(np.mean((error / size) ** 2))
        unit = "us" if name == "force_lag" else "% "
        none = len(pairs) - len(known) or ""
        lines.append(f"{name:24} {covered:5d} of {len(known):<4d} {bias} {spread} {rms:8.3f} {unit}   {none}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
