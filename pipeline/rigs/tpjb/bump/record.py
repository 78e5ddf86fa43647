"""One bump log -> samples of force and displacement in x and y, faulty probes and spans left out.

What makes a whole log unusable raises `UnusableError` with the reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError, counted, listing
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tpjb.axes import xy
from pipeline.rigs.tpjb.bump.levels import Rotation, Samples, rotation_of
from pipeline.rigs.tpjb.bump.spans import culprit, held_still, pair_sum, spans_of
from pipeline.rigs.tpjb.probe_faults import ProbeFaults, covariance_of, probe_faults
from pipeline.rigs.tpjb.probes import GAPS, Probes, opposite, probes_of

_FEWEST = 60
_MOST = 200_000
# Share of the directions that the force must have gone through to have turned at all.
_LEAST_COVERAGE = 0.3
_MOST_LOST = 0.5
# Share of the time during which the force must turn.
_STEADY = 0.4
# Share of the whole that a covariance of displacement and force must have, or not have, to mean something.
_CLEAR = 0.3


class UnusableError(Exception):
    """A log from which nothing can be identified; the text is the reason."""


@dataclass(frozen=True, eq=False)
class Record:
    """A usable log: samples in x and y, how they came from the probes, how the force turns, what was odd."""

    recording: Recording
    samples: Samples
    probes: Probes
    rotation: Rotation
    findings: tuple[QualityFinding, ...]


def record_of(recording: Recording) -> Record:
    """Return the samples of a bump log.

    Raises
    ------
    UnusableError
        If the force does not turn, the axes contradict it, or too little is left.
    InputError
        If u or v has no probe, or z1 and z2 cannot be.
    """
    run = recording.run
    time, gaps, force, names = _signals(recording)
    findings: list[QualityFinding] = []
    lost = np.zeros(time.size, dtype=bool)
    rotation = rotation_of(Samples(run, time, np.nan_to_num(xy(*force).T), {}))
    _refuse_static(rotation)
    _refuse_unsteady(rotation)
    # A turning force never stands still for longer than a fiftieth of a turn.
    least = max(20, round(0.02 / abs(rotation.frequency) / float(np.median(np.diff(time)))))
    for name, values, other in (("force_u", *force), ("force_v", *force[::-1])):
        still = held_still(values, least)
        for start, stop in spans_of(still, join=0):  # where both stand still the force only pauses
            still[start:stop] = np.ptp(other[start:stop]) > 0.1 * rotation.largest
        if still.any():
            findings += _spans(still, time, name, run, f"stands still at {values[still][0]:.4g} N: clipped or stuck")
            lost |= still
    faults = _faults(names, gaps[:, ~lost], force[:, ~lost], run)
    findings += faults.findings
    for first, second in _pairs(names, faults.excluded):
        lost |= _mend(gaps, names, first, second, time, run, findings)
    if lost.mean() > _MOST_LOST:
        raise UnusableError(
            f"{100 * lost.mean():.0f} % of the log are clipped, stuck or contradictory: {findings[-1].message}"
        )
    probes = probes_of(names, recording.conditions, faults.excluded, run)
    rows = [names.index(name) for name in probes.names]
    if not probes.planes:
        raise UnusableError(f"no probe plane measures both u and v; there are {listing(probes.names)}")
    planes = {p: (m @ gaps[rows]).T for p, m in probes.planes.items()}
    kept = ~lost & np.isfinite(force).all(axis=0)
    _refuse_wrong_axes(planes, xy(*force).T, kept)
    samples = Samples(run, time, np.where(kept[:, None], xy(*force).T, np.nan), planes)
    return Record(recording, samples, probes, rotation, (*findings, *probes.findings))


def _signals(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[str, ...]]:
    """Return time (n,), gaps (k, n), forces along u and v (2, n) on the time of the forces, and the gaps' names.

    A log of more samples than a slow test can use is averaged, channel by channel, to `_MOST` or fewer.
    """
    stream = recording.stream_of("force_u")
    names = tuple(name for name in GAPS if name in recording)
    if not names:
        raise InputError(
            f"run '{recording.run}' has no gap channel; expected some of {listing(GAPS)}. Map them in the recipe."
        )
    if stream.time.size < _FEWEST:
        raise UnusableError(f"{stream.time.size} samples, at least {_FEWEST} are needed")
    several = max(1, stream.time.size // _MOST)
    time = _averaged(stream.time, several)

    def on_time(name: str) -> np.ndarray:
        own = recording.stream_of(name)
        values = _averaged(np.asarray(own.channels[name].values), several if own is stream else 1)
        return values if own is stream else np.asarray(np.interp(time, own.time, values, np.nan, np.nan))

    return time, np.stack([on_time(n) for n in names]), np.stack([on_time("force_u"), on_time("force_v")]), names


def _averaged(values: np.ndarray, several: int) -> np.ndarray:
    """Return means over so many samples, shape (n // several,)."""
    n = values.size // several
    return np.asarray(values[: n * several].reshape(n, several).mean(axis=1), dtype=float)


def _refuse_static(rotation: Rotation) -> None:
    if not rotation.largest > 0:
        raise UnusableError("there is no force: force_u and force_v are zero all along")
    if rotation.coverage < _LEAST_COVERAGE or rotation.frequency == 0:
        raise UnusableError(
            f"the force vector does not turn: it goes through {100 * rotation.coverage:.0f} % of the directions only. A "
            "bump test needs force_u and force_v 90 deg apart, a full turn at least; clearance and centre cannot be told"
        )


def _refuse_unsteady(rotation: Rotation) -> None:
    if rotation.steadiness < _STEADY:
        raise UnusableError(
            "the force vector does not turn steadily: its direction jumps or wanders. A bump test needs force_u and force_v "
            "90 deg apart, slowly turning"
        )


def _faults(names: tuple[str, ...], gaps: np.ndarray, force: np.ndarray, run: str) -> ProbeFaults:
    sound = np.isfinite(gaps).all(axis=0) & np.isfinite(force).all(axis=0)
    sound = sound if sound.mean() > 0.2 else np.isfinite(force).all(axis=0)
    along = np.zeros(len(names))
    for i, name in enumerate(names):
        both = np.isfinite(gaps[i]) & sound
        if both.sum() > 2:
            along[i] = np.cov(gaps[i, both], force["uv".index(name[4]), both])[0, 1]
    return probe_faults(names, covariance_of(gaps[:, sound]), with_force=along, run=run)


def _pairs(names: tuple[str, ...], excluded: Sequence[str]) -> list[tuple[int, int]]:
    sound = [name for name in names if name not in excluded]
    return [(names.index(n), names.index(opposite(n))) for n in sound if n[5] == "p" and opposite(n) in sound]


def _mend(
    gaps: np.ndarray,
    names: tuple[str, ...],
    first: int,
    second: int,
    time: np.ndarray,
    run: str,
    findings: list[QualityFinding],
) -> np.ndarray:
    """Replace, where an opposed pair does not add up, the wrong gap by what the other means; return what is lost."""
    found = pair_sum(gaps[first], gaps[second])
    lost = np.zeros(time.size, dtype=bool)
    marks = {0: lost.copy(), 1: lost.copy()}
    for start, stop in spans_of(found.departs):
        span = slice(start, stop)
        wrong = culprit(gaps[first], gaps[second], start, stop)
        if wrong is None:
            lost[span] = True
        else:
            marks[wrong][span] = True
    told = "does not fit its opposite probe (clipped, stuck or wild); that one alone gives the motion there"
    for wrong, index in ((0, first), (1, second)):
        findings += _spans(marks[wrong], time, names[index], run, told)
    gaps[first] = np.where(marks[0], found.first_from(gaps[second]), gaps[first])
    gaps[second] = np.where(marks[1], found.second_from(gaps[first]), gaps[second])
    both = f"and {names[second]} do not add up to a constant, and which is wrong cannot be told"
    findings += _spans(lost, time, names[first], run, both)
    return lost


def _spans(marks: np.ndarray, time: np.ndarray, name: str, run: str, what: str) -> list[QualityFinding]:
    """Return one finding for all spans; its place is the longest."""
    found = spans_of(marks)
    if not found:
        return []
    longest = max(found, key=lambda span: span[1] - span[0])
    span = (float(time[longest[0]]), float(time[longest[1] - 1]))
    seconds = float(marks.sum() * np.median(np.diff(time)))
    text = f"{name} {what} ({counted(len(found), 'span')}, {seconds:.3g} s in all)."
    return [QualityFinding("warning", text, run, name, span)]


def _refuse_wrong_axes(planes: dict[int, np.ndarray], force: np.ndarray, kept: np.ndarray) -> None:
    """Compare directions of displacement and force: a stator on springs moves with the force."""
    turn = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2.0)
    for plane, displacement in planes.items():
        d, F = displacement[kept] @ turn, force[kept] @ turn
        finite = np.isfinite(d).all(axis=1)
        if finite.sum() < _FEWEST:
            raise UnusableError(f"plane {plane} has only {finite.sum()} usable samples")
        cross = np.cov(d[finite].T, F[finite].T)[:2, 2:]
        cross = cross / np.linalg.norm(cross)
        uu, vv, uv, vu = cross[0, 0], cross[1, 1], cross[0, 1], cross[1, 0]
        if min(uv, vu) > _CLEAR and max(abs(uu), abs(vv)) < _CLEAR:
            raise UnusableError(
                f"plane {plane}: the probes along u follow the force along v and the other way round: x axis mirrored, "
                "u and v of the probes (or of the forces) are swapped. Exchange them in the recipe's channels"
            )
        wrong = [axis for axis, value in (("u", uu), ("v", vv)) if value < -_CLEAR]
        if wrong:
            raise UnusableError(
                f"plane {plane}: the displacement along {listing(wrong)} goes against the force: the sign of the probes "
                "or of the force is wrong there. Mend it in the recipe with 'sign: -1'"
            )
