"""From a recording to motion and force on one clock: what the identification of a rotating load works with.

Logs faster than a hundred samples a turn are averaged; stuck stretches and lone wild samples are left
out and said. Nothing is fitted here.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Condition, QualityFinding, Recording
from pipeline.rigs.tpjb.axes import FROM_UV, xy
from pipeline.rigs.tpjb.conditions import shaft_speed_of, static_load_of
from pipeline.rigs.tpjb.probe_faults import covariance_of, probe_faults
from pipeline.rigs.tpjb.probes import GAPS, Probes, probes_of
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.orbit import Orbit, Rotation, rotation
from pipeline.rigs.tpjb.rotating.sampling import Sampled, sampled
from pipeline.rigs.tpjb.rotating.shaft_line import without_shaft_line

_FORCES = ("force_u", "force_v")
_BESIDE = ("force_static", "speed")
_LEAST_SAMPLES = 40
_LEAST_REST = 5
# A mean force at rest above this share of the full force is taken off.
_ZERO = 0.01
# Pitching, share of the orbit, that a second plane would tell; for the bias of a single one.
_PITCHING = 0.05


@dataclass(frozen=True, eq=False)
class Record:
    """One run of a rotating load, in SI.

    Attributes
    ----------
    orbit
        Stamps, displacement in the probes' zero and dynamic force, x and y, of the n values.
    tilt
        Shape (2, n), rad, or None.
    planes
        x and y in each probe plane, shape (2, n), m.
    static_load
        N, or None where it is not known.
    static_measured, speed
        Mean of `force_static` (N) and `speed` (rad/s), or None.
    averaged
        Samples that one value averages; 1 for a log taken as it is.
    gaps
        Mean of each gap channel in use, m.
    notched
        Amplitude of the shaft's line that was taken out of the displacement, m; None where none was.
    findings
        What was noticed and dealt with on the way.
    """

    orbit: Orbit
    tilt: np.ndarray | None
    planes: dict[int, np.ndarray]
    static_load: float | None
    static_measured: float | None
    speed: float | None
    averaged: int
    gaps: dict[str, float]
    conditions: dict[str, Condition]
    notched: float | None = None
    findings: tuple[QualityFinding, ...] = ()

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.orbit.run

    @property
    def rotation(self) -> Rotation:
        """How the load turns."""
        return self.orbit.rotation

    @property
    def ratio(self) -> float | None:
        """Full force over static load; None where that load is not known."""
        return self.rotation.size / self.static_load if self.static_load else None

    def mapped(self, matrix: np.ndarray) -> Record:
        """Return the record with the motion mapped by `matrix`, shape (2, 2), x and y."""
        return replace(
            self,
            orbit=replace(self.orbit, displacement=matrix @ self.orbit.displacement),
            tilt=None if self.tilt is None else matrix @ self.tilt,
            planes={plane: matrix @ d for plane, d in self.planes.items()},
        )


def record_of(recording: Recording, settings: RotatingSettings) -> Record:
    """Return the run's motion and force.

    Raises
    ------
    InputError
        If it is another test, there are too few samples in common, or the force does not turn.
    """
    test = str(recording.conditions.get("test") or "rotating").strip().lower()
    if test != "rotating":
        raise InputError(f"it is labelled as test '{test}', not 'rotating'")
    gaps = [name for name in GAPS if name in recording]
    have = [*gaps, *_FORCES, *(name for name in _BESIDE if name in recording)]
    table = sampled(recording, have, settings.average)
    findings = list(table.findings)
    needed = np.isfinite(np.vstack([table.values[name] for name in _FORCES])).all(axis=0)
    if needed.sum() < _LEAST_SAMPLES:
        raise InputError(f"{int(needed.sum())} samples with both forces, at least {_LEAST_SAMPLES} are needed")
    probes = _sound_probes(recording, table, gaps, findings)
    d, force, kept = _motion(probes, table)
    try:
        force = _without_zero(recording.run, table.time[kept], force, findings)
    except InputError as error:
        raise InputError(f"{error}{_idle(force)}") from error
    gap_values = np.vstack([table.values[name][kept] for name in probes.names])
    speed = _mean(table, "speed")
    known_speed = speed if speed is not None else shaft_speed_of(recording)
    shaft = None if known_speed is None else known_speed / (2.0 * math.pi)
    orbit, notched = without_shaft_line(Orbit(recording.run, table.time[kept], d, force, None, shaft))
    return Record(
        orbit=orbit,
        tilt=None if probes.tilt is None else probes.tilt @ gap_values,
        planes={plane: matrix @ gap_values for plane, matrix in probes.planes.items()},
        static_load=static_load_of(recording),
        static_measured=_mean(table, "force_static"),
        speed=speed,
        averaged=table.averaged,
        gaps=dict(zip(probes.names, gap_values.mean(axis=1).tolist(), strict=True)),
        conditions=dict(recording.conditions),
        notched=notched,
        findings=tuple(findings),
    )


def _sound_probes(
    recording: Recording, table: Sampled, gaps: Collection[str], findings: list[QualityFinding]
) -> Probes:
    """Return the map of the probes that are sound; the others are named."""
    names = tuple(gaps)
    if not names:
        return probes_of(names, recording.conditions, run=recording.run)
    values = np.vstack([table.values[name] for name in names])
    forces = {axis: table.values[f"force_{axis}"] for axis in "uv"}
    pull = np.array([_covariance(row, forces[name[4]]) for name, row in zip(names, values, strict=True)])
    judged = probe_faults(names, covariance_of(values), with_force=pull, run=recording.run)
    findings += judged.findings
    probes = probes_of(names, recording.conditions, judged.excluded, recording.run)
    findings += probes.findings
    findings += _one_plane(recording, probes)
    return probes


def _one_plane(recording: Recording, probes: Probes) -> list[QualityFinding]:
    """Warn of a single probe plane off the middle: pitching cannot be seen there and scales every coefficient."""
    if len(probes.planes) == 2:
        return []
    seen = {int(name[6]) for name in probes.names}
    z = [recording.conditions.get(f"z{plane}") for plane in seen]
    if all(at == 0.0 for at in z):
        return []
    text = (
        "probes in one plane only (along u, v or both): a pitching stator would bias all coefficients by as "
        f"much as that plane moves off the middle, which cannot be seen: {100 * _PITCHING:g} % of pitching makes {100 * _PITCHING:g} % in every "
        f"stiffness and {200 * _PITCHING:g} % in every quadratic term. This is in no interval."
    )
    return [QualityFinding("warning", text, recording.run)]


def _covariance(a: np.ndarray, b: np.ndarray) -> float:
    both = np.isfinite(a) & np.isfinite(b)
    return float(np.cov(a[both], b[both])[0, 1]) if both.sum() > 2 else 0.0


def _motion(probes: Probes, table: Sampled) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return displacement and force, shape (2, m) each, of the samples that are whole; and which these are."""
    d = probes.displacement @ np.vstack([table.values[name] for name in probes.names])
    f = xy(table.values["force_u"], table.values["force_v"])
    kept = np.isfinite(d).all(axis=0) & np.isfinite(f).all(axis=0)
    if kept.sum() < _LEAST_SAMPLES:
        raise InputError(f"{int(kept.sum())} samples with all gaps and forces, at least {_LEAST_SAMPLES} are needed")
    return d[:, kept], f[:, kept], kept


def _without_zero(run: str, time: np.ndarray, force: np.ndarray, findings: list[QualityFinding]) -> np.ndarray:
    """Take off what the load cells read at rest, where that matters.

    Raises
    ------
    InputError
        If the force does not turn.
    """
    turning = rotation(time, force)
    rest = turning.dwell
    if not turning.has_dwell:
        # A constant reading hides the rest: where the force stands still for long, it is at rest.
        rest = _standing(time, force, turning)
        if rest.sum() < _LEAST_REST:
            return force
    zero = force[:, rest].mean(axis=1)
    if np.hypot(*zero) < _ZERO * turning.size:
        return force
    u, v = FROM_UV.T @ zero
    text = (
        f"the load cells read {u:.3g} N along u and {v:.3g} N along v at rest; this was taken off, so that the force "
        "counts from the static equilibrium."
    )
    findings.append(QualityFinding("note", text, run))
    return np.asarray(force - zero[:, None])


def _idle(force: np.ndarray) -> str:
    """Name the actuator that hardly moves, as a question; empty where both do."""
    moved = np.std(FROM_UV.T @ force, axis=1)
    for axis, own, other in (("u", moved[0], moved[1]), ("v", moved[1], moved[0])):
        if own < 0.1 * other:
            return f" force_{axis} moves by {own:.3g} N rms, the other by {other:.3g} N: is actuator {axis} off?"
    return ""


def _standing(time: np.ndarray, force: np.ndarray, turning: Rotation) -> np.ndarray:
    """Mark samples outside the steady turns where the force hardly moves for a tenth of a turn."""
    width = max(round(0.1 / abs(turning.frequency) / float(np.median(np.diff(time)))), 3)
    if time.size < 2 * width:
        return np.zeros(time.size, dtype=bool)
    windows = np.lib.stride_tricks.sliding_window_view(force, width, axis=1)
    quiet = np.hypot(*np.ptp(windows, axis=2)) < 0.05 * turning.size
    mask = np.zeros(time.size, dtype=bool)
    for start in np.flatnonzero(quiet):
        mask[start : start + width] = True
    return np.asarray(mask & ~turning.steady)


def _mean(table: Sampled, name: str) -> float | None:
    values = table.values.get(name)
    if values is None or not np.isfinite(values).any():
        return None
    return float(np.nanmean(values))
