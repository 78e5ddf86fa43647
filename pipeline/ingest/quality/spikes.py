"""Isolated samples far off their neighbours: spikes of electronics and transmission, not of mechanics."""

from __future__ import annotations

import numpy as np

from pipeline.ingest.quality.window import Window

# Steps are screened in groups of this many; a spike's step stands out from the mean of its group.
_GROUP = 64
_STANDS_OUT = 7.0
# A spike is at most this many samples wide, and stands on this many calm ones on either side.
_WIDEST = 3
_CALM = 24
# Height over the largest step around it (and over the resolution), and over the range of the channel.
_OVER_STEPS = 8.0
_OVER_RANGE = 0.01
# Rows at the end of a block that are judged with the next one.
_MARGIN = 32


class Spikes:
    """Accumulates number, place and height of the spikes of one channel, block by block."""

    def __init__(self) -> None:
        self.count = 0
        self.n = 0
        self.first = float("nan")
        self.largest = 0.0
        self.at_largest = float("nan")
        self._range = (np.inf, -np.inf)

    def add(self, window: Window, lowest: float, highest: float, last: bool = False) -> None:
        """Take the next window; `lowest` and `highest` are the channel's values so far."""
        self.n += window.values.size - window.old
        sizes = window.sizes
        if sizes.size < 4:
            return
        # Rows of the margin of the block before were left to this one.
        begin = max(window.old - 1 - _MARGIN, 0)
        end = sizes.size if last else sizes.size - _MARGIN
        full = sizes.size // _GROUP * _GROUP
        groups = sizes[:full].reshape(-1, _GROUP)
        tallest = np.append(groups.max(axis=1), sizes[full:].max(initial=0.0))
        total = np.append(groups.sum(axis=1), sizes[full:].sum())
        count = np.append(np.full(len(groups), _GROUP), max(sizes.size - full, 1))
        least = _OVER_RANGE * (highest - lowest)
        # Two steps of a spike alone raise the mean of a short group: they are taken off first.
        calm = np.maximum(total - 2.0 * tallest, 0.0) / np.maximum(count - 2, 1)
        hot = np.flatnonzero((tallest > _STANDS_OUT * calm) & (tallest > least))
        if not hot.size:
            return
        resolution = float(sizes[sizes > 0].min())
        hot = hot[tallest[hot] >= _OVER_STEPS * resolution]
        if hot.size > max(0.1 * tallest.size, 4):
            return
        done = -1
        for group in hot.tolist():
            steps = sizes[group * _GROUP : (group + 1) * _GROUP]
            for at in (np.flatnonzero(steps > 0.4 * steps.max()) + group * _GROUP).tolist():
                if at <= done or not begin <= at < end:
                    continue
                width = _width(window, at, resolution)
                if width:
                    self._take(window, at, width, least)
                    done = at + width

    def _take(self, window: Window, at: int, width: int, least: float) -> None:
        height = float(np.abs(window.values[at + 1 : at + 1 + width] - window.values[at]).max())
        if height < least:
            return
        moment = window.moment(at + 1)
        if self.count == 0:
            self.first = moment
        self.count += 1
        if height > self.largest:
            self.largest, self.at_largest = height, moment

    @property
    def isolated(self) -> bool:
        """Tell whether there are spikes, and so few that they are not what the signal is made of."""
        return 0 < self.count <= max(5e-3 * self.n, 3)


def _width(window: Window, at: int, resolution: float) -> int:
    """Return how many samples after row `at` are a spike; 0 where the step there is something else."""
    steps, sizes = window.steps, window.sizes
    for width in range(1, _WIDEST + 1):
        back = at + width
        if back >= steps.size or steps[at] * steps[back] >= 0 or not 0.5 < sizes[back] / sizes[at] < 2.0:
            continue
        around = np.concatenate((sizes[max(at - _CALM, 0) : at], sizes[back + 1 : back + 1 + _CALM]))
        if around.size < _CALM // 2:
            return 0
        height = min(sizes[at], sizes[back])
        shift = abs(float(window.values[back + 1] - window.values[at]))
        calm = max(float(around.max()), resolution)
        if height >= _OVER_STEPS * calm and shift <= 0.3 * height:
            return width
    return 0
