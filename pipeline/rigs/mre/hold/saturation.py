"""Was saturation seen? The family of laws against hinge, tanh, FK and a straight line, and the intervals of I_s, a and p.

A limit can be claimed only where the sweep has passed it: I_s and a come from the profile likelihood, and
are told only where that closes below the largest current and the curve has become flat there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.estimation.profile import ProfileInterval, profile_interval
from pipeline.estimation.selection import Candidate
from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.mre.hold import law
from pipeline.rigs.mre.hold.law import LEAST_U, MOST_U
from pipeline.rigs.mre.hold.law_fit import LawFit, Problem, Rows, fit_law, refit
from pipeline.rigs.mre.hold.level_fit import LevelFit

# Slope at the largest current over that at 0 A below which the curve counts as flat (upper 95 % limit).
FLAT = 0.25
# Relative half width of the interval of I_s beyond which it is not determined.
WIDEST = 0.3
# Share of the limit that the largest current must reach for the limit to be called seen.
REACHED = 0.75
# AICc by which a bent law must beat the straight line for a bend to be claimed.
_BEND = 6.0

OTHERS = {"hinge": law.hinge, "tanh": law.tanh_law, "FK": law.froehlich_kennelly}


@dataclass(frozen=True, eq=False)
class Saturation:
    """The law's fit, the candidates, and what may be said of the limit.

    `state` is "seen", "begun" (the curve bends, the limit is not passed) or "not reached"; `flatness` the slope at the
    largest current over that at 0 A, with its upper limit `flatness_high`; `share` S at the largest current.
    """

    fit: LawFit
    straight: LawFit
    candidates: tuple[Candidate, ...]
    state: str
    flatness: float
    flatness_high: float
    share: float
    I_s: ProfileInterval
    a: ProfileInterval
    u: ProfileInterval

    @property
    def for_increments(self) -> LawFit:
        """The fit that increments come from: the straight line where nothing bends."""
        return self.straight if self.state == "not reached" else self.fit

    @property
    def aicc(self) -> dict[str, float]:
        """AICc of each candidate less the smallest."""
        least = min(c.aicc for c in self.candidates)
        return {c.name: c.aicc - least for c in self.candidates}


def judge_saturation(rows: Rows) -> Saturation:
    """Fit all laws and say whether the limit was seen.

    Raises
    ------
    ValueError
        If there are too few holds.
    """
    fit = fit_law(rows)
    straight = fit_law(fit.rows, law.straight, ("r",))
    candidates = _candidates(fit)
    aicc = {c.name: c.aicc for c in candidates}
    top = float(fit.rows.current.max())
    flat, flat_high = _flatness(fit, top)
    I_s, a, u = _profiles(fit)
    closed = I_s.low_side == I_s.high_side == a.low_side == a.high_side == "closed"
    share = float(law.saturation(np.array([top / fit.I_s]), fit.p)[0])
    passed = closed and math.exp(I_s.high) < top and flat_high < FLAT and share >= REACHED
    passed = passed and I_s.high - I_s.low < 2 * WIDEST
    bent = min(v for k, v in aicc.items() if k != "straight line") < aicc["straight line"] - _BEND
    state = "seen" if passed and bent else "begun" if bent else "not reached"
    return Saturation(fit, straight, candidates, state, flat, flat_high, share, I_s, a, u)


def _candidates(fit: LawFit) -> tuple[Candidate, ...]:
    """Return every law fitted to the same rows with the same weights."""
    found = [Candidate("S law", fit.chi2, fit.residual.size, 5)]
    near = {name: fit.values[name] for name in ("ln_I_s", "u", "r")}
    top = float(fit.rows.current.max())
    for name, shape in OTHERS.items():
        problem = Problem(fit.rows, fit.mean_sd, fit.creep_sd, shape)
        begins = [near, *({**near, "ln_I_s": math.log(share * top)} for share in (0.5, 0.75, 0.95, 2.0))]
        chi2 = min(problem.fit(("ln_I_s", "r"), begin)[0].chi2 for begin in begins)
        found.append(Candidate(name, chi2, fit.residual.size, 4))
    problem = Problem(fit.rows, fit.mean_sd, fit.creep_sd, law.straight)
    found.append(Candidate("straight line", problem.fit(("r",), near)[0].chi2, fit.residual.size, 3))
    return tuple(found)


def _flatness(fit: LawFit, top: float) -> tuple[float, float]:
    """Return dS/dz at the largest current and its upper one-sided 95 % limit."""
    values = np.array([fit.values["ln_I_s"], fit.values["u"]])

    def log_slope(v: np.ndarray) -> float:
        return math.log(max(float(law.local_slope(top / math.exp(v[0]), 1 / max(v[1], LEAST_U))), 1e-12))

    centre = log_slope(values)
    sd = fit.sd(
        {
            name: (log_slope(values + step) - log_slope(values - step)) / (2 * float(step.sum()))
            for name, step in (("ln_I_s", np.array([1e-5, 0.0])), ("u", np.array([0.0, 1e-5])))
        }
    )
    return math.exp(centre), math.exp(min(centre + t_quantile(fit.dof, 0.90) * min(sd, 50.0), 0.0))


def _profiles(fit: LawFit) -> tuple[ProfileInterval, ProfileInterval, ProfileInterval]:
    """Return the intervals of ln I_s, a and u; standard errors are only a first guess."""
    top = math.log(float(fit.rows.current.max()))
    sds = {name: min(max(fit.sd({name: 1.0}), 1e-5), 0.3) for name in ("ln_I_s", "u")}
    gain_sd = min(
        max(fit.sd({"ln_I_s": fit.a, "h": fit.I_s / fit.F0, "F0": -fit.a / fit.F0}), 1e-5), 0.3 * abs(fit.a) + 1e-9
    )
    I_s = profile_interval(
        refit(fit, "ln_I_s"),
        fit.values["ln_I_s"],
        fit.chi2,
        sds["ln_I_s"],
        dof=fit.dof,
        low=top + math.log(0.02),
        high=top + math.log(30.0),
    )
    a = profile_interval(refit(fit, "a"), fit.a, fit.chi2, gain_sd, dof=fit.dof)
    u = profile_interval(refit(fit, "u"), fit.values["u"], fit.chi2, sds["u"], dof=fit.dof, low=LEAST_U, high=MOST_U)
    return I_s, a, u


def estimates_of(
    found: Saturation,
    gain_error: float = 0.0,
    offset_error: float = 0.0,
    levels: LevelFit | None = None,
    law_open: str = "",
    relaxation_open: str = "",
) -> list[Estimate]:
    """Return F0, a, I_s, p and r with their intervals, or why they are open.

    Parameters
    ----------
    found
        The fit and what was judged of it.
    gain_error
        Relative standard uncertainty of the force's calibration; scales F0, nothing else.
    offset_error
        Standard error of what was taken off every force alike, N.
    levels
        Fit of the levels without a law, from which F0 and r come where `law_open` tells why the law is not to be believed.
    relaxation_open
        Why the relaxation is not told; empty where it is.
    """
    fit = found.for_increments
    F0, F0_sd, r, r_sd, dof = fit.F0, fit.sd({"F0": 1.0}), fit.r, fit.sd({"r": 1.0}), fit.dof
    if law_open and levels is not None:
        F0, F0_sd = float(levels.force[0]), math.sqrt(float(levels.covariance[0, 0]))
        r, r_sd, dof = levels.r, levels.r_sd, max(levels.spare, 1.0)
    t = t_quantile(dof)
    sd = math.hypot(F0_sd, gain_error * F0, offset_error)
    told = [Estimate("force_initial", F0, sd, (F0 - t * sd, F0 + t * sd), dof=dof)]
    if law_open:
        told += [undetermined(name, law_open) for name in ("force_gain", "saturation_current", "sharpness")]
    else:
        told += _limit(found)
    if relaxation_open:
        told.append(undetermined("relaxation", relaxation_open))
    elif "r" in fit.at_bound:
        told.append(undetermined("relaxation", "the fit ends at the largest relaxation that was admitted"))
    else:
        told.append(Estimate("relaxation", r, r_sd, (r - t * r_sd, r + t * r_sd), dof=dof))
    return told


def _limit(found: Saturation) -> list[Estimate]:
    fit = found.fit
    if found.state != "seen":
        return [
            undetermined(name, f"{why_open(found)}{_at_least(interval, exponential)}")
            for name, interval, exponential in (
                ("force_gain", found.a, False),
                ("saturation_current", found.I_s, True),
            )
        ] + [undetermined("sharpness", why_open(found))]
    a = Estimate("force_gain", fit.a, _half(found.a), (found.a.low, found.a.high), dof=fit.dof)
    ends = (math.exp(found.I_s.low), math.exp(found.I_s.high))
    I_s = Estimate("saturation_current", fit.I_s, (ends[1] - ends[0]) / 4, ends, dof=fit.dof)
    return [a, I_s, _sharpness(found)]


def _sharpness(found: Saturation) -> Estimate:
    fit, u = found.fit, found.u
    if u.low_side != "closed":
        least = f"at least {1 / u.high:.3g} (95 %)" if u.high_side == "closed" else "any value"
        return undetermined(
            "sharpness", f"{least}: the law cannot be told from one that is straight, then flat (p → ∞)"
        )
    if u.high_side != "closed":
        return undetermined(
            "sharpness", f"at most {1 / u.low:.3g} (95 %); the sweep does not tell how sharp the bend is"
        )
    return Estimate("sharpness", fit.p, (1 / u.low - 1 / u.high) / 4, (1 / u.high, 1 / u.low), dof=fit.dof)


def _half(interval: ProfileInterval) -> float:
    return (interval.high - interval.low) / 4


def why_open(found: Saturation) -> str:
    """Say why the limit is not determined."""
    top = float(found.fit.rows.current.max())
    if found.state == "begun":
        return f"saturation has begun but was not passed: the sweep ends at {top:.3g} A"
    return f"saturation was not reached: force rises straight to the end of the sweep, {top:.3g} A"


def _at_least(interval: ProfileInterval, exponential: bool) -> str:
    if interval.low_side != "closed":
        return ""
    low = math.exp(interval.low) if exponential else interval.low
    return f"; at least {low:.3g}{' A' if exponential else ''} (one-sided, 97.5 %)"


def increments_of(found: Saturation, labels: Mapping[float, float]) -> list[Estimate]:
    """Return F(I)/F0 - 1 at each level: `labels` maps the name of a level to the current measured there (A)."""
    fit = found.for_increments
    told = []
    for name in sorted(labels):
        value, sd = fit.increment(name)
        half = t_quantile(fit.dof) * sd
        at = {"coil_current": name}
        told.append(Estimate("force_increment", value, sd, (value - half, value + half), at, dof=fit.dof))
    return told


def measured_increments(levels: LevelFit, named: Mapping[float, int]) -> list[Estimate]:
    """Return the increments of the holds themselves, without a law: `named` maps the name of a level to its number."""
    told = []
    dof = max(levels.spare, 1.0)
    for name in sorted(named):
        value, sd = levels.increment(named[name])
        half = t_quantile(dof) * sd
        at = {"coil_current": name}
        reason = "from the holds themselves, since the law does not fit"
        told.append(Estimate("force_increment", value, sd, (value - half, value + half), at, reason, dof))
    return told
