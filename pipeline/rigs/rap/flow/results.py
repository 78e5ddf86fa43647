"""What a campaign of flow runs yields, as data; computed in `campaign`, judged in `verdict`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.flow.calibration import Calibrated, LeftOut
from pipeline.rigs.rap.flow.location import Location
from pipeline.rigs.rap.flow.run_windows import RunNumbers
from pipeline.rigs.rap.flow.sets import called
from pipeline.rigs.rap.flow.windows import FlowWindows

ESTIMATORS = ("E0", "E1", "E2", "E3")


@dataclass(frozen=True)
class ErrorRow:
    """Relative errors of one estimator over the windows of one set: largest (and that with the access line open), rms, mean, of how many.

    `tube` is told where held-out windows have several.
    """

    estimator: str
    set: str
    worst: float
    worst_open: float
    rms: float
    mean: float
    count: int
    where: str
    tube: str = ""

    @property
    def group(self) -> str:
        """How the set is called, with the tube where there are several."""
        return called(self.set, self.tube)


@dataclass(frozen=True)
class FlowRow:
    """Estimated flow (m^3/s) of the windows of one run and set-point, its relative errors (type A, type B), the meter's mean."""

    run: str
    flow_set: float
    estimator: str
    value: float
    random: float
    systematic: float
    dof: float
    metered: float
    count: int
    doubt: str = ""
    why_not: str = ""


@dataclass(frozen=True, eq=False)
class Trap:
    """Laws fitted to unclamped windows alone: largest relative error there and on the clamped windows, by law."""

    inside: dict[str, float]
    outside: dict[str, float]
    values: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Campaign:
    """All runs together.

    Attributes
    ----------
    runs, windows
        What each gives; all windows side by side (those of `calibration` are the fit's).
    location
        Where the meter sits.
    laws, refused
        The estimators that are calibrated; why others are not, by name.
    left_out
        Set-points left out in turn, by law.
    errors, flows
        Rows of `flow_error_*` and of `flow`.
    trap
        What unclamped set-points alone would have said; None where no window is clamped or none is not.
    gain_u, uf_u, zero_u
        Type B: relative of the meter's gain and of the UF rate added to it; of the back pressure's zero, Pa.
    problems
        What must be told.
    """

    runs: list[RunNumbers]
    windows: FlowWindows
    calibration: FlowWindows
    location: Location
    laws: dict[str, Calibrated]
    refused: dict[str, str]
    left_out: dict[str, list[LeftOut]]
    errors: list[ErrorRow]
    flows: list[FlowRow]
    trap: Trap | None
    tube: str
    gain_u: float
    gain_stated: bool
    uf_u: float
    zero_u: float
    problems: list[QualityFinding] = field(default_factory=list)
