"""Compliance of the ultrafiltrate side from how its pressure follows when the ultrafiltration is switched (rap.md, 5.4).

C_u dP_uf/dt = K_uf TMP - Q_uf with the mean of the blood side as measured: what the blood pump does meanwhile cancels.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.estimation.least_squares import Fit, Unknown, fit
from pipeline.estimation.uncertainty import newey_west
from pipeline.rigs.rap.pressures.levels import Level
from pipeline.rigs.rap.tables import Signal

TAU_RANGE = (0.1, 20.0)
# Seconds before and behind a switch that are looked at; the moment is free within so many seconds of where the level begins.
_BEFORE, _BEHIND, _FREE = 6.0, 14.0, 3.0
_START = 1.5
# From so many switches on their scatter tells the error; with fewer that of the noise is widened by what pulsation adds.
_SEVERAL, _UNSEEN = 3, 1.5
# A switch of which a larger share is left unexplained is something else.
_LEFT = 0.2
# Switches that change the pressure by less, in standard deviations of its noise, tell nothing.
_LEAST_STEP = 10.0


@dataclass(frozen=True, eq=False)
class UfStep:
    """One switch: `time` (n,) s, `measured` and `modelled` (n,) Pa of P_uf less what follows the blood side."""

    time: np.ndarray
    measured: np.ndarray
    modelled: np.ndarray


@dataclass(frozen=True, eq=False)
class UfSteps:
    """tau_u = C_u/K_uf (s), its standard error and degrees of freedom, the switches behind it."""

    tau: float
    sd: float
    dof: float
    steps: tuple[UfStep, ...]


def uf_steps(blood_side: Signal, uf: Signal, levels: Sequence[Level]) -> UfSteps | None:
    """Return tau_u from the switches between levels with different ultrafiltration; None where there is none.

    Parameters
    ----------
    blood_side
        Mean of pre-filter and return pressure, Pa.
    uf
        Pressure of the ultrafiltrate on the same clock, Pa.
    levels
        Stretches of the run on that clock.
    """
    pieces = []
    for before, level in pairwise(levels):
        known = before.uf_set is not None and level.uf_set is not None
        if not (before.steady and level.steady and level.turning and before.turning):
            continue
        if known and abs(float(level.uf_set or 0.0) - float(before.uf_set or 0.0)) < 1e-10:
            continue
        piece = _piece(blood_side, uf, level.begin)
        if piece is not None:
            pieces.append(piece)
    return _fitted(pieces) if pieces else None


@dataclass(frozen=True, eq=False)
class _Piece:
    """Samples about one switch: `time` (n,), `blood` and `uf` (n,) in Pa, with a lead-in in which the filter forgets."""

    time: np.ndarray
    blood: np.ndarray
    uf: np.ndarray
    used: np.ndarray
    begin: float


def _piece(blood_side: Signal, uf: Signal, begin: float) -> _Piece | None:
    lead = 15.0
    inside = (uf.time > begin - _BEFORE - lead) & (uf.time < begin + _BEHIND)
    time, values = uf.time[inside], uf.values[inside]
    if time.size < 40 or float(np.diff(time).max()) > 5.0 / uf.rate:
        return None
    used = time > begin - _BEFORE
    behind = time > begin + 8.0
    early = used & (time < begin - 2.5)
    if early.sum() < 10 or behind.sum() < 10:
        return None
    step = abs(float(values[behind].mean() - values[early].mean()))
    noise = float(np.std(np.diff(values[early]))) / np.sqrt(2.0)
    if step < _LEAST_STEP * noise / np.sqrt(early.sum()) or step < 100.0:
        return None
    return _Piece(time, np.interp(time, blood_side.time, blood_side.values), values, used, begin)


def followed(time: np.ndarray, values: np.ndarray, tau: float) -> np.ndarray:
    """Return a signal behind a pole `tau` (s), exact for straight lines between the samples, shape (n,); starts at its mean.

    Even stamps are taken: the median step.
    """
    from scipy.signal import lfilter

    h = float(np.median(np.diff(time)))
    a = np.exp(-h / tau)
    # y[k+1] = a y[k] + (1 - a) x[k] + (1 - tau/h (1 - a)) (x[k+1] - x[k])
    share = 1.0 - tau / h * (1.0 - a)
    start = float(values[: max(int(2.0 / h), 1)].mean())
    out, _ = lfilter([share, 1.0 - a - share], [1.0, -a], values, zi=[start - share * float(values[0])])
    return np.asarray(out)


def _fitted(pieces: Sequence[_Piece]) -> UfSteps | None:
    """Fit each switch by itself; their scatter is the error, that of the noise where there are fewer than three."""
    found = [(piece, _fit_one(piece)) for piece in pieces]
    found = [(piece, one) for piece, one in found if not one.at_bound and math.isfinite(one.std_error["tau"])]
    if not found:
        return None
    found = [(piece, one) for piece, one in found if one.std_error["tau"] > 0.0 and _explains(piece, one)]
    if not found:
        return None
    weight = np.array([1.0 / one.std_error["tau"] ** 2 for _, one in found])
    taus = np.array([one.values["tau"] for _, one in found])
    tau = float(weight @ taus / weight.sum())
    own = float(1.0 / np.sqrt(weight.sum()))
    many = len(found) >= _SEVERAL
    scatter = math.sqrt(float(weight @ (taus - tau) ** 2) / weight.sum() / (len(found) - 1)) if many else _UNSEEN * own
    steps = tuple(UfStep(piece.time[piece.used], *_parts(piece, one.values)) for piece, one in found)
    dof = len(found) - 1.0 if many and scatter > own else found[0][1].covariance.dof
    return UfSteps(tau, max(scatter, own), dof, steps)


def _explains(piece: _Piece, one: Fit) -> bool:
    """Tell whether a first-order step is what the pressure does: little of its scatter is left."""
    alone, model = _parts(piece, one.values)
    return float(np.var(alone - model)) < _LEFT * float(np.var(alone))


def _parts(piece: _Piece, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return what is left of P_uf without what follows the blood side, and the model of that, Pa, shape (n,) each."""
    alone = (piece.uf - followed(piece.time, piece.blood, values["tau"]))[piece.used]
    since = np.maximum(piece.time[piece.used] - values["at"], 0.0)
    columns = np.stack([np.ones_like(since), 1.0 - np.exp(-since / values["tau"])], axis=-1)
    return alone, np.asarray(columns @ np.linalg.lstsq(columns, alone, rcond=None)[0])


def _fit_one(piece: _Piece) -> Fit:
    def residual(values: Mapping[str, float]) -> np.ndarray:
        alone, model = _parts(piece, values)
        return np.asarray(alone - model)

    # The moment lies on a kink of the model: a scan by quarter seconds comes before the descent.
    moments = piece.begin + np.arange(-_FREE + 0.2, _FREE, 0.25)
    costs = [float((residual({"tau": _START, "at": float(moment)}) ** 2).sum()) for moment in moments]
    start = float(moments[int(np.argmin(costs))])
    unknowns = [
        Unknown("tau", _START, *TAU_RANGE, "s", logarithmic=True),
        Unknown("at", start, piece.begin - _FREE, piece.begin + _FREE, "s"),
    ]
    found = fit(residual, unknowns)
    return found.with_covariance(newey_west(found.jacobian, found.residual))
