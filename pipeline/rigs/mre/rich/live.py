"""The joint filter while a log comes in, as `rigfit run --live` shows it: parameters with their band, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.rigs.mre.rich.declaration import RichSettings
from pipeline.rigs.mre.rich.online import Online
from pipeline.rigs.mre.rich.online_verdict import CONVERGED, judge_online
from pipeline.rigs.mre.shear.samples import number_of

# What is shown: name, unit, how many of it one SI unit is.
_SHOWN = (
    ("k1", "N/mm", 1e-3),
    ("s1", "N s/m", 1.0),
    ("k2", "N/mm", 1e-3),
    ("alpha_bw", "N", 1.0),
    ("rho", "1/mm", 1e-3),
    ("c_bw", "", 1.0),
    ("n_bw", "", 1.0),
)
# While the log comes in there is no batch fit to hold the filter against, and a chirp may yet bring what it lacks.
_SO_FAR = {CONVERGED: "steady so far"}
_WIDTH = 15
_FIELD = 0.25  # A, from which on the field may add viscous damping


class Live:
    """Follows one record; see `pipeline.rigs.experiment.Follower`."""

    def __init__(self, recording: Recording, settings: RichSettings) -> None:
        """Look at what the record says of itself; its samples come through `feed`.

        Raises
        ------
        InputError
            If displacement and force have clocks of their own.
        """
        if recording.stream_of("displacement") is not recording.stream_of("force"):
            raise InputError(
                f"run '{recording.run}': displacement and force have clocks of their own; --live needs both at the same "
                "times. Without --live they are brought together first."
            )
        stream = recording.stream_of("force")
        current = ("current",) if "current" in stream.channels else ()
        self.channels: Sequence[str] = ("displacement", "force", *current)
        lag = settings.force_lag if settings.force_lag != "fit" else number_of(recording, "force_lag")
        label = number_of(recording, "coil_current")
        self.run = recording.run
        self._mass = (
            settings.moving_mass if isinstance(settings.moving_mass, float) else number_of(recording, "moving_mass")
        )
        self._label, self._lag, self._cutoff = label, lag, settings.online_cutoff
        self.online: Online | None = None
        self._until = self._said = 0.0

    def heading(self) -> Sequence[str]:
        """Return the lines above the table."""
        said = [
            f"run {self.run}: joint Kalman filter (its band of 95 % is its own claim; the batch fit at the end is what counts)"
        ]
        if self._mass:
            said.append(f"the moving mass of {self._mass:g} kg is not taken out here, only in the result")
        names = "".join(f"{f'{name} [{unit}]' if unit else name:>{_WIDTH}}" for name, unit, _ in _SHOWN)
        return [*said, f"{'t [s]':>7}{names}  verdict"]

    def feed(self, time: np.ndarray, values: Sequence[np.ndarray]) -> None:
        """Take the next samples."""
        if self.online is None:
            current = self._label
            if len(values) > 2 and np.isfinite(values[2]).any():
                current = float(np.nanmean(values[2]))
            self.online = Online(viscous=abs(current or 0.0) > _FIELD, force_lag=self._lag, cutoff=self._cutoff)
        self._until = float(time[-1])
        self.online.feed(time, values[0], values[1])

    def say(self) -> str:
        """Return time, parameters with half their band, and the verdict so far."""
        self._said = self._until
        if self.online is None or not self.online.history.time.size:
            return f"{self._until:7.1f}  collecting the first seconds of motion"
        middle, high = (self.online.history.band(width) for width in (0.0, 1.96))
        cells = ""
        for name, _, factor in _SHOWN:
            value, half = factor * middle[name][-1], factor * (high[name][-1] - middle[name][-1])
            cells += f"{_number(value, half):>{_WIDTH}}"
        word = judge_online(self.online).word
        return f"{self._until:7.1f}{cells}  {_SO_FAR.get(word, word)}"

    def finish(self) -> Sequence[str]:
        """Return the verdict on the whole record."""
        if self.online is None:
            return ["no sample came"]
        self.online.finish()
        verdict = judge_online(self.online)
        late = (
            f"; the steps lag {1e3 * self.online.ahead.delay:.0f} ms behind the log"
            if self.online.ahead.started
            else ""
        )
        last = [self.say()] if self._until > self._said else []
        return [*last, f"{verdict.word}: {verdict.reason}{late}"]


def _number(value: float, half: float) -> str:
    digits = int(np.clip(2 - np.floor(np.log10(max(abs(half), 1e-9 * abs(value), 1e-300))) - 1, 0, 4))
    return f"{value:.{digits}f}+-{half:.{digits}f}"
