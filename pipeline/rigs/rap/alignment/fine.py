"""Lag, clock rate and poles of the sensors from device over bench at the pump's lines (rap.md, eq. 2 and 5.1 b).

Knows neither recordings nor how the windows were cut; which stroke is which is settled before, in `unwrap`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.least_squares import Fit, Unknown, fit
from pipeline.estimation.uncertainty import Covariance, clustered
from pipeline.rigs.rap.alignment.strokes import ORDERS, Lines, Strokes
from pipeline.rigs.rap.circuit.sensor_pair import device_over_bench

# A line of the bench that stands out less, in its standard errors, is left out: its noise would bias the ratio.
_LEAST_LINE = 10.0
# Ratios further from eq. (2), in robust standard deviations, are left out.
_STRAY = 5.0
# Poles are said to differ where chance makes them so less often.
_DIFFER = 0.001
WEIGHTED = 1.08
"""Weights found from the same ratios make the result look too certain by that factor (300 runs of the synthetic rig)."""
# Windows are put together into that many groups, each a unit of what repeats.
_GROUPS = 40
_LARGEST_DELAY, _LARGEST_RATE, _LARGEST_POLE = 0.15, 200e-6, 0.2


@dataclass(frozen=True, eq=False)
class Rows:
    """Ratios one below the other, shape (r,): `pair` and `window` numbers, angular frequency `omega`, `ahead` (s) of the reference."""

    pair: np.ndarray
    window: np.ndarray
    order: np.ndarray
    omega: np.ndarray
    ahead: np.ndarray
    ratio: np.ndarray
    sd: np.ndarray

    def of(self, kept: np.ndarray) -> Rows:
        """Return the rows at `kept`."""
        return Rows(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))

    @property
    def size(self) -> int:
        """Number of ratios."""
        return int(self.pair.size)


@dataclass(frozen=True, eq=False)
class Fine:
    """Eq. (2) as fitted: parameters `delay`, `rate`, `gain_<pair>` and `pole` (or `pole_<pair>`), and the rows behind it."""

    fit: Fit
    rows: Rows
    used: np.ndarray
    model: np.ndarray
    separate: bool

    @property
    def pairs(self) -> list[int]:
        """Numbers of the pairs that took part."""
        return [int(p) for p in np.unique(self.rows.pair[self.used])]

    def pole(self, pair: int) -> str:
        """Return the name of the pole of a pair."""
        return f"pole_{pair}" if self.separate else "pole"


def rows_of(device: Sequence[Lines], bench: Sequence[Lines], strokes: Strokes, reference: float) -> Rows:
    """Return the ratios device over bench of all pairs, windows and orders whose line stands out on the bench."""
    parts = []
    orders = np.array(ORDERS, dtype=float)
    for number, (ours, theirs) in enumerate(zip(device, bench, strict=True)):
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = ours.amplitude / theirs.amplitude
            size = np.abs(theirs.amplitude)
            sd = np.hypot(ours.error, np.abs(ratio) * theirs.error) / size
            good = (
                np.isfinite(ratio) & (size > _LEAST_LINE * theirs.error) & (np.abs(ours.amplitude) > 3.0 * ours.error)
            )
        window, k = np.nonzero(good)
        omega = 2.0 * np.pi * orders[k] * strokes.frequency[window]
        ahead = strokes.windows.centre[window] - reference
        parts.append((np.full(window.size, number), window, orders[k], omega, ahead, ratio[good], sd[good]))
    return Rows(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def model_of(
    rows: Rows, values: Mapping[str, float], tau_b: float, separate: bool, *, delayed: bool = True
) -> np.ndarray:
    """Return eq. (2) at the rows, complex, shape (r,); without the clock's part unless `delayed`."""
    gain = np.array([values.get(f"gain_{p}", 1.0) for p in range(int(rows.pair.max()) + 1)])[rows.pair]
    poles = [values.get(f"pole_{p}" if separate else "pole", 0.0) for p in range(int(rows.pair.max()) + 1)]
    tau_d = np.array(poles)[rows.pair]
    lag, rho = (values["delay"], values["rate"]) if delayed else (0.0, 0.0)
    return np.asarray(device_over_bench(rows.omega, gain, tau_d, tau_b, lag, rho, rows.ahead))


def fit_ratios(rows: Rows, start: tuple[float, float], tau_b: float, *, with_rate: bool = True) -> Fine:
    """Fit eq. (2) to the ratios.

    Parameters
    ----------
    rows
        From `rows_of`; at least some ten.
    start
        Delay (s) and rate to start from.
    tau_b
        Pole of the bench's sensors, s.
    with_rate
        Whether the windows lie far enough apart to tell a rate.
    """
    apart = _settled(rows, start, tau_b, with_rate, separate=True)
    if len(apart.pairs) > 1 and _differ(apart.fit, apart.pairs):
        return apart
    return _settled(rows, start, tau_b, with_rate, separate=False)


def _settled(rows: Rows, start: tuple[float, float], tau_b: float, with_rate: bool, separate: bool) -> Fine:
    """Return the fit with each line weighted by its own scatter and strays left out."""
    used = np.ones(rows.size, dtype=bool)
    found = _fitted(rows, used, start, tau_b, with_rate, separate)
    scaled = rows
    for _ in range(2):
        scaled, used = _reweighted(rows, found, tau_b, separate)
        found = _fitted(scaled, used, start, tau_b, with_rate, separate)
    spread = found.covariance
    found = found.with_covariance(Covariance(WEIGHTED**2 * spread.matrix, spread.dof, spread.method))
    return Fine(found, scaled, used, model_of(rows, found.values, tau_b, separate), separate)


def _fitted(
    rows: Rows, used: np.ndarray, start: tuple[float, float], tau_b: float, with_rate: bool, separate: bool
) -> Fit:
    kept = rows.of(used)
    pairs = [int(p) for p in np.unique(kept.pair)]
    poles = [f"pole_{p}" for p in pairs] if separate else ["pole"]
    unknowns = [
        Unknown("delay", start[0], start[0] - _LARGEST_DELAY, start[0] + _LARGEST_DELAY, "s"),
        Unknown("rate", start[1], start[1] - 2 * _LARGEST_RATE, start[1] + 2 * _LARGEST_RATE, fixed=not with_rate),
        *(Unknown(f"gain_{p}", float(np.median(np.abs(kept.ratio[kept.pair == p]))), 0.0, 1e9) for p in pairs),
        *(Unknown(name, 0.02, 0.0, _LARGEST_POLE, "s") for name in poles),
    ]
    weight = 1.0 / kept.sd

    def residual(values: Mapping[str, float]) -> np.ndarray:
        off = (model_of(kept, values, tau_b, separate) - kept.ratio) * weight
        return np.concatenate([off.real, off.imag])

    def jacobian(values: Mapping[str, float]) -> np.ndarray:
        model = model_of(kept, values, tau_b, separate) * weight
        turn = 1j * kept.omega * model
        columns = [turn] + ([turn * kept.ahead] if with_rate else [])
        columns += [np.where(kept.pair == p, model / values[f"gain_{p}"], 0.0) for p in pairs]
        for p in pairs if separate else [None]:
            tau = values["pole" if p is None else f"pole_{p}"]
            fall = -1j * kept.omega / (1.0 + 1j * kept.omega * tau) * model
            columns.append(fall if p is None else np.where(kept.pair == p, fall, 0.0))
        table = np.stack(columns, axis=-1)
        return np.concatenate([table.real, table.imag])

    found = fit(residual, unknowns, jacobian=jacobian)
    return found.with_covariance(_covariance(found, kept.window))


def _covariance(found: Fit, window: np.ndarray) -> Covariance:
    """Return the covariance with groups of windows as what repeats; that of white residuals where groups are too few."""
    number = np.unique(window, return_inverse=True)[1]
    size = max(int(np.ceil((number.max() + 1) / _GROUPS)), 1)
    groups = number // size
    if groups.max() < 4 or found.at_bound:
        return found.covariance
    try:
        return clustered(found.jacobian, found.residual, np.concatenate([groups, groups]))
    except (ValueError, np.linalg.LinAlgError):
        return found.covariance


def _reweighted(rows: Rows, found: Fit, tau_b: float, separate: bool) -> tuple[Rows, np.ndarray]:
    """Return the rows with the scatter that each line of each pair shows, and which of them are not astray."""
    model = model_of(rows, found.values, tau_b, separate)
    off = np.abs(rows.ratio - model) / rows.sd
    sd = rows.sd.copy()
    for p in np.unique(rows.pair):
        for k in np.unique(rows.order):
            same = (rows.pair == p) & (rows.order == k)
            if same.sum() >= 6:
                # Median of a Rayleigh-distributed modulus: 1.1774 standard deviations of one part.
                sd[same] *= max(float(np.median(off[same])) / 1.1774, 0.05)
    used = np.abs(rows.ratio - model) < _STRAY * np.sqrt(2.0) * sd
    return replace(rows, sd=sd), used


def _differ(apart: Fit, pairs: Sequence[int]) -> bool:
    """Tell whether the poles differ by more than chance: Hotelling's test on their differences."""
    from scipy.special import fdtrc

    names = [f"pole_{p}" for p in pairs]
    if any(name in apart.at_bound for name in names):
        return False
    at = [apart.names.index(name) for name in names]
    matrix = apart.covariance.matrix[np.ix_(at, at)]
    if not np.all(np.isfinite(matrix)):
        return False
    poles = np.array([apart.values[name] for name in names])
    contrast = np.eye(len(names))[1:] - np.eye(len(names))[0]
    spread = contrast @ matrix @ contrast.T
    off = contrast @ poles
    # Hotelling's T^2: the covariance itself rests on a few groups of windows.
    dof = apart.covariance.dof if np.isfinite(apart.covariance.dof) else 1e6
    left = dof - off.size + 1.0
    if left < 1.0:
        return False
    value = float(off @ np.linalg.solve(spread, off)) * left / (dof * off.size)
    return bool(fdtrc(off.size, left, value) < _DIFFER)
