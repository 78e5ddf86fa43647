"""Which model the orbits ask for: BIC, what a term changes, what the noise allows, prediction of left-out turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.selection import Candidate, Ranked, leave_one_group_out, rank
from pipeline.rigs.in_words import times_noise
from pipeline.rigs.tpjb.rotating.law import SCALE
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit, fit_model
from pipeline.rigs.tpjb.rotating.models import MODELS, Model
from pipeline.rigs.tpjb.rotating.noise import Noise, orbit_noise
from pipeline.rigs.tpjb.rotating.orbit import Orbit

# A term is relevant if it changes the orbit by more than this share of the 1X amplitude ...
RELEVANT = 0.01
# ... or if without it the residual stands out of the noise: chi2red above this.
_AT_NOISE = 1.2
# Above this reduced chi-square no quadratic law holds.
PASSES = 2.0
# A difference of BIC that is "very strong" (Kass and Raftery 1995).
_DECISIVE = 10.0
# M5 is not to be shown where M6 is better by more than this: its terms run away on mixed-term data.
_HIDDEN = 10.0


@dataclass(frozen=True, eq=False)
class Comparison:
    """The models beside each other.

    Attributes
    ----------
    fits
        By name, in the order of `models.MODELS`.
    ranked
        By BIC, best first; `candidate.bic` and `.aicc` count correlated samples once.
    selected
        The simplest model that differs from the best by less than matters.
    best
        The one of least BIC.
    effects
        By name: rms over the orbit, per axis, of what the best model has and this has not, over the
        1X amplitude; the largest over the runs.
    passes
        Whether the selected model leaves no more than noise (reduced chi-square up to 2).
    hidden
        Models whose coefficients are not to be shown, with the reason.
    failed
        Models that could not be fitted, with the reason.
    statements
        All that in plain sentences.
    """

    fits: dict[str, ModelFit]
    ranked: tuple[Ranked, ...]
    selected: ModelFit
    best: ModelFit
    effects: dict[str, float]
    passes: bool
    hidden: dict[str, str]
    failed: dict[str, str]
    statements: tuple[str, ...]

    def candidate(self, name: str) -> Candidate:
        """Return the criteria of a model."""
        return next(entry.candidate for entry in self.ranked if entry.candidate.name == name)


def fit_models(
    orbits: Sequence[Orbit], models: Sequence[Model] = MODELS, noises: Sequence[Noise] | None = None
) -> Comparison:
    """Fit all models to the runs at one static load, and compare them.

    Raises
    ------
    InputError
        If none can be fitted.
    """
    noises = [orbit_noise(orbit) for orbit in orbits] if noises is None else noises
    fits: list[ModelFit] = []
    failed = {}
    for model in models:
        try:
            fit = fit_model(orbits, model, noises)
            # A wrong model may get stuck where a simpler one that it holds does not: then it starts from there.
            held = min((f for f in fits if model.holds(f.model)), key=lambda f: f.chi2, default=None)
            if held and held.chi2 < fit.chi2:
                start = np.linalg.lstsq(model.matrix / SCALE[:, None], held.p / SCALE, rcond=None)[0]
                fit = min(fit, fit_model(orbits, model, noises, start), key=lambda f: f.chi2)
            fits.append(fit)
        except (InputError, np.linalg.LinAlgError) as error:
            failed[model.name] = str(error)
    if not fits:
        raise InputError(f"no model could be fitted: {next(iter(failed.values()))}")
    return compare(fits, failed)


def compare(fits: Sequence[ModelFit], failed: dict[str, str] | None = None) -> Comparison:
    """Rank fits of the same runs and select one.

    Notes
    -----
    Samples whose residual is correlated count as fewer (`effective_share`), from the model of the
    least residual. Of the linear models and those that the best one holds, the simplest is selected that changes the
    orbit by less than 1 % of the 1X amplitude and leaves no more than noise.
    """
    least = min(fits, key=lambda fit: fit.chi2)
    share = _effective_share(least)
    ranked = tuple(
        rank([Candidate(f.name, f.chi2 * share, max(round(f.n_data * share), 8), f.size) for f in fits], margin=0.0)
    )
    by_name = {fit.name: fit for fit in fits}
    best = by_name[ranked[0].candidate.name]
    effects = {fit.name: _effect(fit, best) for fit in fits}
    bic = {entry.candidate.name: entry.candidate.bic for entry in ranked}
    limit = _AT_NOISE * max(best.chi2_reduced, 1.0)
    enough = [
        fit
        for fit in fits
        if fit is best
        or (
            # Between quadratic laws a term that the data ask for biases the others where it is left out.
            (fit.model.is_linear or (best.model.holds(fit.model) and bic[fit.name] - bic[best.name] < _DECISIVE))
            and effects[fit.name] < RELEVANT
            and fit.chi2_reduced < limit
        )
    ]
    selected = min(enough, key=lambda fit: (fit.size, not fit.model.is_linear, bic[fit.name]))
    hidden = {}
    if {"M5", "M6"} <= set(bic) and bic["M5"] - bic["M6"] > _HIDDEN:
        hidden["M5"] = (
            f"M6 is better by a BIC of {bic['M5'] - bic['M6']:.0f}: without mixed terms the other coefficients "
            "of M5 take their place and mean nothing"
        )
    passes = selected.chi2_reduced <= PASSES
    return Comparison(
        by_name,
        ranked,
        selected,
        best,
        effects,
        passes,
        hidden,
        dict(failed or {}),
        _statements(selected, best, effects, bic, passes),
    )


def _effective_share(fit: ModelFit) -> float:
    """Return independent samples over samples: below 1 where the residual is stronger at low frequency."""
    power, total = 0.0, 0.0
    for sigma, noise, path in zip(fit.low_sigma, fit.noises, fit.paths, strict=True):
        plain = (path.residual**2).mean(axis=1) / noise.sigma**2
        power += float((sigma**2).sum()) * path.time.size
        total += float(plain.sum()) * path.time.size
    return min(1.0, total / power) if power > 0 else 1.0


def first_order(orbit: Orbit) -> float:
    """Return the 1X amplitude of an orbit, m: root of the mean square of both half axes."""
    steady = orbit.displacement[:, orbit.rotation.steady]
    return float(np.sqrt(((steady - steady.mean(axis=1, keepdims=True)) ** 2).sum(axis=0).mean()))


def _effect(fit: ModelFit, best: ModelFit) -> float:
    """Return what the best model explains and this does not, per axis, over the 1X amplitude."""
    return max(
        float(np.sqrt(((own.residual - other.residual) ** 2).mean())) / first_order(orbit)
        for own, other, orbit in zip(fit.paths, best.paths, fit.orbits, strict=True)
    )


def _statements(
    selected: ModelFit, best: ModelFit, effects: dict[str, float], bic: dict[str, float], passes: bool
) -> tuple[str, ...]:
    spoken = []
    if selected is not best:
        spoken.append(
            f"{best.name} has the lowest BIC, {bic[selected.name] - bic[best.name]:.0f} below {selected.name}, but "
            f"changes the orbit by {100 * effects[selected.name]:.1f} % of the 1X amplitude only: {selected.name} is enough."
        )
    if not passes:
        spoken.append(
            f"no model passes: {selected.name}, the best, leaves {times_noise(selected.chi2_reduced)}. "
            "A quadratic law is not enough for these orbits; lower the load ratio."
        )
    return tuple(spoken)


def leave_one_turn_out(orbits: Sequence[Orbit], model: Model) -> float:
    """Return the error of predicting each turn from the others, over the rms of the turn about its mean.

    Offset and drift of a left-out turn are those of its run's other turns. A turn that cannot be left
    out (none remains) does not count.

    Raises
    ------
    ValueError
        If there are fewer than two turns in all.
    """
    noises = [orbit_noise(orbit) for orbit in orbits]
    whole = fit_model(orbits, model, noises).theta
    turns = [(i, turn) for i, orbit in enumerate(orbits) for turn in range(max(int(orbit.rotation.turns + 0.05), 0))]

    def inside(group: tuple[int, int]) -> np.ndarray:
        orbit = orbits[group[0]]
        start = orbit.time[orbit.rotation.steady][0]
        number = np.floor((orbit.time - start) * abs(orbit.rotation.frequency))
        return np.asarray(orbit.rotation.steady & (number == group[1]))

    def refit(kept: Sequence[tuple[int, int]]) -> tuple[ModelFit, int]:
        (left,) = set(turns) - set(kept)
        parts = [orbit.part(~inside(left)) if i == left[0] else orbit for i, orbit in enumerate(orbits)]
        return fit_model(parts, model, noises, whole), left[0]

    def predict(fitted: tuple[ModelFit, int], group: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        fit, i = fitted
        rows = inside(group)
        orbit, path = orbits[i], fit.paths[i]
        reference = fit.orbits[i]
        tau = 2 * (orbit.time[rows] - reference.time[0]) / (reference.time[-1] - reference.time[0]) - 1
        level = path.offset[:, None] + path.drift @ np.stack([tau, tau**2 - 1 / 3])
        predicted = fit.model.displacement(fit.theta, orbit.force[:, rows]) + level
        return orbit.displacement[:, rows].ravel(), predicted.ravel()

    return leave_one_group_out(turns, refit, predict).nrmse
