"""On which line the flow meter sits, as stated and as the logs say: on the return line it reads Q_b - Q_uf (rap.md, 4 row 5)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.rap.flow.estimators import pressure_columns
from pipeline.rigs.rap.flow.windows import FlowWindows

# What the meter's reading changes by for a change of the UF rate: 0 on the access line, -1 on the return line; told apart
# where the error is below the first and the value within the second of one of them.
_SHARP, _NEAR = 0.12, 0.35


@dataclass(frozen=True)
class Location:
    """Where the meter sits.

    Attributes
    ----------
    stated
        access, return or '' where no run says.
    response, error
        Share of the UF rate that the reading lacks (negative), and its standard error; NaN where no UF was drawn.
    switched
        Whether UF was on and off. If not, `response` is the offset that E3 leaves, which proves less.
    silent
        Runs that do not state it while others do.
    """

    stated: str
    response: float
    error: float
    switched: bool = False
    silent: tuple[str, ...] = ()

    @property
    def found(self) -> str:
        """The line that the logs themselves tell; '' where they don't."""
        if not self.error < _SHARP:
            return ""
        if abs(self.response) < _NEAR:
            return "access"
        return "return" if abs(self.response + 1.0) < _NEAR else ""

    @property
    def contradicted(self) -> bool:
        """Tell whether the logs say another line than is stated."""
        return bool(self.stated and self.found and self.stated != self.found)

    @property
    def trusted(self) -> str:
        """The line to reckon with: as stated unless the logs contradict, else as found by switching UF; '' where unknown."""
        if self.contradicted:
            return ""
        return self.stated or (self.found if self.switched else "")


def locate(stated: str, windows: FlowWindows) -> Location:
    """Return where the meter sits, by what its reading does with the UF pump on.

    The reading is regressed on E3's columns and the UF rate, with a stroke volume for each run: pump and circuit explain the rest. Where UF
    was on throughout, its column is an offset, which E3 does not have.
    """
    nothing = Location(stated, float("nan"), float("nan"))
    kept = np.isfinite(windows.metered) & np.isfinite(windows.back_pressure)
    used = windows.of(kept)
    if used.size < 6 or not np.any(used.uf > 0.0):
        return nothing
    runs = list(dict.fromkeys(used.run))
    columns = [pressure_columns(used.f, used.back_pressure), used.uf[:, None]]
    columns += [(used.f * (used.run == run))[:, None] for run in runs[1:]]
    design = np.concatenate(columns, axis=1)
    size = np.sqrt((design**2).sum(axis=0))
    scaled = design / size
    solution, _, rank, singular = np.linalg.lstsq(scaled, used.metered, rcond=1e-10)
    dof = np.unique(used.point).size - rank
    if rank < design.shape[1] or dof < 2 or singular[-1] < 1e-3 * singular[0]:
        return nothing
    residual = used.metered - scaled @ solution
    covariance = np.linalg.inv(scaled.T @ scaled) * float(residual @ residual) / dof
    switched = bool(np.any(used.uf > 0.0) and np.any(used.uf <= 0.0))
    return Location(stated, float(solution[2] / size[2]), float(np.sqrt(covariance[2, 2]) / size[2]), switched)


def blood_flow(windows: FlowWindows, location: str) -> FlowWindows:
    """Return the windows with the blood flow that the meter stands for; NaN where the line is unknown and UF is drawn."""
    added = {"access": np.zeros(windows.size), "return": windows.uf}
    unknown = np.where(windows.uf > 0.0, np.nan, 0.0)
    return replace(windows, flow=windows.metered + added.get(location, unknown))
