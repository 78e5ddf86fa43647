"""Dynamic identification of a long log against cross-spectra by `scipy.signal.csd`, both from the same Parquet file.

60 s x 100 kHz x 13 channels (two forces, eight gaps, two accelerometers, the speed). Ours yields H with its
covariance, shaft orders taken out; the reference yields H1 of each channel on each force, no errors. Each
runs in a process of its own, which tells its peak memory over that of its imports.

    python -m benchmarks.tpjb_dynamic [--seconds 60]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

_RATE = 100e3
_PIECE = 1 << 18


def measure(seconds: float = 60.0) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        written = write_log(Path(folder), seconds)
        found = {name: _in_process(name, written) for name in ("ours", "theirs")}
    what = f"dynamic identification, {seconds:g} s x 100 kHz x 13 channels"
    for name, entry in found.items():
        print(
            f"{name}: {entry['seconds']:.2f} s, {entry['megabytes']:.0f} MB over the imports; kxx {entry['kxx']:.6g} N/m"
        )
    rows = []
    for suffix, key, unit in (("", "seconds", "s"), (", peak memory", "megabytes", "MB")):
        ours, theirs = found["ours"][key], found["theirs"][key]
        rows.append(
            {
                "what": what + suffix,
                "unit": unit,
                "against": "scipy.signal.csd, H1 of each channel",
                "ours": ours,
                "theirs": theirs,
                "goal": "> 1",
            }
        )
    return rows


def write_log(folder: Path, seconds: float) -> Path:
    """Write one log with both excitations in sequence, piece by piece: what is measured shall not need its memory."""
    from pipeline.recording.storage import StreamWriter
    from pipeline.rigs.tpjb import truth
    from pipeline.rigs.tpjb.axes import FROM_UV
    from pipeline.rigs.tpjb.dynamic.bench import Bench
    from pipeline.rigs.tpjb.probes import GAPS

    rng = np.random.default_rng(1)
    tones = np.array([7.0, 11.0, 13.0, 19.0, 23.0, 29.0, 37.0, 43.0])
    u = 400 * np.exp(1j * rng.uniform(0, 6, tones.size))
    units = dict.fromkeys(("force_u", "force_v"), "N") | dict.fromkeys(GAPS, "m")
    units |= {"acc_ua": "m/s^2", "acc_va": "m/s^2", "speed": "rad/s"}
    path = folder / "long.parquet"
    writer = StreamWriter(path, units)
    bearing = truth.bearing("4pad-L1")
    parts = []
    for sign in (1.0, -1.0):
        F = np.stack((u, sign * 1.03 * u), axis=1)
        d, a = Bench().answers(bearing.impedance, F @ FROM_UV.T, tones)
        parts.append((F, d @ FROM_UV, a @ FROM_UV))
    total = round(seconds * _RATE)
    for first in range(0, total, _PIECE):
        t = np.arange(first, min(first + _PIECE, total)) / _RATE
        turning = np.exp(2j * np.pi * tones[:, None] * t)
        later = t >= seconds / 2
        force, motion, acceleration = (
            np.where(later, (parts[1][i].T @ turning).real, (parts[0][i].T @ turning).real) for i in range(3)
        )
        runout = 3e-6 * np.cos(truth.SHAFT_SPEED * t)
        noise = rng.standard_normal((13, t.size))
        columns = {"force_u": force[0] + 5 * noise[0], "force_v": force[1] + 5 * noise[1]}
        for i, name in enumerate(GAPS):
            move = motion["uv".index(name[4])] + runout
            columns[name] = 1e-3 + (move if name[5] == "p" else -move) + 1e-7 * noise[2 + i]
        columns |= {"acc_ua": acceleration[0] + 5e-3 * noise[10], "acc_va": acceleration[1] + 5e-3 * noise[11]}
        columns["speed"] = truth.SHAFT_SPEED + 0.02 * noise[12]
        writer.add(t, columns)
    conditions: dict[str, Any] = {"static_load": 40e3, "shaft_speed_nominal": truth.SHAFT_SPEED, "stator_mass": 900.0}
    conditions |= {"stabilizer_stiffness": 5e6, "z1": -0.12, "z2": 0.12, "test": "dynamic"}
    about = {"run": "long", "stream": "", "conditions": {**conditions, "excitation_tones": "7 11 13 19 23 29 37 43 Hz"}}
    writer.close(
        {
            **about,
            "quality": [],
            "provenance": {"files": [], "repairs": [], "condition_sources": {}, "version": "", "begins": None},
        }
    )
    return path


def ours(path: Path) -> float:
    """Return kxx at shaft speed by rigfit."""
    from pipeline.recording.storage import read
    from pipeline.rigs.experiment import Context
    from pipeline.rigs.tpjb.dynamic.declaration import DynamicSettings
    from pipeline.rigs.tpjb.dynamic.identify import identify

    findings = identify([read(path, lazily=True)], DynamicSettings(), Context("benchmark", {}))
    return float(findings.one("kxx", synchronous=True).value or np.nan)


def theirs(path: Path) -> float:
    """Return kxx at 19 Hz from H1 of each channel on either force, half by half of the log.

    Segments of 1 s: the tones are on bins. Each cross-spectrum is one call, as one would write it.
    """
    import pandas as pd
    from scipy.signal import csd

    from pipeline.rigs.tpjb.axes import FROM_UV
    from pipeline.rigs.tpjb.probes import GAPS

    table = pd.read_parquet(path)
    half = len(table) // 2
    F, D, A = np.zeros((2, 2), complex), np.zeros((2, 2), complex), np.zeros((2, 2), complex)
    for m, rows in enumerate((slice(0, half), slice(half, 2 * half))):
        reference = table["force_u"].to_numpy()[rows]
        spectra = {
            name: csd(reference, table[name].to_numpy()[rows], fs=_RATE, nperseg=int(_RATE))[1][19]
            for name in ("force_u", "force_v", *GAPS, "acc_ua", "acc_va")
        }
        H1 = {name: value / spectra["force_u"] for name, value in spectra.items()}
        gaps = {a: sum(H1[f"gap_{a}p{p}"] - H1[f"gap_{a}m{p}"] for p in (1, 2)) / 4 for a in "uv"}
        F[:, m] = FROM_UV @ [H1["force_u"], H1["force_v"]]
        D[:, m] = FROM_UV @ [gaps["u"], gaps["v"]]
        A[:, m] = FROM_UV @ [H1["acc_ua"], H1["acc_va"]]
    w = 2 * np.pi * 19
    return float(((F - (900.0 - 5e6 / w**2) * A) @ np.linalg.inv(D))[0, 0].real)


def _in_process(name: str, path: Path) -> dict[str, float]:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.tpjb_dynamic", "--only", name, "--log", str(path)],
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(json.loads(done.stdout.splitlines()[-1]))


def _alone(name: str, path: Path) -> None:
    """Run one of the two and print seconds and peak memory over what imports take."""
    import pandas  # noqa: F401
    import scipy.signal  # noqa: F401

    import pipeline.rigs.tpjb.dynamic.identify  # noqa: F401

    Path("/proc/self/clear_refs").write_text("5")  # the peak counts from here (Linux)
    before = _memory("VmRSS")
    start = time.perf_counter()
    kxx = {"ours": ours, "theirs": theirs}[name](path)
    seconds = time.perf_counter() - start
    print(json.dumps({"seconds": seconds, "megabytes": _memory("VmHWM") - before, "kxx": kxx}))


def _memory(entry: str) -> float:
    """Return an entry of /proc/self/status in MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) / 1024 for line in lines if line.startswith(entry))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--only", choices=("ours", "theirs"))
    parser.add_argument("--log", type=Path)
    arguments = parser.parse_args()
    if arguments.only:
        _alone(arguments.only, arguments.log)
    else:
        for row in measure(arguments.seconds):
            print(row)
