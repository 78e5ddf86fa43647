"""A campaign of mre.shear as a test house makes it: 1 000 logs with repeats, a slow drift, faults and one bad day.

    python -m benchmarks.many_shear FOLDER [--runs 1000] [--bad 0.02] [--scatter 0.004] [--drift 0] [--bad-day]

writes the logs into FOLDER (a campaign's folder in `datasets/`), and beside it FOLDER-faults.csv: run, fault, gain. Nothing is
identified here: `rigfit ingest`, `rigfit identify` and `rigfit report` do that.
"""

from __future__ import annotations

import argparse
import csv
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from pipeline.recording import Channel, Recording
from pipeline.rigs.mre.synthetic import ShearRun, ShearTruth, shear_truth, sine_run

CURRENTS = (0.0, 1.5, 3.0, 4.5, 6.0)
FREQUENCIES = (3.0, 7.0, 11.0, 13.0, 17.0)  # none divides 50 Hz
AMPLITUDES = (1.5e-4, 3e-4, 4.5e-4, 6e-4)
_DAY = 0.04  # share of the runs that a bad day spoils
_BAD_GAIN = 0.05


@dataclass(frozen=True)
class Plan:
    """One run: its name and setting, its place in the campaign, its seed, the gain of its force, and its fault or ''."""

    run: ShearRun
    place: int
    seed: int
    gain: float
    fault: str


@dataclass(frozen=True)
class Campaign:
    """What is made: runs, share with a fault, gain scatter, drift of the gain over the campaign, and the rig's truth."""

    runs: int = 1000
    bad: float = 0.02
    scatter: float = 0.004
    drift: float = 0.0
    bad_day: bool = False
    one_condition: bool = False
    seed: int = 1
    duration: float = 4.0
    rate: float = 5000.0

    @property
    def truth(self) -> ShearTruth:
        """The rig."""
        return shear_truth({"duration": self.duration, "rate": self.rate})


def plans(campaign: Campaign) -> list[Plan]:
    """Return the runs in the order in which they are made: every condition in turn, shuffled, until there are enough."""
    rng = np.random.default_rng(campaign.seed)
    grid = list(product(CURRENTS, FREQUENCIES, AMPLITUDES))
    if campaign.one_condition:
        grid = [(3.0, 11.0, 4.5e-4)]
    order = [grid[i] for _ in range(-(-campaign.runs // len(grid))) for i in rng.permutation(len(grid))][
        : campaign.runs
    ]
    bad = set(rng.choice(campaign.runs, round(campaign.bad * campaign.runs), replace=False).tolist())
    names = list(FAULTS)
    day = range(int(0.6 * campaign.runs), int((0.6 + _DAY) * campaign.runs)) if campaign.bad_day else range(0)
    found, faulty = [], 0
    for place, (current, frequency, amplitude) in enumerate(order):
        gain = 1 + campaign.scatter * rng.standard_normal() + campaign.drift * place / campaign.runs
        gain += _BAD_GAIN if place in day else 0.0
        fault = names[faulty % len(names)] if place in bad else ""
        faulty += place in bad
        run = ShearRun(f"r{place + 1:04d}", "shear", frequency, amplitude, current)
        found.append(Plan(run, place + 1, int(rng.integers(2**31)), gain, fault))
    return found


def recording_of(campaign: Campaign, plan: Plan) -> Recording:
    """Return the log of one run."""
    made = sine_run(campaign.truth, plan.run, np.random.default_rng(plan.seed))
    made = _changed(made, "force", lambda _t, F: plan.gain * F)
    made = FAULTS[plan.fault](made) if plan.fault else made
    return replace(made, conditions={**made.conditions, "sequence_index": float(plan.place)})


def recordings(campaign: Campaign) -> Iterator[Recording]:
    """Yield all runs."""
    return (recording_of(campaign, plan) for plan in plans(campaign))


def _changed(recording: Recording, name: str, change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Recording:
    (stream,) = recording.streams.values()
    values = change(stream.time, stream.channels[name].values)
    channel = Channel(name, values, stream.channels[name].unit)
    return replace(recording, streams={stream.name: replace(stream, channels={**stream.channels, name: channel})})


def _swapped(recording: Recording) -> Recording:
    x, F = recording.values("displacement"), recording.values("force")
    return _changed(_changed(recording, "displacement", lambda _t, _x: F), "force", lambda _t, _F: x)


def _hung(_time: np.ndarray, F: np.ndarray) -> np.ndarray:
    F = F.copy()
    F[F.size // 2 :] = F[F.size // 2]
    return F


FAULTS: dict[str, Callable[[Recording], Recording]] = {
    "gain 6 % high": lambda r: _changed(r, "force", lambda _t, F: 1.06 * F),
    "force clipped": lambda r: _changed(r, "force", lambda _t, F: np.clip(F, -np.inf, 0.7 * F.max())),
    "force 600 us late": lambda r: _changed(r, "force", lambda t, F: np.interp(t - 6e-4, t, F)),
    "wrong sign": lambda r: _changed(r, "force", lambda _t, F: -F),
    "mm taken as m": lambda r: _changed(r, "displacement", lambda _t, x: 1e3 * x),
    "force hung": lambda r: _changed(r, "force", _hung),
    "channels swapped": _swapped,
    "another preload": lambda r: _changed(r, "force", lambda _t, F: F + 4e4 * r.values("displacement")),
    "dead displacement": lambda r: _changed(r, "displacement", lambda _t, x: np.zeros_like(x)),
}  # fmt: skip
"""Faults of the sheet's section 8, in turn, as large as they are seen on rigs."""


def write(campaign: Campaign, folder: Path) -> list[Plan]:
    """Write the logs (CSV) and what is in them into `folder`, on all cores."""
    from joblib import Parallel, delayed

    folder.mkdir(parents=True, exist_ok=True)
    made = plans(campaign)
    cores = len(os.sched_getaffinity(0))
    Parallel(n_jobs=cores)(delayed(_write_log)(campaign, plan, folder) for plan in made)
    return made


def _write_log(campaign: Campaign, plan: Plan, folder: Path) -> None:
    from pipeline.ingest.delimited.writer import write_csv
    from pipeline.rigs.mre.shear.declaration import SHEAR

    units = {spec.name: spec.unit for spec in SHEAR.conditions}
    write_csv(recording_of(campaign, plan), folder / f"{plan.run.name}.csv", units)


def main() -> None:
    """Write a campaign and say which runs are faulty."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--runs", type=int, default=1000)
    options.add_argument("--bad", type=float, default=0.02, help="share of runs with a fault")
    options.add_argument("--scatter", type=float, default=0.004, help="gain error from run to run, 1 sigma")
    options.add_argument("--drift", type=float, default=0.0, help="change of the gain over the campaign")
    options.add_argument(
        "--bad-day", action="store_true", help=f"{100 * _DAY:g} %% of the runs in a row, 5 %% too stiff"
    )
    options.add_argument(
        "--one-condition", action="store_true", help="all runs at one current, frequency and amplitude"
    )
    options.add_argument("--duration", type=float, default=4.0, help="of a run, s")
    options.add_argument("--seed", type=int, default=1)
    given = vars(options.parse_args())
    folder = given.pop("folder")
    made = write(Campaign(**given), folder)
    with folder.with_name(f"{folder.name}-faults.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([plan.run.name, plan.fault, f"{plan.gain:.5f}"] for plan in made)


if __name__ == "__main__":
    main()
