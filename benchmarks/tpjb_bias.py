"""Bias of estimators of a bearing's impedance under noise on the displacement (tpjb.md, section 5).

Two excitations, ten blocks, one tone; noise on the displacement by SNR per block, 1 % on the force. Bias
and standard deviation of kxx in per cent over Monte Carlo runs, for the mean over blocks of H = F D^-1,
the regression of force on displacement (H1), that of displacement on force inverted, and the ratio of
coherent means, which rigfit takes.

    python -m benchmarks.tpjb_bias [RUNS]
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

_BLOCKS = 10
_H = np.array([[6.0e8 + 4.7e8j, 3.0e7 + 1.6e7j], [3.0e7 + 1.6e7j, 6.0e8 + 4.7e8j]])
_SNR = (6.0, 10.0, 20.0, 30.0)
ESTIMATORS = ("mean of ratios", "H1: F on D", "H1: D on F, inverted", "ratio of means")


def measure(runs: int = 4000) -> list[dict[str, Any]]:
    start = time.perf_counter()
    found = study(runs)
    seconds = time.perf_counter() - start
    print(table(found))
    worst = {name: max(abs(found[snr][name][0]) for snr in _SNR) for name in ESTIMATORS}
    return [
        {
            "what": f"bias of kxx, {runs} runs, SNR 6 to 30 dB: ratio of means against H1, worst bias, here {seconds:.1f} s",
            "unit": "%",
            "against": "regression of F on D (H1)",
            "ours": worst["ratio of means"],
            "theirs": worst["H1: F on D"],
            "goal": "> 20",
        }
    ]


def study(runs: int, seed: int = 1) -> dict[float, dict[str, tuple[float, float]]]:
    """Return bias and standard deviation (%) of kxx by SNR (dB) and estimator."""
    rng = np.random.default_rng(seed)
    D = np.array([[0.03, 1.0], [1.0, -0.05]]) * 1e-6
    F = _H @ D
    out = {}
    for snr in _SNR:
        sigma_d = 1e-6 * 10 ** (-snr / 20)
        d = D + sigma_d * _noise(rng, runs)
        f = F + 0.01 * np.abs(F).max() * _noise(rng, runs)
        values = {name: 100 * (H[:, 0, 0].real / _H[0, 0].real - 1) for name, H in estimates(f, d).items()}
        out[snr] = {name: (float(v.mean()), float(v.std())) for name, v in values.items()}
    return out


def _noise(rng: np.random.Generator, runs: int) -> np.ndarray:
    """Return circular noise of unit power, shape (runs, blocks, 2, 2)."""
    shape = (runs, _BLOCKS, 2, 2)
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


def estimates(f: np.ndarray, d: np.ndarray) -> dict[str, np.ndarray]:
    """Return H, shape (runs, 2, 2), of each estimator from amplitudes of shape (runs, blocks, 2, excitations)."""
    adjoint = np.conj(np.swapaxes(d, -1, -2)), np.conj(np.swapaxes(f, -1, -2))
    fd, dd = (f @ adjoint[0]).sum(axis=1), (d @ adjoint[0]).sum(axis=1)
    df, ff = (d @ adjoint[1]).sum(axis=1), (f @ adjoint[1]).sum(axis=1)
    values = (
        (f @ np.linalg.inv(d)).mean(axis=1),
        fd @ np.linalg.inv(dd),
        ff @ np.linalg.inv(df),
        f.mean(axis=1) @ np.linalg.inv(d.mean(axis=1)),
    )
    return dict(zip(ESTIMATORS, values, strict=True))


def table(found: dict[float, dict[str, tuple[float, float]]]) -> str:
    lines = [f"{'SNR per block':>14}" + "".join(f"{name:>24}" for name in ESTIMATORS) + "     bias / sd of kxx, %"]
    for snr, row in found.items():
        cells = "".join(f"{row[name][0]:>+15.1f} / {row[name][1]:<6.1f}" for name in ESTIMATORS)
        lines.append(f"{snr:11g} dB{cells}")
    return "\n".join(lines)


if __name__ == "__main__":
    print(measure(int(sys.argv[1]) if len(sys.argv) > 1 else 4000)[0])
