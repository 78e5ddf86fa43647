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
    """Set of every window ('' for none), shape (w,); the tube that is calibrated; what must be told.

    `tubes` names the tube of every window where hold-outs have several, so that their errors are told apart; '' elsewhere.
    """

    label: np.ndarray
    tube: str
    tubes: np.ndarray
    problems: tuple[QualityFinding, ...]

    @property
    def group(self) -> np.ndarray:
        """How the set of every window is called, shape (w,)."""
        return np.array([called(a, b) for a, b in zip(self.label, self.tubes, strict=True)], dtype=object)


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
    mixed = other_tube(windows, tube) & (label == CALIBRATION)
    if mixed.any():
        runs = list(dict.fromkeys(windows.run[mixed]))
        text = f"calibration runs were made with several tubes: tube {tube} is calibrated, {listing(runs, 6)} not used; each tube has a volume of its own"
        problems.append(QualityFinding("warning", text))
        label[mixed] = ""
    return Sets(label, tube, _told_apart(windows, label, tube), tuple(problems))


def other_tube(windows: FlowWindows, tube: str) -> np.ndarray:
    """Return which windows state another tube than `tube`, mask (w,): a tube that nobody states is taken for the calibrated one."""
    return np.asarray((windows.tube != tube) & (windows.tube != "") & bool(tube), dtype=bool)


def _told_apart(windows: FlowWindows, label: np.ndarray, tube: str) -> np.ndarray:
    """Return the tube of each held-out window where hold-outs have several; '' elsewhere, shape (w,)."""
    held_out = label == HOLDOUT
    named = np.where(windows.tube != "", windows.tube, tube or "not stated")
    several = np.unique(named[held_out].astype(str)).size > 1
    return np.where(held_out & several, named, "").astype(object)


def called(name: str, tube: str = "") -> str:
    """Return how a set is called in sentences and figures: ``"hold-out, tube B"``."""
    words = {CALIBRATION: "calibration", HOLDOUT: "hold-out", "": "no set"}[name]
    return f"{words}, tube {tube}" if tube else words
