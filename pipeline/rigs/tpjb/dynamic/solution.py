"""One operating point: impedance over the tones, what stands against it, and the law of each coefficient."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from pipeline.errors import listing
from pipeline.recording import Level, QualityFinding
from pipeline.rigs.tpjb.dynamic import impedance, laws
from pipeline.rigs.tpjb.dynamic.declaration import DynamicSettings
from pipeline.rigs.tpjb.dynamic.inertia import Inertia
from pipeline.rigs.tpjb.dynamic.laws import Law
from pipeline.rigs.tpjb.dynamic.motion import PLAUSIBLE, opposed
from pipeline.rigs.tpjb.dynamic.pooling import Pool

ENTRIES = tuple(product(range(2), range(2)))
NAMES = tuple(f"{letter}{'xy'[i]}{'xy'[j]}" for letter in "kc" for i, j in ENTRIES)


@dataclass(eq=False)
class Coefficient:
    """One of the eight over the tones, shape (k,): value, standard error (type A), its degrees of freedom.

    `laws` are those of degree 0 to 2, `law` the one taken; `inertia` the type B error by the stator's.
    """

    name: str
    value: np.ndarray
    std_error: np.ndarray
    dof: np.ndarray
    inertia: np.ndarray
    laws: list[Law] = field(default_factory=list)
    law: Law | None = None


@dataclass(eq=False)
class Solution:
    """What one operating point gives.

    Attributes
    ----------
    tones
        Those that are used, Hz, shape (k,).
    points
        Operating points of the campaign, each with as many coefficients that chi-square judges.
    result
        None where nothing could be told.
    fatal
        Why no coefficient is given at all; '' where they are.
    shift
        What an unexplained lag or mass would do to each coefficient over the tones, by name: see `doubt`.
    """

    pool: Pool
    inertia: Inertia
    tones: np.ndarray
    points: int = 1
    result: impedance.Impedance | None = None
    snr: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    coefficients: dict[str, Coefficient] = field(default_factory=dict)
    fatal: str = ""
    doubt: str = ""
    shift: dict[str, np.ndarray] = field(default_factory=dict)
    added_mass: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    lag: laws.Imitation | None = None
    untaken: laws.Imitation | None = None
    quality: list[QualityFinding] = field(default_factory=list)

    def say(self, level: Level, message: str, channel: str | None = None) -> None:
        """Note something about this operating point."""
        runs = [r.run for r in self.pool.members]
        if len(runs) > 1:
            message = f"{self.pool.label}: {message}"
        self.quality.append(QualityFinding(level, message, runs[0] if len(runs) == 1 else None, channel))

    @property
    def w(self) -> np.ndarray:
        """Circular frequency of the tones, rad/s."""
        return 2 * np.pi * self.tones


def sentence(reason: str) -> str:
    """Return a reason as the end of a sentence."""
    return reason if reason.endswith((".", "?")) else f"{reason}."


def solve(pool: Pool, inertia: Inertia, settings: DynamicSettings, points: int = 1) -> Solution:
    """Solve one operating point of `points`."""
    solution = Solution(pool, inertia, pool.tones, points)
    solution.quality += inertia.findings
    for step in (_check_inputs, _keep_good_tones, _check_signs, _check_trends, _fit_laws):
        step(solution, settings)
        if solution.fatal:
            solution.say("error", f"no coefficient is given: {sentence(solution.fatal)}")
            break
    return solution


def _check_inputs(solution: Solution, _settings: DynamicSettings) -> None:
    if solution.pool.missing:
        solution.fatal = solution.pool.missing
    elif solution.inertia.mass is None:
        solution.fatal = solution.inertia.source
    elif solution.pool.acceleration is None:
        causes = dict.fromkeys(record.no_acceleration for record in solution.pool.records if record.no_acceleration)
        solution.fatal = next(iter(causes), "the stator's acceleration is not known")


def _estimate(solution: Solution, keep: np.ndarray, settings: DynamicSettings) -> impedance.Impedance:
    pool, inertia = solution.pool, solution.inertia
    tones = pool.tones[keep]
    lag = settings.displacement_lag or 0.0
    turn = np.exp(2j * np.pi * tones * lag)[:, None]
    force = [
        impedance.bearing_force(F[:, keep], A[:, keep], tones, inertia.mass or 0.0, inertia.stiffness)
        for F, A in zip(pool.force, pool.acceleration or [], strict=True)
    ]
    return impedance.ratio_of_means(force, [D[:, keep] * turn for D in pool.displacement])


def _keep_good_tones(solution: Solution, settings: DynamicSettings) -> None:
    pool = solution.pool
    everything = np.ones(pool.tones.size, dtype=bool)
    first = _estimate(solution, everything, settings)
    with np.errstate(divide="ignore", invalid="ignore"):
        driven = [np.linalg.norm(F.mean(axis=0), axis=1) / _noise(F) for F in pool.force]
        moved = np.linalg.norm(first.displacement, axis=1) / np.linalg.norm(first.displacement_noise, axis=1)
    silent = np.nan_to_num(np.min(driven, axis=0)) < settings.least_snr
    buried = ~silent & (np.nan_to_num(moved.min(axis=1)) < settings.least_snr)
    for tone in pool.tones[silent]:
        pool.dropped[float(tone)] = f"force below {settings.least_snr:g} times its error: amplifier off?"
    for tone in pool.tones[buried]:
        pool.dropped[float(tone)] = f"displacement below {settings.least_snr:g} times its error"
    keep = ~silent & ~buried
    alike = keep & ~(first.condition < settings.largest_condition)
    for tone in pool.tones[alike]:
        pool.dropped[float(tone)] = f"excitations are not independent, cond(D) above {settings.largest_condition:g}"
    if alike.any() and not (keep & ~alike).any():
        worst = float(first.condition[keep].min())
        shown = f"{worst:.3g}" if worst < 1e6 else "infinite"
        solution.fatal = (
            f"excitations are not independent: cond(D) is {shown} or more at every tone. Is one actuator off, or were "
            "both runs taken with the same excitation?"
        )
        return
    keep &= ~alike
    if not keep.any():
        solution.fatal = "no tone stands out of the noise of force and displacement"
        return
    solution.tones = pool.tones[keep]
    solution.result = _estimate(solution, keep, settings)
    solution.snr = 20 * np.log10(np.maximum(moved[keep] * np.sqrt(0.5 / np.array(pool.blocks)), 1e-12))
    if pool.dropped:
        told = "; ".join(f"{tone:g} Hz: {reason}" for tone, reason in sorted(pool.dropped.items()))
        solution.say("warning", f"tones that are not used: {told}.")


def _noise(F: np.ndarray) -> np.ndarray:
    """Return the error of the mean amplitude vector, shape (k,), from blocks of shape (B, k, 2)."""
    return np.asarray(np.linalg.norm(F.std(axis=0, ddof=1), axis=1) / math.sqrt(F.shape[0]))


def _fill(solution: Solution) -> None:
    """Read K and C off H, with type A errors and what the stator's inertia adds as type B."""
    found, w = solution.result, solution.w
    assert found is not None
    by_mass = (
        impedance.inertia_sensitivity(_mean_acceleration(solution), found) * solution.inertia.error_at(w)[:, None, None]
    )
    for name, (i, j) in zip(NAMES, 2 * ENTRIES, strict=True):
        sd, dof = found.std_error[:, i, j], found.dof[:, i, j]
        H, B = found.H[:, i, j], by_mass[:, i, j]
        solution.coefficients[name] = (
            Coefficient(name, H.real, sd, dof, np.abs(B.real))
            if name[0] == "k"
            else Coefficient(name, H.imag / w, sd / w, dof, np.abs(B.imag) / w)
        )


def _check_signs(solution: Solution, _settings: DynamicSettings) -> None:
    """Name a mirrored axis and units that cannot be."""
    _fill(solution)
    pool, c = solution.pool, solution.coefficients
    kxx, kyy = (float(np.median(c[name].value)) for name in ("kxx", "kyy"))
    plain = float(np.linalg.norm(pool.force[0]) / np.linalg.norm(pool.displacement[0]))
    if not PLAUSIBLE[0] < plain < PLAUSIBLE[1] or not max(abs(kxx), abs(kyy)) < PLAUSIBLE[1]:
        solution.fatal = (
            f"force over displacement is {plain:.3g} N/m, kxx = {kxx:.3g} N/m and kyy = {kyy:.3g} N/m, where {PLAUSIBLE[0]:.0e} to "
            f"{PLAUSIBLE[1]:.0e} N/m are a bearing's: unit of a force (kN) or of a gap (um, mil = 25.4 um)?"
        )
    elif kxx < 0 < kyy:
        solution.fatal = "x axis mirrored: kxx is negative and kyy positive; probe u/v swapped?"
    elif kxx < 0 and kyy < 0:
        solution.fatal = "kxx and kyy are both negative: sign of the force or of the gaps inverted?"
    elif kyy < 0:
        solution.fatal = "y axis mirrored: kyy is negative and kxx positive; sign of a force or of the probes?"


def _check_trends(solution: Solution, settings: DynamicSettings) -> None:
    """Tell an added mass, and whether a lag or an inertia that is wrong explains the trends of all entries."""
    found, w = solution.result, solution.w
    assert found is not None
    if w.size < 3:
        return
    for axes in ("xx", "xy", "yx", "yy"):
        entry = solution.coefficients["k" + axes]
        solution.added_mass[axes] = laws.added_mass(w, entry.value, entry.std_error)
    A = _mean_acceleration(solution)
    pattern = {"lag": 1j * w[:, None, None] * found.H, "mass": impedance.inertia_sensitivity(A, found)}
    solution.lag = laws.imitation(w, found.H, found.std_error, found.dof, pattern["lag"])
    solution.untaken = laws.imitation(w, found.H, found.std_error, found.dof, pattern["mass"])
    if reason := opposed(A, -(w**2)[:, None, None] * found.displacement):
        solution.fatal = reason
        return
    late, extra = solution.lag, solution.untaken
    unknown = math.isnan(solution.inertia.mass_error)
    suspect_lag = settings.displacement_lag is None and late.explains and not (unknown and extra.beats(late))
    suspect_mass = unknown and extra.explains and not (settings.displacement_lag is None and late.beats(extra))
    if not suspect_lag and not suspect_mass:
        _own_law(solution, settings, pattern)
        return
    readings, shifts = [], {}
    if suspect_lag:
        readings.append(_as_lag(late, found))
        shifts["lag"] = late.value * pattern["lag"]
    if suspect_mass:
        readings.append(_as_mass(extra))
        shifts["mass"] = extra.value * pattern["mass"]
    solution.doubt = " or ".join(readings)
    solution.say(
        "warning",
        f"stiffness goes with w^2 in all directions as {solution.doubt} would make it; a bearing with an added mass of "
        f"{solution.added_mass['xx'][0]:.3g} kg (x) and {solution.added_mass['yy'][0]:.3g} kg (y) would, too. What that would shift by more than "
        "its error is not given. Calibrate the lag and set 'displacement_lag' (0 where there is none); take mass and "
        "stiffness from a tpjb.baseline campaign.",
    )
    for i, j in ENTRIES:
        axes = f"{'xy'[i]}{'xy'[j]}"
        worst = max(shifts.values(), key=lambda s: float(np.abs(s[:, i, j].imag).sum()))
        solution.shift["k" + axes] = np.max([np.abs(s[:, i, j].real) for s in shifts.values()], axis=0)
        solution.shift["c" + axes] = np.abs(worst[:, i, j].imag) / w


def _as_lag(late: laws.Imitation, found: impedance.Impedance) -> str:
    side = "late" if late.value > 0 else "early"
    return (
        f"a displacement {side} by {1e6 * abs(late.value):.3g} ± {1e6 * 2 * late.std_error:.2g} us (which biases "
        f"C by K dt, here {float(np.mean(found.H[:, 0, 0].real)) * late.value:.3g} N s/m on cxx)"
    )


def _as_mass(extra: laws.Imitation) -> str:
    return f"a stator {abs(extra.value):.3g} kg {'heavier' if extra.value > 0 else 'lighter'} than stated"


def _own_law(solution: Solution, settings: DynamicSettings, pattern: dict[str, np.ndarray]) -> None:
    """Note it where coefficients bend with frequency as a lag or a mass would bend straight lines."""
    found, w = solution.result, solution.w
    if found is None or w.size < 4 or solution.lag is None or solution.lag.chi2_without <= solution.lag.limit:
        return
    late, extra = (laws.imitation(w, found.H, found.std_error, found.dof, pattern[name], 1) for name in ("lag", "mass"))
    unknown, uncalibrated = math.isnan(solution.inertia.mass_error), settings.displacement_lag is None
    readings = []
    if uncalibrated and late.explains and not (unknown and extra.beats(late)):
        readings.append(_as_lag(late, found))
    if unknown and extra.explains and not (uncalibrated and late.beats(extra)):
        readings.append(_as_mass(extra))
    if readings:
        solution.say(
            "note",
            f"the coefficients bend with frequency. That is taken for the bearing's own; {' or '.join(readings)} beside coefficients "
            "that are straight in frequency would fit as well, and these logs alone do not tell. A calibrated "
            "'displacement_lag' and a tpjb.baseline campaign do.",
        )


def _mean_acceleration(solution: Solution) -> np.ndarray:
    keep = np.isin(solution.pool.tones, solution.tones)
    return np.stack([blocks[:, keep].mean(axis=0) for blocks in solution.pool.acceleration or []], axis=2)


def _fit_laws(solution: Solution, _settings: DynamicSettings) -> None:
    """Fit constant, line and parabola in f/f_shaft - 1 to each coefficient and choose by chi-square."""
    shaft = solution.pool.shaft
    if not shaft:
        return
    if not solution.tones.min() <= shaft <= solution.tones.max():
        solution.say(
            "warning",
            f"no tones on both sides of the shaft's {shaft:.4g} Hz (used are {solution.tones.min():g} to {solution.tones.max():g} Hz): "
            "there are no synchronous values, they would be extrapolated.",
        )
    r = solution.tones / shaft - 1
    tests = len(NAMES) * solution.points
    rejected = []
    for entry in solution.coefficients.values():
        entry.laws = [
            laws.fit_law(r, entry.value, entry.std_error, entry.dof, degree) for degree in range(min(3, r.size))
        ]
        if entry.laws[-1].dof > 0:
            entry.laws[-1] = laws.among(entry.laws[-1], r.size, entry.dof, tests)
        entry.law = laws.choose(entry.laws)
        if entry.law is None:
            entry.law = entry.laws[-1]
            if entry.law.dof > 0:
                rejected.append(entry.name)
    if rejected:
        solution.say(
            "warning",
            f"{listing(rejected)}: even a parabola in frequency is rejected (chi-square beyond its 99 % point for all "
            f"{tests} coefficients together); errors of the synchronous value are widened to the scatter about it.",
        )
