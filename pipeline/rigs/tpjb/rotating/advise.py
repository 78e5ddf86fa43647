"""Which load ratio to run next: from the information of the orbits so far and that of an orbit not yet run.

A proposed run is as the sheet asks for them: 60 s at zero dynamic force, a ramp, five turns, a ramp, 60 s at zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.errors import listing
from pipeline.estimation.design import Information
from pipeline.findings import Findings, Parameter
from pipeline.rigs.advice import Advice, Proposal, Shrinkage
from pipeline.rigs.tpjb.gains import type_a
from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.information import run_information
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.linear_limit import ratio_at
from pipeline.rigs.tpjb.rotating.models import Model, model

# Still, ramp, turns, ramp, still: in turns of the load (60, 40, 500, 40, 60 s at 0.01 Hz).
_ENVELOPE = (0.6, 0.4, 5.0, 0.4, 0.6)
_RATIOS = (0.03, 0.05, 0.075, 0.1, 0.125, 0.15, 0.18, 0.22, 0.26, 0.3, 0.36, 0.4)
# The dynamic actuators reach this force (tpjb.md, rig limits), N.
_STRONGEST = 40e3
# How far beyond the largest ratio of the campaign, at least up to where quadratic terms show.
_BEYOND, _SHOWS = 1.5, 0.2
_FOLD_MARGIN = 0.3
# Standard error over the size at which a number counts as determined; least gain that is worth a line.
_TOLD, _WORTH = 0.3, 1.02
_WORTH_A_RUN = 1.1
_MOST = 5
_MOST_AT_ONE_LOAD = 2  # further ratios tell the same, and less of it
# Of a coefficient over its typical size, for the slope of the linear limit, which is found by halving.
_STEP = 0.02


@dataclass(frozen=True, eq=False)
class _State:
    """One static load: the law with its coefficients, what is known of them, and the noise."""

    at: Mapping[str, float | str | bool]
    design: pd.Series
    law: Model
    theta: np.ndarray
    known: Information

    @property
    def load(self) -> float:
        return float(self.design["static_load"])

    def gradients(self) -> dict[str, dict[str, float]]:
        """Return the derivatives of every parameter by the free coefficients."""
        rows = dict(zip(COEFFICIENTS, self.law.matrix, strict=True))
        told = {name: dict(zip(self.law.free, row.tolist(), strict=True)) for name, row in rows.items() if row.any()}
        # Linear orbits do not show where the limit lies, and so not how well it will be known.
        if not self.design["linear"] and math.isfinite(self._limit(self.theta)):
            slopes = {}
            for j, free in enumerate(self.law.free):
                step = _STEP * self.law.scale[j] * np.eye(self.theta.size)[j]
                slopes[free] = (self._limit(self.theta + step) - self._limit(self.theta - step)) / (2 * step[j])
            if all(math.isfinite(slope) for slope in slopes.values()):
                told["linear_limit"] = slopes
        return told

    def _limit(self, theta: np.ndarray) -> float:
        return float(ratio_at(self.law.coefficients(theta), self.load, 0.05))

    def run(self, ratio: float) -> Information:
        """Return what a run at a load ratio would tell."""
        time, force = load_of(self.design, ratio)
        motion = np.array([self.design["motion_x"], self.design["motion_y"]], dtype=float)
        return run_information(self.law, self.theta, time, force, motion, float(self.design["force_noise"]))

    def ratios(self) -> list[float]:
        """Return the ratios that the rig and the law allow."""
        largest = float(self.design["largest_ratio"])
        far = max(_BEYOND * largest, _SHOWS if self.design["linear"] else 0.0)
        allowed = [r for r in {*_RATIOS, round(largest, 2)} if r <= far and r * self.load <= _STRONGEST]
        p = self.law.coefficients(self.theta)
        sound = []
        for ratio in sorted(allowed):
            _, force = load_of(self.design, ratio)
            if law.fold_margin(p, law.equilibrium(p, force)) > _FOLD_MARGIN:
                sound.append(ratio)
        return sound


def load_of(design: pd.Series, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stamps (s), shape (n,), and force (N), shape (2, n), of a proposed run."""
    turn = 1.0 / float(design["frequency"])
    time = np.arange(0.5, sum(_ENVELOPE) * turn / float(design["step"])) * float(design["step"])
    edges = np.cumsum(_ENVELOPE[:4]) * turn
    size = ratio * float(design["static_load"]) * np.interp(time, edges, [0.0, 1.0, 1.0, 0.0])
    angle = 2.0 * np.pi * time / turn
    return time, size * np.stack([np.cos(angle), np.sin(angle)])


def advise(findings: Findings) -> Advice:
    """Return the load ratios that would shrink most intervals, and what no run at this load can help."""
    if "design" not in findings.arrays:
        return Advice(
            (),
            (
                "These findings hold no law that a run could be planned with: none holds for the orbits (lower the load ratio), or an "
                "earlier version of rigfit wrote them (identify again).",
            ),
        )
    found: list[tuple[float, Proposal]] = []
    remarks: list[str] = []
    for state in _states(findings):
        own = {p.name: p for p in findings.parameters if p.at == state.at}
        gradients = state.gradients()
        sizes = _sizes(state)
        here: list[tuple[float, Proposal]] = []
        for ratio in state.ratios():
            then = state.known + state.run(ratio)
            shrinks = [_shrinkage(own[name], then, slope, sizes) for name, slope in gradients.items() if name in own]
            gain = sum(_gain(s) for s in shrinks)
            worth = [s for s in shrinks if _gain(s) > math.log(_WORTH)]
            if worth and max(map(_gain, worth)) > math.log(_WORTH_A_RUN):
                worth.sort(key=_gain, reverse=True)
                here.append((gain, _proposal(state, ratio, worth)))
        found += sorted(here, key=lambda entry: -entry[0])[:_MOST_AT_ONE_LOAD]
        ruled = [
            name for name in gradients if name in own and (own[name].type_b or 0.0) > (type_a(own[name]) or math.inf)
        ]
        if ruled:
            remarks.append(
                f"{state.design['group']}: the stated gains of the sensors (type B) rule the errors of {listing(ruled)}: a better "
                "calibration helps there, more runs do not."
            )
    loads = {state.load for state in _states(findings)}
    if len(loads) == 1:
        remarks.append(
            "All orbits are of one static load; a second one (double the load) would tell how the stiffness goes with it and "
            "check kyy2 against kyy (dkyy/dW)/2."
        )
    found.sort(key=lambda entry: -entry[0])
    return Advice([proposal for _, proposal in found[:_MOST]], remarks)


def _states(findings: Findings) -> Sequence[_State]:
    designs, laws, information = (findings.arrays[n] for n in ("design", "design_law", "design_information"))
    states = []
    for _, design in designs.iterrows():
        mine = laws[laws["group"] == design["group"]]
        form = model(str(design["law"]))
        theta = mine.set_index("name")["value"].reindex(list(form.free)).to_numpy(dtype=float)
        table = information[information["group"] == design["group"]].pivot(
            index="row", columns="column", values="value"
        )
        matrix = table.reindex(index=list(form.free), columns=list(form.free)).to_numpy(dtype=float)
        at = next(
            p.at
            for p in findings.parameters
            if p.name == "kxx"
            and math.isclose(float(p.at.get("static_load", math.nan)), float(design["static_load"]))
            and str(p.at.get("bearing", design["bearing"])) == design["bearing"]
            and (math.isnan(design["shaft_speed"]) or p.at.get("shaft_speed") == design["shaft_speed"])
        )
        states.append(_State(at, design, form, theta, Information(form.free, matrix)))
    return states


def _sizes(state: _State) -> dict[str, float]:
    """Return what an error is held against: the largest of the stiffnesses, of the quadratic terms, of load ratios."""
    p = state.law.coefficients(state.theta)
    stiff = float(np.abs(p[:4]).max())
    # Where none is known: the term that would bend an orbit of a fifth of the load by a tenth.
    bent = float(np.abs(p[4:]).max()) or 0.1 * stiff**2 / (_SHOWS * state.load)
    return {"N/m": stiff, "N/m^2": bent, "1": 0.4}


def _shrinkage(own: Parameter, then: Information, slope: Mapping[str, float], sizes: Mapping[str, float]) -> Shrinkage:
    error = then.std_error(slope)
    told = error < _TOLD * sizes[own.unit]
    later = math.hypot(error, own.type_b or 0.0) if told else None
    return Shrinkage(own.name, own.at, own.std_error, later, own.unit)


def _gain(one: Shrinkage) -> float:
    """Return the logarithm of the factor; a number that was not told before counts as an error ten times smaller."""
    if one.then is None:
        return 0.0
    return math.log(one.factor) if one.factor else math.log(10.0)


def _proposal(state: _State, ratio: float, shrinks: Sequence[Shrinkage]) -> Proposal:
    force = ratio * state.load
    p = state.law.coefficients(state.theta)
    reach = 1e6 * float(np.hypot(*law.equilibrium(p, load_of(state.design, ratio)[1])).max())
    new = [s.name for s in shrinks if s.now is None]
    best = [s.name for s in shrinks if s.now is not None][:3]
    gains = " and ".join(
        text
        for text, there in ((f"tells {listing(new)} at all", new), (f"sharpens {listing(best)} most", best))
        if there
    )
    why = (
        f"Five turns at {force / 1e3:.3g} kN with 60 s at zero dynamic force before and after (at 0.01 Hz) move the stator "
        f"by up to {reach:.2g} um, which {gains}."
    )
    conditions: dict[str, float | str] = {"static_load": state.load, "load_ratio": ratio}
    if not math.isnan(state.design["shaft_speed"]):
        conditions["shaft_speed_nominal"] = float(state.design["shaft_speed"])
    conditions["force_rotation_frequency"] = round(float(state.design["frequency"]), 4)
    if state.design["bearing"]:
        conditions["bearing"] = str(state.design["bearing"])
    return Proposal(conditions, 1, why, shrinks)
