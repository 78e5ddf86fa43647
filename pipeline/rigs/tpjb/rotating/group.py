"""Runs at one static load: the models fitted jointly, the one that is chosen, distortion, and the linear limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.errors import InputError
from pipeline.findings.findings import OperatingPoint
from pipeline.recording import QualityFinding
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.linear_limit import Distortion, Limit, linear_limit, nonlinear_distortion
from pipeline.rigs.tpjb.rotating.load_dependence import StiffnessOfLoad
from pipeline.rigs.tpjb.rotating.load_models import fit_load_models
from pipeline.rigs.tpjb.rotating.model_fit import LawFit, ModelFit, fit_model
from pipeline.rigs.tpjb.rotating.models import M2, M6, MODELS
from pipeline.rigs.tpjb.rotating.noise import orbit_noise
from pipeline.rigs.tpjb.rotating.selection import Comparison, fit_models, leave_one_turn_out
from pipeline.rigs.tpjb.rotating.turns import Turns

_AROUND = 240
# Share by which the stiffness of two runs differs beyond which no law that both share is looked for.
_OTHER_STATE = 0.1


@dataclass(frozen=True, eq=False)
class LoadGroup:
    """One static load.

    Attributes
    ----------
    at
        Operating point: static load and shaft speed, as far as known.
    static_load
        N, or None.
    runs
        By load ratio, smallest first.
    comparison
        M1 to M6 and M3p, fitted jointly, which of them is chosen and why.
    linear
        M2 of each run alone, by run: the apparent stiffness.
    distortions
        Of each run with harmonics, by run.
    limit
        Where the bearing stops being linear; None where no law holds or the static load is unknown.
    prediction
        Error of the chosen model on turns that it had not seen, over the rms of the motion; None where not found.
    dependent
        Load-dependent forms, where the stiffness at several loads is known.
    lower
        The same static load without its largest ratios, where a law holds for those left and for all does not.
    apart
        Why the runs do not belong to one state of the bearing; empty where they may.
    """

    at: OperatingPoint
    static_load: float | None
    runs: tuple[Turns, ...]
    comparison: Comparison
    linear: dict[str, ModelFit]
    distortions: dict[str, Distortion]
    limit: Limit | None
    prediction: float | None
    dependent: tuple[LawFit, ...] = ()
    lower: LoadGroup | None = None
    apart: str = ""
    findings: tuple[QualityFinding, ...] = field(default_factory=tuple)

    @property
    def fits(self) -> tuple[ModelFit, ...]:
        """The models that could be fitted."""
        return tuple(self.comparison.fits.values())

    @property
    def selected(self) -> ModelFit:
        """The chosen model."""
        return self.comparison.selected

    @property
    def trusted(self) -> LoadGroup | None:
        """The runs whose law holds: all of them, else those of lower ratio; None where no law holds for any."""
        return self if self.comparison.passes else self.lower

    @property
    def lowest(self) -> Turns:
        """The run of the smallest load."""
        return self.runs[0]

    @property
    def highest(self) -> Turns:
        """The run of the largest load."""
        return self.runs[-1]

    @property
    def bearing(self) -> str:
        """Which bearing; empty where the runs do not say."""
        return str(self.runs[0].record.conditions.get("bearing", ""))

    @property
    def label(self) -> str:
        """Short name for tables: '40 kN'."""
        load = f"{self.static_load / 1e3:.4g} kN" if self.static_load else "unknown static load"
        return f"{self.bearing}, {load}" if self.bearing else load

    @cached_property
    def index(self) -> dict[str, int]:
        """Place of each run in the fits."""
        return {turns.run: place for place, turns in enumerate(self.runs)}

    def equilibrium(self, run: str) -> np.ndarray:
        """Return the static equilibrium of a run in the frame of the probes, shape (2,), m."""
        return self.selected.paths[self.index[run]].offset

    def drift(self, run: str) -> np.ndarray:
        """Return the fitted drift of a run over its stamps, shape (2, n), m."""
        path, orbit = self.selected.paths[self.index[run]], self.runs[self.index[run]].record.orbit
        return np.asarray(path.drift @ np.stack([orbit.tau, orbit.tau**2 - 1.0 / 3.0]))


def fit_group(at: OperatingPoint, runs: Sequence[Turns], settings: RotatingSettings) -> LoadGroup:
    """Fit all models to the runs at one static load and choose; where none holds, also to the lower ratios alone.

    Raises
    ------
    InputError
        If no model could be fitted.
    """
    ordered = sorted(runs, key=lambda turns: turns.record.rotation.size)
    group = _fit(at, ordered, settings)
    if group.comparison.passes:
        return group
    apart = _apart(group)
    if apart:
        return replace(group, apart=apart, distortions={})
    for count in range(len(ordered) - 1, 0, -1):
        lower = _fit(at, ordered[:count], settings)
        if lower.comparison.passes:
            return _with_distortions(replace(group, lower=lower), lower.selected.K)
    return group


def _apart(group: LoadGroup) -> str:
    """Say which two runs differ in their stiffness at the equilibrium, each fitted alone; empty where none do."""
    try:
        alone = [
            fit_model([turns.record.orbit], M6, [noise])
            for turns, noise in zip(group.runs, group.selected.noises, strict=True)
        ]
    except InputError:  # past its fold: that is no sign of another state
        return ""
    for j, name in ((0, "kxx"), (3, "kyy")):
        own = [(float(fit.p[j]), turns.run) for fit, turns in zip(alone, group.runs, strict=True)]
        (least, soft), (most, stiff) = min(own), max(own)
        sd = max(math.sqrt(max(float(fit.p_covariance[j, j]), 0.0)) for fit in alone)
        if most - least > max(_OTHER_STATE * abs(most), 5.0 * sd):
            return (
                f"the runs do not belong to one state: each fitted alone, {name} at the equilibrium is {least / 1e6:.4g} MN/m in "
                f"{soft} and {most / 1e6:.4g} MN/m in {stiff}; another static load, speed, temperature or bearing than labelled?"
            )
    return ""


def with_load_models(group: LoadGroup, stiffness: StiffnessOfLoad) -> LoadGroup:
    """Return the group with the load-dependent forms M1L to M4L, M1T and M2T fitted beside its models."""
    if not group.static_load:
        return group
    orbits = [turns.record.orbit for turns in group.runs]
    fits, failed = fit_load_models(orbits, stiffness, group.static_load, group.selected.noises)
    told = [
        QualityFinding("note", f"{group.label}: load-dependent model {name}: {why}.") for name, why in failed.items()
    ]
    return replace(group, dependent=tuple(fits.values()), findings=(*group.findings, *told))


def _fit(at: OperatingPoint, ordered: Sequence[Turns], settings: RotatingSettings) -> LoadGroup:
    orbits = [turns.record.orbit for turns in ordered]
    noises = [orbit_noise(orbit) for orbit in orbits]
    comparison = fit_models(orbits, MODELS, noises)
    load = ordered[0].record.static_load
    findings = [
        QualityFinding("note", f"model {name} was not fitted at {load or 0:.4g} N: {reason}")
        for name, reason in comparison.failed.items()
    ]
    chosen = comparison.selected
    group = LoadGroup(
        at=at,
        static_load=load,
        runs=tuple(ordered),
        comparison=comparison,
        linear={
            turns.run: fit_model([orbit], M2, [noise])
            for turns, orbit, noise in zip(ordered, orbits, noises, strict=True)
        },
        distortions={},
        limit=linear_limit(chosen, load, settings.thd_nonlinear) if load else None,
        prediction=_prediction(chosen),
        findings=tuple(findings),
    )
    return _with_distortions(group, chosen.K)


def _with_distortions(group: LoadGroup, K: np.ndarray) -> LoadGroup:
    """Return the group with the distortion of each run beyond what the linear bearing K explains."""
    told = {turns.run: nonlinear_distortion(turns.record.orbit, K) for turns in group.runs if turns.motion is not None}
    return replace(group, distortions=told)


def _prediction(chosen: ModelFit) -> float | None:
    try:
        return leave_one_turn_out(chosen.orbits, chosen.model)
    except (InputError, ValueError):
        return None


def model_orbit(fit: LawFit, size: float) -> np.ndarray:
    """Return the orbit of a law under a turning force of constant size (N), shape (2, m), m; NaN past the fold."""
    angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    return fit.law.displacement(fit.theta, size * np.stack([np.cos(angle), np.sin(angle)]))
