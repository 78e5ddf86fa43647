"""Resistances, compliances, inertance and ultrafiltration coefficient of the circuit from one run (rap.md, 3.3 and 5.4).

Only ratios of pressure to flow are seen: an error of the flow meter's gain scales all of them, and is told apart. What
this log cannot tell has a reason instead of a number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.rigs.rap.circuit.hydraulics import Circuit
from pipeline.rigs.rap.pressures.level_means import LevelMeans, level_means
from pipeline.rigs.rap.pressures.levels import Level
from pipeline.rigs.rap.pressures.meter_place import contradicted, metered_share
from pipeline.rigs.rap.pressures.resistances import (
    NO_EFFECT,
    UF_OFF,
    Proportion,
    blood_flow,
    coefficient,
    resistance,
    ultrafiltration,
    zeros,
)
from pipeline.rigs.rap.pressures.return_line import ReturnLine, fit_return_line, ratios_of
from pipeline.rigs.rap.pressures.uf_steps import UfSteps, uf_steps
from pipeline.rigs.rap.tables import Signal

NAMES = ("r_access", "r_filter", "r_return", "c_return", "l_return", "c_uf", "k_uf")
UNOBSERVABLE = {
    "c_1": "the compliance from pump to filter is mixed with the unknown waveform of the pump; a pump that stops hard within 50 ms would tell it",
    "c_access": "it rings with Lₐ for 0.4 s only when the pump stops fast; a ramp of 0.3 to 0.5 s hides it",
    "l_access": "it rings with Cₐ for 0.4 s only when the pump stops fast; a ramp of 0.3 to 0.5 s hides it",
}
_OPEN = (
    "; the flow meter's place is {}: only windows without ultrafiltration are used, in which both places read the same"
)
# Time constants of the ultrafiltrate side after which what is left of a step is lost in the noise.
_SETTLED = 5.5


@dataclass(frozen=True, eq=False)
class Readings:
    """Pressures of one reader by tap, flow meter and ultrafiltration as set, all on one clock; None where not logged.

    Attributes
    ----------
    taps
        Pa, with their offsets: they are zeroed where the pump stands.
    meter, location
        Blood flow (m^3/s), and where its meter sits: access, return, or None where not stated.
    uf
        Ultrafiltration as set, m^3/s.
    poles
        Poles of the sensors by tap, s; missing ones count as alike.
    meter_gain_u, pressure_gain_u, uf_gain_u
        Relative standard uncertainties (type B) of the gains; None where not stated.
    """

    taps: Mapping[str, Signal]
    meter: Signal | None = None
    location: str | None = None
    uf: Signal | None = None
    poles: Mapping[str, float] = field(default_factory=dict)
    meter_gain_u: float | None = None
    pressure_gain_u: float | None = None
    uf_gain_u: float | None = None


@dataclass(frozen=True, eq=False)
class Hydraulics:
    """What the run tells of the circuit.

    Attributes
    ----------
    estimates
        By name of `NAMES`, SI; those that are not determined have the reason.
    unobservable
        Constants of eq. (3) that no run of this kind tells: name -> why.
    means
        Pressures, flow by window; `flow` (m^3/s, of blood before the filter) and `uf` (m^3/s) there, NaN where unknown.
    zero
        By tap, what the pressure reads while the pump stands, Pa; empty where it never does.
    return_line, uf
        Fits behind C_2, L_r and C_u; None where there is none.
    circuit
        The constants found, defaults of the rig's synthetic twin elsewhere; None where the resistances are missing.
    """

    estimates: Mapping[str, Estimate]
    unobservable: Mapping[str, str]
    means: LevelMeans
    flow: np.ndarray
    uf_flow: np.ndarray
    zero: Mapping[str, float]
    return_line: ReturnLine | None = None
    uf: UfSteps | None = None
    circuit: Circuit | None = None


def fit_hydraulics(readings: Readings, levels: Sequence[Level]) -> Hydraulics:
    """Return the constants of the circuit.

    Parameters
    ----------
    readings
        Of one reader, the bench's for choice.
    levels
        Stretches of the run on the same clock, from `levels_of`.
    """
    taps = readings.taps
    signals = dict(taps) | ({"flow": readings.meter} if readings.meter is not None else {})
    strokes = next((taps[tap] for tap in ("prefilter", "return", "access") if tap in taps), next(iter(taps.values())))
    means = level_means(signals, strokes, levels)
    zero, zero_sd = zeros(taps, levels)
    switched = _switched(readings, levels)
    means = _settled(means, levels, switched)
    p = {tap: means.mean[tap] - zero.get(tap, 0.0) for tap in taps}
    uf = ultrafiltration(means, levels, p)
    K = coefficient(means, p, uf, zero_sd)
    if K == NO_EFFECT:
        # What is set is not what is drawn: only what was found with none set is sure.
        uf, switched = np.where(uf > UF_OFF, np.nan, uf), None
    doubted = contradicted(readings.location, metered_share(means, uf))
    flow = blood_flow(means, None if doubted else readings.location, uf)
    slopes: dict[str, Proportion | str] = {
        "r_access": resistance(means, p, zero_sd, flow, ("access",), flow, bool(zero)),
        "r_filter": resistance(means, p, zero_sd, flow, ("prefilter", "return"), flow - 0.5 * uf, bool(zero)),
        "r_return": resistance(means, p, zero_sd, flow, ("return",), flow - uf, bool(zero)),
        "k_uf": K,
    }
    if readings.meter is None:
        for name in ("r_access", "r_filter", "r_return"):
            slopes[name] = "there is no flow meter (blood_flow_bench): pressures alone tell no resistance"
    b = _TypeB(
        readings,
        "" if readings.location and not doubted else _OPEN.format("not as stated" if doubted else "not stated"),
    )
    found = {name: _told(name, slope, b) for name, slope in slopes.items()}
    found["c_uf"] = _c_uf(switched, K, b)
    line, circuit, two = _return_line(readings, levels, slopes, switched, b)
    found |= two
    return Hydraulics(
        {name: found[name] for name in NAMES}, dict(UNOBSERVABLE), means, flow, uf, zero, line, switched, circuit
    )


def _settled(means: LevelMeans, levels: Sequence[Level], switched: UfSteps | None) -> LevelMeans:
    """Return the windows in which the ultrafiltrate side has settled: some time constants behind a change."""
    if switched is None:
        return means
    begin = np.array([levels[i].begin for i in means.level])
    return means.of(means.windows.start >= begin + _SETTLED * switched.tau)


class _TypeB:
    """Relative standard uncertainties of type B, and how they are told."""

    def __init__(self, readings: Readings, remark: str) -> None:
        self.remark = remark
        self.meter, self.pressure, self.uf = readings.meter_gain_u, readings.pressure_gain_u, readings.uf_gain_u

    def of(self, name: str) -> tuple[float, str]:
        """Return the relative uncertainty of type B of a parameter, and the words for it."""
        flow, what, stated = (
            (self.uf, "ultrafiltration as set", self.uf is not None)
            if name == "k_uf" or name == "c_uf"
            else (self.meter, "flow meter", self.meter is not None)
        )
        u = math.hypot(flow or 0.0, self.pressure or 0.0)
        remark = self.remark if what == "flow meter" else ""
        if stated or self.pressure is not None:
            return u, f"gain of {what} and pressures (type B) {100 * u:.2g} %{remark}"
        return u, f"gain of {what} and pressures taken as exact, their uncertainty not being stated{remark}"


def _told(name: str, slope: Proportion | str, b: _TypeB) -> Estimate:
    if isinstance(slope, str):
        return undetermined(name, slope)
    u, words = b.of(name)
    random = slope.relative
    value = slope.value
    return estimate(
        name,
        value,
        abs(value) * math.hypot(random, u),
        dof=slope.dof,
        type_b=abs(value) * u or None,
        reason=f"random part {100 * random:.2g} %; {words}",
    )


def _switched(readings: Readings, levels: Sequence[Level]) -> UfSteps | None:
    taps = readings.taps
    if not {"prefilter", "return", "uf"} <= set(taps):
        return None
    pre, ret = taps["prefilter"], taps["return"]
    same = pre.time.size == ret.time.size and bool(np.all(pre.time == ret.time))
    back = ret.values if same else np.interp(pre.time, ret.time, ret.values)
    return uf_steps(Signal("blood_side", pre.time, 0.5 * (pre.values + back)), taps["uf"], levels)


def _c_uf(switched: UfSteps | None, K: Proportion | str, b: _TypeB) -> Estimate:
    if isinstance(K, str):
        return undetermined("c_uf", f"it needs K_uf: {K}")
    if switched is None:
        return undetermined(
            "c_uf",
            "the ultrafiltration is not switched while the pump turns steadily: nothing tells how its pressure follows",
        )
    by_switches = switched.sd / switched.tau
    random = math.hypot(by_switches, K.relative)
    u, words = b.of("c_uf")
    value = switched.tau * K.value
    # Few switches tell their part of the error alone (Welch and Satterthwaite).
    dof = switched.dof * (math.hypot(random, u) / by_switches) ** 4
    return estimate(
        "c_uf",
        value,
        value * math.hypot(random, u),
        dof=dof,
        type_b=value * u or None,
        logarithmic=True,
        reason=f"from τᵤ = {switched.tau:.3f} s; random part {100 * random:.2g} %; {words}",
    )


def _return_line(
    readings: Readings,
    levels: Sequence[Level],
    slopes: Mapping[str, Proportion | str],
    switched: UfSteps | None,
    b: _TypeB,
) -> tuple[ReturnLine | None, Circuit | None, dict[str, Estimate]]:
    names = ("c_return", "l_return")
    R_f, R_r, K = slopes["r_filter"], slopes["r_return"], slopes["k_uf"]
    if isinstance(R_f, str) or isinstance(R_r, str):
        why = R_f if isinstance(R_f, str) else R_r
        return None, None, {name: undetermined(name, f"it needs R_f and R_r: {why}") for name in names}
    usual = Circuit()
    k_uf = K.value if isinstance(K, Proportion) else usual.K_uf
    tau = switched.tau if switched is not None else usual.C_u / usual.K_uf
    circuit = Circuit(R_f=R_f.value, R_r=R_r.value, K_uf=k_uf, C_u=tau * k_uf)
    poles = (readings.poles.get("return", 0.0), readings.poles.get("prefilter", 0.0))
    ratios = ratios_of(readings.taps["prefilter"], readings.taps["return"], levels, poles)
    if ratios is None:
        reason = "the pump's lines stand out in too few steady windows of pre-filter and return pressure"
        return None, circuit, {name: undetermined(name, reason) for name in names}
    line = fit_return_line(ratios, circuit)
    known = {"R_f": R_f.relative, "R_r": R_r.relative}
    # Without switches or ultrafiltration the membrane's share rests on usual constants: half of each is what is not known.
    known["K_uf"] = K.relative if isinstance(K, Proportion) else 0.5
    known["C_u"] = switched.sd / switched.tau if switched is not None else 0.5
    together = (
        float(np.mean((R_f.left_out / R_f.value - 1.0) * (R_r.left_out / R_r.value - 1.0)))
        if R_f.left_out.size == R_r.left_out.size
        else 0.0
    )
    together *= R_f.left_out.size - 1.0
    found = {}
    for i, (name, key) in enumerate(zip(names, ("C_2", "L_r"), strict=True)):
        value = line.fit.values[key]
        if key in line.fit.at_bound or not math.isfinite(line.fit.std_error[key]):
            found[name] = undetermined(name, "the harmonic ratios do not tell it within plausible bounds")
            continue
        own = line.fit.std_error[key] / value
        s = {other: float(line.sensitivity[other][i]) for other in known}
        fixed = sum((s[other] * known[other]) ** 2 for other in known) + 2.0 * s["R_f"] * s["R_r"] * together
        random = math.sqrt(max(own**2 + fixed, own**2))
        u, words = b.of(name)
        found[name] = estimate(
            name,
            value,
            value * math.hypot(random, u),
            dof=line.fit.covariance.dof,
            type_b=value * u or None,
            logarithmic=True,
            reason=f"random part {100 * random:.2g} %; {words}",
        )
    circuit = replace(circuit, C_2=line.fit.values["C_2"], L_r=line.fit.values["L_r"])
    return line, circuit, found
