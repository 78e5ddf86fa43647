"""Compliance and inertance of the return line from the return pressure's lines over the pre-filter's (rap.md, eq. 4).

Both are read by one clock; the pump's waveform and what lies before the filter cancel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.least_squares import Fit, Unknown, fit
from pipeline.estimation.uncertainty import Covariance, clustered
from pipeline.rigs.rap.alignment.fine import WEIGHTED
from pipeline.rigs.rap.alignment.strokes import follow, lines
from pipeline.rigs.rap.circuit.hydraulics import Circuit, filter_transfer
from pipeline.rigs.rap.pressures.levels import Level
from pipeline.rigs.rap.pulsation.windows import Windows, cut, joined
from pipeline.rigs.rap.tables import Signal

_WINDOW, _ORDERS = 15.0, 3
_LEAST_LINE, _STRAY = 10.0, 5.0
_FEWEST, _FEWEST_WINDOWS = 6, 4
_GROUPS = 40
C_2_RANGE, L_R_RANGE = (1e-12, 5e-10), (1e6, 1e9)


@dataclass(frozen=True, eq=False)
class Ratios:
    """P_ret / P_pre at the pump's lines, shape (r,): `frequency` (Hz) of the line, its `order`, window number, `ratio`, `sd`, `used`."""

    frequency: np.ndarray
    order: np.ndarray
    window: np.ndarray
    ratio: np.ndarray
    sd: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, eq=False)
class ReturnLine:
    """The fit of `C_2` and `L_r`, how both move with each of R_f, R_r, K_uf, C_u (relative over relative), and the ratios."""

    fit: Fit
    sensitivity: Mapping[str, np.ndarray]
    ratios: Ratios


def ratios_of(prefilter: Signal, back: Signal, levels: Sequence[Level], poles: tuple[float, float]) -> Ratios | None:
    """Return the ratios return over pre-filter in steady windows; None where too few lines stand out.

    `poles` (s) are those of the two sensors; only their difference counts.
    """
    turning = [level for level in levels if level.steady and level.turning]
    windows = joined([_filled(level) for level in turning])
    if windows.size < _FEWEST_WINDOWS:
        return None
    strokes = follow(prefilter.time, prefilter.values, windows)
    pre, ret = (lines(one.time, one.values, strokes) for one in (prefilter, back))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = (ret.amplitude / pre.amplitude)[:, :_ORDERS]
        sd = (np.hypot(ret.error, np.abs(ret.amplitude / pre.amplitude) * pre.error) / np.abs(pre.amplitude))[
            :, :_ORDERS
        ]
        good = np.isfinite(ratio) & (np.abs(pre.amplitude) > _LEAST_LINE * pre.error)[:, :_ORDERS]
        good &= (np.abs(ret.amplitude) > 3.0 * ret.error)[:, :_ORDERS]
    window, k = np.nonzero(good)
    if window.size < _FEWEST or np.unique(window).size < _FEWEST_WINDOWS:
        return None
    frequency = (k + 1.0) * strokes.frequency[window]
    omega = 2.0 * np.pi * frequency
    seen = (1.0 + 1j * omega * poles[0]) / (1.0 + 1j * omega * poles[1])
    return Ratios(frequency, k + 1, window, ratio[good] / seen, sd[good], np.ones(window.size, dtype=bool))


def _filled(level: Level) -> Windows:
    """Return windows of about 15 s that fill a level."""
    length = level.end - level.start
    return cut(level.start, level.end, length / max(round(length / _WINDOW), 1))


def fit_return_line(ratios: Ratios, circuit: Circuit) -> ReturnLine:
    """Fit C_2 and L_r to the ratios, everything else as in `circuit`."""
    sd, used = ratios.sd.copy(), ratios.used
    found = _fitted(ratios, sd, used, circuit, (3e-11, 5e7))
    for _ in range(2):
        off = np.abs(_model(found.values, circuit, ratios) - ratios.ratio)
        for k in np.unique(ratios.order):
            same = ratios.order == k
            if same.sum() >= _FEWEST:
                # Median of a Rayleigh-distributed modulus: 1.1774 standard deviations of one part.
                sd[same] = ratios.sd[same] * max(float(np.median(off[same] / ratios.sd[same])) / 1.1774, 0.05)
        used = off < _STRAY * np.sqrt(2.0) * sd
        found = _fitted(ratios, sd, used, circuit, (found.values["C_2"], found.values["L_r"]))
    at = (found.values["C_2"], found.values["L_r"])
    sensitivity = {}
    for name in ("R_f", "R_r", "K_uf", "C_u"):
        moved = _fitted(ratios, sd, used, _changed(circuit, name, 1e-3), at)
        sensitivity[name] = np.array(
            [np.log(moved.values[p] / v) / np.log(1.001) for p, v in zip(("C_2", "L_r"), at, strict=True)]
        )
    return ReturnLine(found, sensitivity, Ratios(ratios.frequency, ratios.order, ratios.window, ratios.ratio, sd, used))


def _changed(circuit: Circuit, name: str, share: float) -> Circuit:
    return replace(circuit, **{name: getattr(circuit, name) * (1.0 + share)})


def _model(values: Mapping[str, float], circuit: Circuit, ratios: Ratios) -> np.ndarray:
    whole = replace(circuit, C_2=values["C_2"], L_r=values["L_r"])
    return np.asarray(filter_transfer(whole, 2j * np.pi * ratios.frequency))


def _fitted(ratios: Ratios, sd: np.ndarray, used: np.ndarray, circuit: Circuit, start: tuple[float, float]) -> Fit:
    unknowns = [
        Unknown("C_2", start[0], *C_2_RANGE, "m^3/Pa", logarithmic=True),
        Unknown("L_r", start[1], *L_R_RANGE, "Pa s^2/m^3", logarithmic=True),
    ]

    def residual(values: Mapping[str, float]) -> np.ndarray:
        off = ((_model(values, circuit, ratios) - ratios.ratio) / sd)[used]
        return np.concatenate([off.real, off.imag])

    found = fit(residual, unknowns)
    number = np.unique(ratios.window[used], return_inverse=True)[1]
    groups = number // max(int(np.ceil((number.max() + 1) / _GROUPS)), 1)
    if groups.max() < 4 or found.at_bound:
        return found
    spread = clustered(found.jacobian, found.residual, np.concatenate([groups, groups]))
    return found.with_covariance(Covariance(WEIGHTED**2 * spread.matrix, spread.dof, spread.method))
