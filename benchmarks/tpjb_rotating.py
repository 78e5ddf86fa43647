"""All six models of one orbit of 700 samples against the script that one would write first.

The reference solves the law for every sample by `scipy.optimize.fsolve` and fits each model by
`scipy.optimize.least_squares` with differences, from the same start, offset and drift projected out as well.
Ours includes noise, orthogonal distance, covariance and selection.

    python -m benchmarks.tpjb_rotating [RUN]      A4 by default; see pipeline/rigs/tpjb/rotating/synthetic.py
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from pipeline.rigs.tpjb.rotating.orbit import Orbit

GOAL = 3.0


def measure(run: str = "A4") -> list[dict[str, Any]]:
    from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
    from pipeline.rigs.tpjb.rotating.models import MODELS
    from pipeline.rigs.tpjb.rotating.record import record_of
    from pipeline.rigs.tpjb.rotating.selection import fit_models
    from pipeline.rigs.tpjb.rotating.synthetic import synthesize

    models = MODELS[:6]
    (recording,) = synthesize({"runs": [run]}, 1)
    orbit = record_of(recording, RotatingSettings()).orbit
    fit_models([orbit], models)  # imports
    seconds = []
    for _ in range(3):
        begin = time.perf_counter()
        comparison = fit_models([orbit], models)
        seconds.append(time.perf_counter() - begin)
    begin = time.perf_counter()
    theirs = {model.name: reference(orbit, model) for model in models}
    their_seconds = time.perf_counter() - begin
    print(f"{'':4}{'rms ours [um]':>15}{'rms theirs':>12}{'largest difference':>20}")
    for name, fit in comparison.fits.items():
        theta, rms = theirs[name]
        apart = np.max(np.abs(theta - fit.theta) / (fit.covariance.std_error + 1e-300))
        print(f"{name:4}{fit.rms * 1e6:15.4f}{rms * 1e6:12.4f}{apart:16.2f} sd")
    ours = min(seconds)
    return [
        {
            "what": f"six models of one orbit ({run}), {orbit.time.size} samples, selected {comparison.selected.name}",
            "against": "least_squares with differences, fsolve for every sample",
            "ours": ours,
            "theirs": their_seconds,
            "goal": f"ours < {GOAL:g} s",
        }
    ]


def reference(orbit: Orbit, model: Any) -> tuple[np.ndarray, float]:
    """Return free coefficients, shape (k,), and rms residual (m) of the straightforward fit."""
    from scipy.optimize import fsolve, least_squares

    from pipeline.rigs.tpjb.rotating.force_domain import below_fold, force_domain

    drift = np.stack([np.ones(orbit.tau.size), orbit.tau, orbit.tau**2], axis=1)
    basis = np.linalg.qr(drift)[0]

    def residual(z: np.ndarray) -> np.ndarray:
        p = model.matrix @ (z * model.scale)
        solved = np.empty_like(orbit.force)
        guess = np.zeros(2)
        for i, f in enumerate(orbit.force.T):

            def excess(d: np.ndarray, f: np.ndarray = f) -> list[float]:
                x, y = d * 1e-6
                return [
                    p[0] * x + p[1] * y + p[4] * x * x + p[5] * y * y + p[8] * x * y - f[0],
                    p[2] * x + p[3] * y + p[6] * x * x + p[7] * y * y + p[9] * x * y - f[1],
                ]

            guess = fsolve(excess, guess)
            solved[:, i] = guess * 1e-6
        left = (orbit.displacement - solved).T * 1e6
        return np.asarray((left - basis @ (basis.T @ left)).ravel())

    start = below_fold([orbit], model, force_domain(orbit, model)) / model.scale
    found = least_squares(residual, start, x_scale="jac")
    return found.x * model.scale, 1e-6 * float(np.sqrt(np.mean(found.fun**2)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", nargs="?", default="A4")
    print(measure(parser.parse_args().run)[0])
