"""The fit of `mre.shear` as a table that designs start from, and what further runs would tell: Fisher information.

Nothing is fitted and nothing proposed here: `advise` does that, from the table alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pipeline.estimation.design import Information
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.dynamic_model import HarmonicModel, Layout, real_rows
from pipeline.rigs.mre.model.harmonic_fit import keys_of
from pipeline.rigs.mre.model.loop import N_F, N_X, Loop
from pipeline.signals.spectra import near_mains

if TYPE_CHECKING:
    import pandas as pd

INFORMATION, NOISE = "information", "noise_levels"
"""Names of the two tables: the fit with its information; noise of a harmonic over frequency."""

_BINS = 12  # frequencies at which the noise is told
_FITTED_X = 5  # harmonics of a sine that are fitted to the displacement


def design_tables(fit: DynamicFit | None) -> dict[str, pd.DataFrame]:
    """Return both tables; none where no model holds."""
    if fit is None or fit.rejected:
        return {}
    return {INFORMATION: _information(fit), NOISE: _noise(fit)}


def _information(fit: DynamicFit) -> pd.DataFrame:
    """Return one row a parameter: name, value, row of the information, and what else belongs to the fit."""
    import pandas as pd

    layout = fit.layout
    n_shape = len(fit.names) - len(layout.terms)
    keys = keys_of(layout, n_shape)
    preloads = [loop.preload for loop in fit.loops if loop.preload is not None]
    table = pd.DataFrame(
        {
            "name": [key.name for key in keys],
            "coil_current": [math.nan if key.current is None else key.current for key in keys],
            "text": list(fit.names),
            "value": fit.values,
            "variant": layout.variant,
            "levels": ", ".join(repr(float(level)) for level in layout.levels),
            "reference": layout.reference,
            "mass": layout.mass,
            "field_at_reference": layout.field_at_reference,
            "shape": n_shape,
            "held_lag": math.nan if fit.held_lag is None else fit.held_lag,
            "run_scatter": fit.run_scatter,
            "duration": float(np.median([loop.duration for loop in fit.loops])),
            "preload": float(np.median(preloads)) if preloads else math.nan,
        }
    )
    return pd.concat([table, pd.DataFrame(fit.information, columns=[f"i_{name}" for name in fit.names])], axis=1)


def _noise(fit: DynamicFit) -> pd.DataFrame:
    """Return frequency (Hz) and the noise there of a harmonic of force (N) and displacement (m), times sqrt(duration)."""
    import pandas as pd

    orders = np.arange(1, N_F + 1)
    rows = []
    for loop in fit.loops:
        for order in orders[loop.kept]:
            x = loop.sd_x[order - 1] if order <= _FITTED_X else math.nan
            rows.append((order * loop.frequency, *(np.array([loop.sd_f[order - 1], x]) * math.sqrt(loop.duration))))
    found = np.array(sorted(rows))
    parts = [part for part in np.array_split(found, min(_BINS, len(found))) if len(part)]
    table = pd.DataFrame(
        [[np.median(part[:, 0]), np.median(part[:, 1]), _median(part[:, 2])] for part in parts],
        columns=["frequency", "force", "displacement"],
    )
    return table.interpolate(limit_direction="both")


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan


@dataclass(frozen=True, eq=False)
class Fitted:
    """The fit as its tables hold it; `names` are those of the information, `values` in the same order."""

    information: Information
    values: np.ndarray
    layout: Layout
    n_shape: int
    held_lag: float | None
    run_scatter: float
    duration: float
    preload: float | None
    noise: pd.DataFrame

    @classmethod
    def of(cls, table: pd.DataFrame, noise: pd.DataFrame) -> Fitted:
        """Return what the two tables hold."""
        first = table.iloc[0]
        names = tuple(table["text"])
        levels = tuple(float(text) for text in str(first["levels"]).split(","))
        layout = Layout(
            str(first["variant"]), tuple(range(len(levels))), levels, int(first["reference"]), bool(first["mass"]),
            bool(first["field_at_reference"]),
        )  # fmt: skip
        lag, preload = float(first["held_lag"]), float(first["preload"])
        return cls(
            Information(names, table[[f"i_{name}" for name in names]].to_numpy(float)),
            table["value"].to_numpy(float),
            layout,
            int(first["shape"]),
            None if math.isnan(lag) else lag,
            float(first["run_scatter"]),
            float(first["duration"]),
            None if math.isnan(preload) else preload,
            noise,
        )

    def value(self, name: str) -> float:
        """Return a parameter."""
        return float(self.values[self.information.names.index(name)])

    def told_by(self, runs: Sequence[tuple[float, float, int]], mains: float) -> list[Information]:
        """Return the information of runs of frequency (Hz), amplitude (m) and number of the current level.

        Each has the noise of the campaign's runs at its harmonics, their usual duration, and a gain of its own.
        """
        q = np.r_[np.log(self.values[:2]), self.values[2 : self.n_shape]]
        loops = [self._loop(number, *run[:2], mains) for number, run in enumerate(runs)]
        # Every level has a run here, so that the columns are those of the fit.
        layout = replace(self.layout, labels=tuple(run[2] for run in runs))
        whole = [key.text for key in keys_of(layout, self.n_shape)]
        places = [self.information.names.index(text) for text in whole]
        c = self.values[places[self.n_shape :]]
        model = HarmonicModel(loops, layout, self.held_lag)
        model = HarmonicModel(loops, layout, self.held_lag, model.noise_around(q, c))
        A, dA = model(q)
        slope = np.r_[1 / self.values[:2], np.ones(self.n_shape - 2)]
        columns = np.hstack([(dA @ c).T * slope, A])
        rows = model.whitened(real_rows(columns))
        gains = model.whitened(model.predicted(q, c))
        prior = self.run_scatter
        return [
            Information.of(
                whole, rows[model.groups == number], 1.0, gains[model.groups == number][:, None] if prior else None,
                prior or math.inf,
            )
            for number in range(len(loops))
        ]  # fmt: skip

    def _loop(self, number: int, frequency: float, amplitude: float, mains: float) -> Loop:
        orders = np.arange(1, N_F + 1)
        at = np.log(orders * frequency)
        known = np.log(self.noise["frequency"].to_numpy(float))
        sd_f, sd_x = (
            np.exp(np.interp(at, known, np.log(np.maximum(self.noise[name].to_numpy(float), 1e-300))))
            / math.sqrt(self.duration)
            for name in ("force", "displacement")
        )
        X = np.zeros(N_X, dtype=complex)
        X[0] = -1j * amplitude
        kept = ~near_mains(frequency * orders, self.duration, mains) if mains > 0 else np.ones(N_F, dtype=bool)
        return Loop(
            f"proposed {number}", frequency, X, np.ones(N_F, dtype=complex), np.where(orders <= _FITTED_X, sd_x, 0.0), sd_f,
            kept, 0.0, 0.0, 0.0, 0.0, 0, self.duration,
        )  # fmt: skip
