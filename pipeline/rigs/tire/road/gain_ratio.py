"""The gain of the flex sensor as the film tells it, revolution by revolution: what debonding is judged on.

One sensor cannot tell gain from load, two of different kind can.
"""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tire.road.gauss_newton import LEAST_LOAD, State
from pipeline.rigs.tire.road.library import WaveformLibrary
from pipeline.rigs.tire.road.passage_voltage import ANGLES, Passages, on_bins

_LOAD_NODES, _SPEED_NODES = 60, 9


def gain_ratio(data: Passages, state: State, known: WaveformLibrary) -> np.ndarray:
    """Return the flex sensor's gain by the film's load, shape (m,).

    The film's waveform over the one that Fz and Fx of the flex sensor predict for it tells the film's own load; the gain
    is what the flex sensor shows over what it ought to show there.
    """
    if data.film is None:
        return np.full(data.time.size, np.nan)
    fine = data.weight.shape[2] * ANGLES
    H = known.harmonics(state.load, state.force, data.speed)[0] * known.film_factor(data.speed)
    expected = on_bins(H * np.exp(1j * known.orders * state.shift[:, None]), ANGLES, np.pi / ANGLES - np.pi / fine)
    seen = (~data.missing).astype(float)
    n = np.maximum(seen.sum(axis=1, keepdims=True), 1.0)
    expected = seen * (expected - (seen * expected).sum(axis=1, keepdims=True) / n)
    with np.errstate(divide="ignore", invalid="ignore"):
        amplitude = (expected * data.film).sum(axis=1) / (expected**2).sum(axis=1)
    ratio = np.full(data.time.size, np.nan)
    told = data.usable & np.isfinite(amplitude) & (amplitude > 0.0)
    if not told.any():
        return ratio
    loads = np.geomspace(LEAST_LOAD, known.top, _LOAD_NODES)
    speeds = np.geomspace(data.speed[told].min(), data.speed[told].max() * (1.0 + 1e-9), _SPEED_NODES)
    nearest = np.argmin(np.abs(np.log(data.speed[:, None] / speeds)), axis=1)
    for i, speed in enumerate(speeds):
        rows = np.flatnonzero(told & (nearest == i))
        turned = np.full(loads.size, speed)
        flex = known.harmonics(loads, np.zeros(loads.size), turned)[0][:, 1:]
        film = np.log(np.linalg.norm(flex * known.film_factor(turned)[:, 1:], axis=1))
        flex_size, x = np.log(np.linalg.norm(flex, axis=1)), np.log(loads)
        by_flex = np.log(state.load[rows])
        by_film = np.interp(np.interp(by_flex, x, film) + np.log(amplitude[rows]), np.maximum.accumulate(film), x)
        ratio[rows] = np.exp(np.interp(by_flex, x, flex_size) - np.interp(by_film, x, flex_size))
    return ratio
