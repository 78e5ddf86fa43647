"""Do the 95 % intervals of mre.shear_rich hold the truth 95 times in 100, and where does the online filter end?

    python -m benchmarks.coverage_mre_rich [SEEDS] [--first 0] [--duration 60] [--starts]

Batch fit: per parameter and current, how often its interval holds the truth, bias over mean standard error, actual over
claimed spread, rms error in per cent (force lag: microseconds). Filter: rms error in per cent and its verdicts. With
--starts instead: 36 starts that are off by factors of 1.25, 1.5 and 2, with annealed and with constant R.
"""

from __future__ import annotations

import os
from collections import Counter, defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.recording import Recording
from pipeline.rigs.mre.rich.declaration import RichSettings
from pipeline.rigs.mre.rich.fits import fit_record, follow
from pipeline.rigs.mre.rich.joint_filter import JointFilter, Start
from pipeline.rigs.mre.rich.joint_state import from_logs, to_logs
from pipeline.rigs.mre.rich.records import usable_records
from pipeline.rigs.mre.synthetic import ShearTruth, rich_recording, rich_signals, shear_truth

CURRENTS = (0.0, 6.0)
_NAMES = ("k1", "tau", "k2", "alpha_bw", "rho", "c_bw", "n_bw")


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--duration", type=float, default=60.0, help="s")
    options.add_argument("--starts", action="store_true", help="convergence of the filter from 36 starts")
    arguments = options.parse_args()
    truth = shear_truth({"duration": arguments.duration})
    if arguments.starts:
        starts(truth)
        return
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    errors: dict[str, list[float]] = defaultdict(list)
    words: Counter[str] = Counter()
    for current in CURRENTS:
        signals = rich_signals(truth, current)
        for seed in seeds_of(arguments):
            record(truth, current, rich_recording(truth, current, seed, signals), found, errors, words)
    print(f"{arguments.seeds} records of {arguments.duration:g} s at each current\n\nbatch fit")
    lags = {f"force_lag {current:g} A": (1e-6, "us") for current in CURRENTS}
    print(table(dict(sorted(found.items())), lags))
    print(f"\nonline filter, rms error at the end in % of the truth; verdicts: {dict(words)}")
    for name, values in sorted(errors.items()):
        print(f"{name:24} {100 * float(np.sqrt(np.mean(np.square(values)))):8.2f}")


def record(
    truth: ShearTruth,
    current: float,
    recording: Recording,
    found: dict[str, list[tuple[Estimate, float]]],
    errors: dict[str, list[float]],
    words: Counter[str],
) -> None:
    """Fit one record by both methods and note the estimates beside their truths."""
    runs = usable_records([recording])
    fit = fit_record(runs.records[0], current, RichSettings(), None, runs)
    for e in fit.batch.estimates:
        found[f"{e.name} {current:g} A"].append((e, true_value(truth, e.name, current)))
    assert fit.online is not None
    assert fit.verdict is not None
    words[fit.verdict.word] += 1
    for name, values in fit.online.history.band().items():
        if name != "offset":
            errors[f"{name} {current:g} A"].append(float(values[-1]) / true_value(truth, name, current) - 1)


def true_value(truth: ShearTruth, name: str, current: float) -> float:
    """Return what an estimate at a current should be; k2 holds k_MR."""
    k2 = truth.k2 + truth.k_mr_at(current)
    derived = {
        "tau": truth.s1 / truth.k1,
        "k2": k2,
        "s_mr": truth.s_mr_at(current),
        "k1_plus_k2": truth.k1 + k2,
        "k2_plus_alpha_rho": k2 + truth.alpha_bw * truth.rho,
    }
    return derived[name] if name in derived else float(getattr(truth, name))


def starts(truth: ShearTruth) -> None:
    """Run the filter from 36 starts, each parameter off by a factor either way, with R annealed and constant."""
    recording = rich_recording(truth, 0.0, 0, rich_signals(truth, 0.0))
    usable = usable_records([recording]).records[0]
    own = follow(usable, None, 0.0, RichSettings(), viscous=False).filter
    assert own is not None
    true = {name: true_value(truth, name, 0.0) for name in _NAMES}
    rng = np.random.default_rng(0)
    for annealed, spread in ((True, own.start.spread), (False, 0.7)):
        ended, worst = Counter[str](), []
        for number in range(36):
            factor = (1.25, 1.5, 2.0)[number % 3]
            logs = to_logs(true) + np.log(factor) * rng.choice([-1.0, 1.0], 7)
            online = follow(
                usable, None, 0.0, RichSettings(), viscous=False, start=_moved(own, logs, spread), annealed=annealed
            )
            states = from_logs(online.filter.x[2:9]) if online.filter is not None else {}
            off = max(abs(float(value) / true[name] - 1) for name, value in states.items())
            worst.append(off)
            ended["within 10 %" if off < 0.1 and online.failed is None else "elsewhere"] += 1
        kind = "annealed R" if annealed else "constant R"
        print(f"{kind}: {dict(ended)} of 36; median of the largest error {100 * float(np.median(worst)):.2g} %")


def _moved(own: JointFilter, logs: np.ndarray, spread: float) -> Start:
    start = own.start
    return Start(
        logs, start.excursion, start.swing, start.offset, start.offset_sd, start.lag_sd, start.viscous_sd, spread
    )


if __name__ == "__main__":
    main()
