"""One log of a compression loop -> samples fit to use, or why they are not (mre.md section 8).

Looks at samples only: units, signs, dead, stuck and clipped channels, wild samples. What the loop tells is
`run_fit`'s business.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import counted
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.axial.gauge import step_of
from pipeline.rigs.mre.pads import Pads

_FEWEST = 16
_LARGEST_DISPLACEMENT, _LARGEST_FORCE = 0.02, 1e5
# A wild sample is this many sigma and this share of the range off the median of its neighbours.
_WILD_SIGMA, _WILD_SHARE, _WILD_WINDOW = 10.0, 0.03, 2
# Flat top: so many samples in a row within this share of the range of the extreme, over this share of the stroke.
_FLAT_SAMPLES, _FLAT_SHARE, _FLAT_STROKE = 5, 5e-4, 0.03
_MOST_FLAT = 0.5
_STUCK_FORCE = 0.25

Say = Callable[[QualityFinding], None]


class UnfitError(Exception):
    """The run cannot be used: the reason, and the channel that it lies in."""

    def __init__(self, reason: str, channel: str | None = None) -> None:
        super().__init__(reason)
        self.channel = channel


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of one run: gauge times (s) and readings (m), force times and force (N)."""

    run: str
    gauge_time: np.ndarray
    x: np.ndarray
    time: np.ndarray
    F: np.ndarray

    def between(self, start: float, end: float) -> Samples:
        """Return what lies between two times, s."""
        g, f = (self.gauge_time >= start) & (self.gauge_time <= end), (self.time >= start) & (self.time <= end)
        return replace(self, gauge_time=self.gauge_time[g], x=self.x[g], time=self.time[f], F=self.F[f])

    def reading_at_force(self) -> np.ndarray:
        """Return the gauge's reading at the times of the force, m."""
        return np.asarray(np.interp(self.time, self.gauge_time, self.x))


def samples_of(recording: Recording, say: Say) -> Samples:
    """Return the samples of a log; what is mended is said.

    Raises
    ------
    UnfitError
        If a channel is dead, clipped for long, in the wrong unit or of the wrong sign, or too little is left.
    """
    run = recording.run
    test = recording.conditions.get("test")
    if isinstance(test, str) and test and test != "axial_loop":
        raise UnfitError(f"it is a test '{test}', not an axial_loop")
    gauge_time, x = recording.signal("displacement_axial")
    time, F = recording.signal("force_axial")
    for name, values in (("displacement_axial", x), ("force_axial", F)):
        lost = int(np.count_nonzero(~np.isfinite(values)))
        if values.size - lost < _FEWEST:
            raise UnfitError(
                f"{name} has only {counted(values.size - lost, 'sample')}, at least {_FEWEST} are needed", name
            )
        if lost > 1e-3 * values.size:
            say(
                QualityFinding(
                    "warning", f"{name} has no value in {counted(lost, 'sample')}; they are left out.", run, name
                )
            )
    g, f = np.isfinite(x), np.isfinite(F)
    gauge_time, x, time, F = gauge_time[g], x[g], time[f], F[f]
    inside = (time >= gauge_time[0]) & (time <= gauge_time[-1])
    time, F = time[inside], F[inside]
    if F.size < _FEWEST:
        raise UnfitError("force and displacement were not logged at the same time")
    samples = _one_sign(Samples(run, gauge_time, x, time, F), say)
    _refuse_units(samples, recording)
    samples = _without_wild(samples, say)
    _refuse_stuck_gauge(samples)
    return _without_flat_top(samples, say)


def noise_of(F: np.ndarray) -> float:
    """Return the noise of a slow force from sample to sample, N."""
    return float(np.median(np.abs(np.diff(F, 2)))) / 0.6745 / math.sqrt(6)


def pads_of(recording: Recording) -> Pads | None:
    """Return the pads where their size is given; one unless `n_pads` says otherwise."""
    size = [recording.conditions.get(name) for name in ("pad_diameter", "pad_height")]
    if not all(isinstance(value, float | int) and value > 0 for value in size):
        return None
    return Pads(float(size[0] or 0), float(size[1] or 0), recording.condition("n_pads", 1.0))


def _one_sign(samples: Samples, say: Say) -> Samples:
    x, F = samples.x, samples.F
    if not np.ptp(x) > 0 or not np.ptp(F) > 0:
        name = "force_axial" if np.ptp(x) > 0 else "displacement_axial"
        raise UnfitError(f"{name} is the same in every sample: a dead channel", name)
    reading = samples.reading_at_force()
    if np.ptp(reading) == 0:
        raise UnfitError("displacement_axial does not change while the force is logged", "displacement_axial")
    correlation = float(np.corrcoef(reading, F)[0, 1])
    if correlation < -0.3:
        raise UnfitError(
            f"force falls as compression rises (correlation {correlation:.2f}): one of them has the wrong sign, or they "
            "are swapped with another channel; mend it in the recipe with 'sign: -1'",
            "force_axial",
        )
    if correlation < 0.3:
        raise UnfitError(f"force does not follow the displacement (correlation {correlation:.2f})", "force_axial")
    turned = -float(x.min()) > 2 * float(x.max()) and -float(F.min()) > 2 * float(F.max())
    if turned and x[0] > 0.5 * x.min():
        message = "displacement and force go below zero together: taken as compression, both with the sign turned."
        say(QualityFinding("warning", message, samples.run))
        return replace(samples, x=-x, F=-F)
    return samples


def _refuse_units(samples: Samples, recording: Recording) -> None:
    reach, force = float(np.abs(samples.x).max()), float(np.abs(samples.F).max())
    if reach > _LARGEST_DISPLACEMENT:
        guess = (
            "the channels look swapped"
            if force < _LARGEST_DISPLACEMENT
            else "displacement looks like mm (or um) taken as m"
        )
        raise UnfitError(
            f"displacement_axial reaches {reach:.4g} m: {guess}; mend names or units in the recipe",
            "displacement_axial",
        )
    if force > _LARGEST_FORCE:
        raise UnfitError(
            f"force_axial reaches {force:.4g} N: it looks like N taken as kN; mend the unit in the recipe",
            "force_axial",
        )
    pads = pads_of(recording)
    if pads is None:
        return
    travel = float(np.ptp(samples.x))
    if travel > pads.height:
        raise UnfitError(
            f"the pad is compressed by {1e3 * travel:.4g} mm but is only {1e3 * pads.height:.4g} mm high: check the units of displacement and pad",
            "displacement_axial",
        )
    modulus = float(np.ptp(samples.F)) / travel * pads.modulus_per_stiffness
    if not 0.02e6 <= modulus <= 200e6:
        looks = (
            "force looks like kN taken as N, or displacement is too large"
            if modulus < 1e6
            else "force or displacement is off by a factor"
        )
        raise UnfitError(
            f"the loop means a Young's modulus of about {modulus / 1e6:.3g} MPa, no elastomer's: {looks}; check the units of force, displacement and pad size",
            "force_axial",
        )


def _without_wild(samples: Samples, say: Say) -> Samples:
    """Leave out lone samples of the force that stand off their neighbours."""
    F = samples.F
    if F.size < 4 * _WILD_WINDOW:
        return samples
    padded = np.pad(F, _WILD_WINDOW, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _WILD_WINDOW + 1)
    off = np.abs(F - np.median(windows, axis=1))
    sigma = float(np.median(np.abs(np.diff(F, 2)))) / 0.6745 / math.sqrt(6)
    step = 6 * float(np.median(np.abs(np.diff(F))))
    wild = off > max(step, _WILD_SIGMA * sigma, _WILD_SHARE * float(np.ptp(F[off < np.quantile(off, 0.99) + 1e-300])))
    if not wild.any() or wild.mean() > 0.05:
        return samples
    at = float(samples.time[np.flatnonzero(wild)[0]])
    message = f"force_axial has {counted(int(wild.sum()), 'wild sample')}, the first at {at:.6g} s; left out."
    say(QualityFinding("warning", message, samples.run, "force_axial", (at, at)))
    return replace(samples, time=samples.time[~wild], F=F[~wild])


def _refuse_stuck_gauge(samples: Samples) -> None:
    """Refuse a gauge that stands still while the force goes on."""
    x, step = samples.reading_at_force(), step_of(samples.x)
    same = np.abs(np.diff(x)) <= 1e-3 * max(step, 1e-9)
    edges = np.flatnonzero(np.diff(np.r_[False, same, False].astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        part = samples.F[first : last + 1]
        if part.size < 4:
            continue
        # The force of a turn rises and falls: what counts is how far it is when the gauge moves again.
        gone = abs(float(np.mean(part[-2:]) - np.mean(part[:2])))
        back = float(np.ptp(part)) - gone
        expected = float(np.ptp(samples.F)) / float(np.ptp(x)) * step
        if (
            gone + (back if _outside_turn(x, first, last) else 0.0)
            > _STUCK_FORCE * float(np.ptp(samples.F)) + 2 * expected
        ):
            span = (float(samples.time[first]), float(samples.time[last]))
            raise UnfitError(
                f"displacement_axial stands at {1e3 * float(x[first]):.4g} mm from {span[0]:.6g} to {span[1]:.6g} s while the force changes by "
                f"{float(np.ptp(part)):.4g} N: the gauge was stuck or at its end",
                "displacement_axial",
            )


def _outside_turn(x: np.ndarray, first: int, last: int) -> bool:
    before, after = x[max(first - 1, 0)], x[min(last + 1, x.size - 1)]
    return not (before < x[first] > after)


def _without_flat_top(samples: Samples, say: Say) -> Samples:
    """Leave out samples of a clipped force.

    Raises
    ------
    UnfitError
        If most of the loop is clipped.
    """
    F, x = samples.F, samples.reading_at_force()
    top = float(F.max()) - F <= _FLAT_SHARE * float(np.ptp(F))
    moved = float(np.ptp(x[top])) if top.any() else 0.0
    if int(top.sum()) < _FLAT_SAMPLES or moved < _FLAT_STROKE * float(np.ptp(x)):
        return samples
    share = float(top.mean())
    if share > _MOST_FLAT:
        raise UnfitError(
            f"force_axial is clipped at {float(F.max()):.4g} N in {100 * share:.0f} % of the samples", "force_axial"
        )
    span = (float(samples.time[top][0]), float(samples.time[top][-1]))
    message = (
        f"force_axial is clipped at {float(F.max()):.4g} N while the displacement goes on by {1e3 * moved:.3g} mm; these samples are left "
        "out, so that the force at the turn is what the model makes of it."
    )
    say(QualityFinding("warning", message, samples.run, "force_axial", span))
    return replace(samples, time=samples.time[~top], F=F[~top])
