"""Which windows calibrate and which are held out: by condition `set` and by tube (rap.md, 5.3 and 11)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.windows import FlowWindows

CALIBRATION, HOLDOUT = "calibration", "holdout"


@dataclass(frozen=True, eq=False)
class Sets:
    """Name of the set of every window ('' for none), shape (w,); the tube that is calibrated; what must be told."""

    label: np.ndarray
    tube: str
    problems: tuple[QualityFinding, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The sets that windows belong to: calibration first, then the hold-outs."""
        found = dict.fromkeys(self.label)
        return tuple(sorted((name for name in found if name), key=lambda name: (name != CALIBRATION, name)))


def sets_of(windows: FlowWindows) -> Sets:
    """Sort the windows."""
    problems = []
    label = windows.role.copy()
    if windows.size and not np.any(windows.role != ""):
        label[:] = CALIBRATION
        text = (
            "no run states the condition 'set' (calibration or holdout): all runs calibrate, and their errors say how well the laws fit, not how "
            "well they predict"
        )
        problems.append(QualityFinding("warning", text))
    elif np.any(windows.role == ""):
        runs = list(dict.fromkeys(windows.run[windows.role == ""]))
        text = f"set is not stated for {listing(runs, 6)}: not used to calibrate or to judge, flows are estimated only"
        problems.append(QualityFinding("note", text))
    tubes = [tube for tube in windows.tube[label == CALIBRATION] if tube]
    tube = max(dict.fromkeys(tubes), key=tubes.count) if tubes else ""
    other = (windows.tube != tube) & (windows.tube != "") & bool(tube)
    mixed = other & (label == CALIBRATION)
    if mixed.any():
        runs = list(dict.fromkeys(windows.run[mixed]))
        text = f"calibration runs were made with several tubes: tube {tube} is calibrated, {listing(runs, 6)} not used; each tube has a volume of its own"
        problems.append(QualityFinding("warning", text))
        label[mixed] = ""
    for i in np.flatnonzero(other & (label == HOLDOUT)):
        label[i] = f"{HOLDOUT}, tube {windows.tube[i]}"
    return Sets(label, tube, tuple(problems))
