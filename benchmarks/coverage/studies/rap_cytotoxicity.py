"""`rap.cytotoxicity`: samples of treated cells beside a control, all three differences.

Bound: the scatter of single samples is known, each difference is that of two means.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.recording import Recording, Stream
from pipeline.rigs.rap.cytotoxicity.declaration import CYTOTOXICITY
from pipeline.rigs.rap.synthetic import rig
from pipeline.rigs.rap.synthetic.cells import CytotoxicityTruth

CASES = {
    "standard": Case(
        "four samples a time that scatter by 3 points, one in twenty lost, a counter that reads up to some percent off (the same "
        "for all), a loss of 4 points in 6 h"
    )
}
_LOSS, _LOST, _COUNTER = 0.04, 0.05, 0.01


def campaign(_case: str, seed: int) -> Campaign:
    """Return the table of R7 and what is true of it."""
    rng = np.random.default_rng((seed, 94))
    counter = 1.0 + _COUNTER * float(rng.standard_normal())
    t = CytotoxicityTruth(viability=0.85, necrosis=0.06, apoptosis=0.09, loss=_LOSS)
    of_dead = {"necrosis": t.necrosis, "apoptosis": t.apoptosis}
    overrides = {"viability": t.viability, **of_dead, "loss": t.loss}
    recordings = [_thinned(_counted(r, counter), rng) for r in rig.synthesize_cytotoxicity(overrides, seed)]

    def share(p: Parameter) -> float:
        kind = p.name.removesuffix("_difference")
        return -1.0 if kind == "viability" else of_dead[kind] / (t.necrosis + t.apoptosis)

    def truth(p: Parameter) -> float | None:
        last = max(t.times)
        return counter * share(p) * t.loss * float(p.at["time"]) / last if p.name.endswith("_difference") else None

    def bound(p: Parameter) -> float | None:
        return t.scatter * abs(share(p)) * math.sqrt(2.0 / t.replicates) if p.name == "viability_difference" else None

    return Campaign(recordings, truth, bound=bound)


def _counted(recording: Recording, counter: float) -> Recording:
    def read(stream: Stream) -> Stream:
        channels = {n: c if c.is_text or n == "replicate" else replace(c, values=c.values * counter) for n, c in stream.channels.items()}  # fmt: skip
        return replace(stream, channels=channels)

    return replace(recording, streams={name: read(stream) for name, stream in recording.streams.items()})


def _thinned(recording: Recording, rng: np.random.Generator) -> Recording:
    def some(stream: Stream) -> Stream:
        kept = rng.random(stream.size) > _LOST
        channels = {name: replace(c, values=c.values[kept]) for name, c in stream.channels.items()}
        return Stream(stream.name, stream.time[kept], channels)

    return replace(recording, streams={name: some(stream) for name, stream in recording.streams.items()})


STUDY = Study(CYTOTOXICITY, CASES, campaign)
