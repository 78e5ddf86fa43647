"""R7: cells in the fluid that went round, beside a control (rap.md, sections 2 and 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.overridden import overridden
from pipeline.rigs.rap.synthetic.truth_check import RIG

_TOGETHER = 1e-6


@dataclass(frozen=True)
class CytotoxicityTruth:
    """R7; shares of cells, 1.

    Attributes
    ----------
    times
        When samples are drawn, s.
    replicates
        Samples of each group and time.
    viability, necrosis, apoptosis
        What is true of the control; they need not sum to 1.
    scatter
        1 sigma of a sample's viability; what it lacks the others have, in proportion.
    loss
        Viability that the treated cells lack at the last time; it grows in proportion to time.
    control
        once (at the first time), each (at every time) or none.
    """

    times: Sequence[float] = (0.0, 1800.0, 3600.0, 10800.0, 21600.0)
    replicates: int = 4
    viability: float = 0.92
    necrosis: float = 0.03
    apoptosis: float = 0.05
    scatter: float = 0.03
    loss: float = 0.0
    control: str = "once"
    run: str = "rap_cyto"


def cytotoxicity_run(overrides: Mapping[str, Any], seed: int) -> Recording:
    """Return the table of samples."""
    truth = overridden(CytotoxicityTruth(), overrides, f"{RIG}'s culture")
    rng = np.random.default_rng((seed, 7))
    last = max(max(truth.times), 1.0)
    control_times = {"once": truth.times[:1], "each": truth.times}.get(truth.control, ())
    rows = [(float(t), group, i) for group, times in (("control", control_times), ("treated", truth.times))
            for t in times for i in range(1, int(truth.replicates) + 1)]  # fmt: skip
    rows.sort(key=lambda row: row[0])
    time = np.array([row[0] for row in rows])
    treated = np.array([row[1] == "treated" for row in rows])
    lack = np.where(treated, truth.loss * time / last, 0.0) - truth.scatter * rng.standard_normal(time.size)
    dead = truth.necrosis + truth.apoptosis
    share = truth.necrosis / dead if dead else 0.5
    viability = np.clip(truth.viability - lack, 0.0, 1.0)
    gone = np.clip(1.0 - viability, 0.0, 1.0) * (dead / max(1.0 - truth.viability, 1e-9))
    spread = np.clip(share * (1.0 + 0.1 * rng.standard_normal(time.size)), 0.0, 1.0)
    for i in range(1, time.size):
        time[i] = max(time[i], time[i - 1] + _TOGETHER)
    columns = {
        "group": (np.array([row[1] for row in rows], dtype=object), ""),
        "viability": (viability, "1"),
        "necrosis": (gone * spread, "1"),
        "apoptosis": (gone * (1.0 - spread), "1"),
        "replicate": (np.array([float(row[2]) for row in rows]), "1"),
    }
    cells = Stream("cells", time, {name: Channel(name, values, unit) for name, (values, unit) in columns.items()})
    conditions = {"fluid": "medium", "filter_id": "F1", "tube_set_id": "A"}
    return Recording(truth.run, {"cells": cells}, conditions)
