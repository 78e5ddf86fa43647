"""`rigfit run --live`: play recordings through an experiment's online method and show what it knows, line by line.

One line a second of the log, in the order of the runs, on a terminal or anywhere else.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Iterator, Sequence

import click
import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.rigs.experiment import Experiment, Follower
from pipeline.rigs.registry import all_experiments

# Seconds of the log that are handed over at once, and between two lines.
_PIECE, _LINE = 0.1, 1.0


def must_follow(experiment: Experiment) -> None:
    """Raise InputError where an experiment has nothing to show live; names those that have."""
    if experiment.live is None:
        able = ", ".join(one.id for one in all_experiments().values() if one.live is not None)
        raise InputError(
            f"{experiment.id} has no online method to show with --live; {able or 'no experiment'} has. Leave --live away."
        )


def play(experiment: Experiment, settings: object, recordings: Sequence[Recording], speed: float) -> None:
    """Feed every recording to the online method as it was logged, `speed` times as fast (inf: at once)."""
    must_follow(experiment)
    assert experiment.live is not None
    if not speed > 0:
        raise InputError(f"--speed is {speed:g}: a number above 0 is expected, 1 for as fast as it was logged.")
    for recording in recordings:
        try:
            if experiment.check is not None:
                experiment.check(recording)
            follower = experiment.live(recording, settings)
        except InputError as error:
            click.echo(f"run {recording.run} is not shown: {error}")
            continue
        for line in follower.heading():
            click.echo(line)
        _play_one(follower, recording, speed)


def _play_one(follower: Follower, recording: Recording, speed: float) -> None:
    begun, first, due = clock.monotonic(), math.nan, math.inf
    for time, values in _pieces(recording, follower.channels):
        if math.isnan(first):
            first, due = float(time[0]), float(time[0]) + _LINE
        wait = (float(time[-1]) - first) / speed - (clock.monotonic() - begun)
        if wait > 0:
            clock.sleep(wait)
        follower.feed(time, values)
        if time[-1] > due - 0.1 * _PIECE:
            due += _LINE
            click.echo(follower.say())
    for line in follower.finish():
        click.echo(line)


def _pieces(recording: Recording, channels: Sequence[str]) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
    """Yield the stream piece by piece, as it would come in: blocks of the file, cut into tenths of a second."""
    for time, values in recording.stream_of(channels[0]).blocks(channels):
        if not time.size:
            continue
        edges = np.unique(np.searchsorted(time, np.arange(time[0] + _PIECE, time[-1], _PIECE)))
        for piece in np.split(np.arange(time.size), edges):
            if piece.size:
                yield time[piece], [channel[piece] for channel in values]
