"""What is doubtful about a bump test once it is fitted: each doubt is a finding and a reason of the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import counted, listing
from pipeline.findings import Quality
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.tpjb.bump.bearing_fit import BearingFit
from pipeline.rigs.tpjb.bump.contact import centred
from pipeline.rigs.tpjb.bump.contact_fit import ContactFit
from pipeline.rigs.tpjb.bump.declaration import BumpSettings

# Clearances and contact stiffnesses beyond which a unit is suspected, m and N/m.
_CLEARANCES = (5e-6, 5e-3)
_STIFFNESSES = (1e7, 1e12)
_NOMINAL = 4.0
# Share of the weakest force that a constant force may have.
_UNBALANCED = 0.2
_FRICTION = 0.005
_DRIFT = 0.3e-6
# Residual that counts as misfit, as a share of the deepest indentation.
_MISFIT = 0.05
# The same for steps of the residual with the force.
_STEP = 0.005


@dataclass
class Doubts(Judgement):
    """The verdict while it is made, with the findings on the data that belong to it."""

    quality: list[Quality] = field(default_factory=list)

    def doubt(self, message: str, advice: str = "", *, channel: str | None = None) -> None:
        """Note a doubt: a finding, a reason, and how to mend it."""
        self.quality.append(Quality(level="warning", channel=channel, message=f"{message} {advice}".strip()))
        self.warn(message)
        if advice:
            self.advise(advice)

    def refuse(self, message: str) -> None:
        """Say why nothing can be told at all."""
        self.quality.append(Quality(level="error", message=message))
        self.reject(message)

    def note(self, message: str) -> None:
        """Note what is worth knowing and no doubt."""
        self.quality.append(Quality(level="note", message=message))


def judge(fit: BearingFit, settings: BumpSettings, judgement: Doubts) -> None:
    """Add all doubts about one bearing."""
    if _units(fit, judgement):
        return
    _rig(fit, judgement)
    _pads(fit, settings, judgement)
    _levels(fit, settings, judgement)
    _sides(fit, settings, judgement)
    if fit.contact is None:
        judgement.doubt(f"The contact law was not fitted: {fit.reason}.")
        return
    _contact(fit, fit.contact, judgement)


def growth_of(fit: BearingFit) -> np.ndarray:
    """Return force (N) and mean distance of the touched sides (m) at each level, shape (levels, 2)."""
    forces = fit.blocks.levels
    there = [i for i in range(fit.n_pads) if i not in fit.absent]
    means = [np.mean([p[k].sides[there].mean() for p in fit.polygons.values()]) for k in range(len(forces))]
    return np.column_stack([forces, means])


def _rig(fit: BearingFit, judgement: Doubts) -> None:
    largest = max(fit.blocks.levels)
    for record in fit.records:
        recording = record.recording
        if "speed" in recording and abs(float(np.nanmedian(recording.values("speed")))) > 1.0:
            speed = float(np.nanmedian(recording.values("speed")))
            judgement.doubt(
                f"Run '{recording.run}': the shaft turns at {speed:.3g} rad/s; a bump test is done at rest and without oil."
            )
        if "force_static" in recording:
            swing = float(np.nanstd(recording.values("force_static")))
            if swing > 0.05 * largest:
                judgement.doubt(
                    f"Run '{recording.run}': the static force moves by {swing:.3g} N (rms) and is not in the turning force.",
                    "Keep the static actuator still, or off, during the bump test.",
                    channel="force_static",
                )


def _pads(fit: BearingFit, settings: BumpSettings, judgement: Doubts) -> None:
    shown = ", ".join(f"{n}: {1e6 * misfit:.3g} um" for n, misfit in fit.count.misfits.items())
    if fit.contradiction:
        judgement.doubt(fit.contradiction, "Mend n_pads and pad_angles.")
    elif fit.stated is None:
        judgement.note(
            f"n_pads is not given: the orbit shows {fit.n_pads} sides (rms distance by number of sides: {shown})."
        )
    rotation = float(np.median([polygon.rotation for polygon in fit.top.values()]))
    if abs(rotation) > settings.rotation_limit:
        judgement.doubt(
            f"The polygon is turned by {math.degrees(rotation):.1f} deg against the pad angles "
            f"{listing(f'{math.degrees(a):.0f}' for a in fit.pad_angles)} deg: those may be wrong, and with them the "
            "numbers of the sides.",
            "Give pad_angles as the pads stand (load on a pad or between two).",
        )


def _levels(fit: BearingFit, settings: BumpSettings, judgement: Doubts) -> None:
    growth = growth_of(fit)
    if len(growth) < 2:
        judgement.doubt(
            f"There is one force level only ({growth[0, 0]:.4g} N): whether the polygon has converged cannot be told, and "
            "the contact stiffness rests on this level alone.",
            "Repeat at two or more forces, each at least double the one before.",
        )
        return
    if fit.absent:
        return  # an orbit that does not reach every side grows for another reason
    rise = (growth[-1, 1] - growth[-2, 1]) / (growth[-1, 0] - growth[-2, 0])
    told = f"the mean clearance grows by {rise * 1e9:.2g} um/kN from {growth[-2, 0]:.4g} to {growth[-1, 0]:.4g} N"
    compliance = 1 / fit.contact.fit.values["k_p"] if fit.contact is not None else math.inf
    if rise > max(settings.growth_limit, 0.0) or rise > 1.5 * compliance:
        limit = min(settings.growth_limit, 1.5 * compliance)
        judgement.doubt(
            f"The polygon has not converged: {told}, more than {limit * 1e9:.2g} um/kN.",
            "Raise the force until the polygon no longer changes.",
        )
    else:
        judgement.note(f"The polygon has converged: {told}, as the contact's compliance has it.")


def _sides(fit: BearingFit, settings: BumpSettings, judgement: Doubts) -> None:
    if fit.blocks.coverage < 0.95:
        judgement.note(f"The force went through {100 * fit.blocks.coverage:.0f} % of the directions only.")
    if fit.absent:
        pads = ", ".join(f"{i + 1} (pad at {math.degrees(fit.pad_angles[i]):.0f} deg)" for i in fit.absent)
        judgement.doubt(
            f"Side {pads} was never touched: the weight of the housing may not be balanced. Its distance, and the centre "
            "where it depends on it, are not determined.",
            "Balance the weight of the stator with the static actuator and repeat.",
        )
    for plane, polygon in fit.top.items():
        few = [i for i in range(fit.n_pads) if polygon.near[i] < settings.least_share and i not in fit.absent]
        if few:
            shares = ", ".join(f"{i + 1} ({100 * polygon.near[i]:.1f} %)" for i in few)
            judgement.doubt(
                f"Plane {plane}: few samples lie at side {shares}; every side should have {100 * settings.least_share:.0f} %.",
                "Turn the force more slowly or raise it.",
            )


def _units(fit: BearingFit, judgement: Doubts) -> bool:
    """Tell whether a unit is wrong, and say so: nothing else is worth saying then."""
    message = wrong_unit(fit)
    if message:
        judgement.refuse(message)
    return bool(message)


def wrong_unit(fit: BearingFit) -> str:
    """Return why a unit of gaps or forces cannot be right; empty where all may be."""
    if not fit.absent:
        polygons = list(fit.top.values())
        mean = float(np.mean([polygon.clearances.mean() for polygon in polygons]))
        told = [r.recording.conditions.get("clearance_nominal") for r in fit.records]
        nominal = next((float(v) for v in told if isinstance(v, int | float) and v > 0), None)
        if nominal is not None and not nominal / _NOMINAL < mean < nominal * _NOMINAL:
            return (
                f"The mean clearance {1e6 * mean:.4g} um is {mean / nominal:.3g} times the nominal {1e6 * nominal:.4g} um: "
                "check the unit of the gap channels (um taken as mm is a factor 1000, mil as um 25.4)."
            )
        if nominal is None and not _CLEARANCES[0] < mean < _CLEARANCES[1]:
            return (
                f"The mean clearance {1e6 * mean:.4g} um is not that of a bearing: check the unit of the gap channels."
            )
    k_p = fit.contact.fit.values["k_p"] if fit.contact is not None else 1e9
    if not _STIFFNESSES[0] < k_p < _STIFFNESSES[1]:
        return (
            f"The contact stiffness {k_p:.3g} N/m is outside {_STIFFNESSES[0]:.0e} to {_STIFFNESSES[1]:.0e} N/m: check the "
            "units of force and gap (kN taken as N is a factor 1000)."
        )
    return ""


def _contact(fit: BearingFit, contact: ContactFit, judgement: Doubts) -> None:
    blocks = fit.blocks
    ratio = contact.motion_noise / max(blocks.motion_noise, 1e-12)
    deepest = max(blocks.levels) / contact.fit.values["k_p"]
    if ratio > 4 and contact.motion_noise > _MISFIT * deepest:
        judgement.doubt(
            f"The contact law misses the displacement by {1e6 * contact.motion_noise:.2g} um (rms), {ratio:.2g} times the "
            "noise of the probes: contact stiffness and clearance are averages, the law is not quite that of the bearing."
        )
    steps = contact.steps[np.isfinite(contact.steps).all(axis=2)]
    clear = np.abs(steps[:, 0]) > np.maximum(6 * steps[:, 1], _STEP * deepest)
    if len(blocks.levels) > 1 and clear.any():
        judgement.doubt(
            f"The stator sinks into the pads not in proportion to the force: up to {1e6 * np.abs(steps[:, 0]).max():.2g} um beside "
            "the linear contact law. The contact stiffness is a mean over the forces, and the clearance at no force depends on "
            "the law more than its interval says."
        )
    lost = float(contact.outliers.mean())
    if lost > 0.02:
        judgement.doubt(f"{100 * lost:.0f} % of the blocks lie far off the contact law and were left out.")
    mu = friction_of(fit, contact)
    if mu:
        judgement.doubt(
            f"Along the sides the displacement lags behind the turning force as with friction of about {mu:.3f}; the support "
            "stiffness is not determined, the clearance is hardly touched by it.",
            "Oil the pads lightly or turn the force both ways round and compare.",
        )
    for plane, bearing in contact.bearings.items():
        if fit.absent:
            break
        centre, _ = centred(bearing.sides, bearing.normals)
        pull = bearing.k_s * (bearing.neutral - centre)
        size = float(np.hypot(*pull))
        if size > _UNBALANCED * min(blocks.levels):
            direction = math.degrees(math.atan2(pull[1], pull[0])) % 360
            judgement.doubt(
                f"Plane {plane}: a constant force of {size:.3g} N towards {direction:.0f} deg acts beside the turning one: the "
                "weight of the housing is not balanced. It is fitted along.",
                "Balance the weight of the stator with the static actuator.",
            )
            break
    for plane, change in drift_of(fit, contact).items():
        if float(np.hypot(*change)) > _DRIFT:
            judgement.doubt(
                f"Plane {plane}: the bearing drifts by {1e6 * change[0]:.2g} um in x and {1e6 * change[1]:.2g} um in y during the "
                "test; the centre is the mean over it.",
                "Let rig and probes come to one temperature first.",
            )
    means = {p: float(b.sides.mean()) for p, b in contact.bearings.items()}
    if len(means) == 2 and not fit.absent and abs(means[1] - means[2]) > 1e-6:
        judgement.note(
            f"The mean clearance differs by {1e6 * (means[2] - means[1]):.2g} um between the planes: a conical bore?"
        )
    if contact.widening > 2:
        effect = f"standard errors were widened {contact.widening:.2g} times"
        judgement.note(
            f"Residuals are correlated in time over many of the {counted(int(contact.kept.sum()), 'block')}: {effect}."
        )


def friction_of(fit: BearingFit, contact: ContactFit) -> float:
    """Return the coefficient of friction that the lag along single sides means; 0 where it is none for sure."""
    shares = []
    blocks = fit.blocks
    for plane, bearing in contact.bearings.items():
        touching = contact.touching[plane]
        single = (touching.sum(axis=1) == 1) & (contact.kept | contact.outliers)
        side = touching[single].argmax(axis=1)
        normals = bearing.normals[side]
        ahead = math.copysign(1.0, blocks.frequency) * normals @ np.array([[0.0, 1.0], [-1.0, 0.0]])
        lag = ((contact.predicted[plane] - blocks.planes[plane])[single] * ahead).sum(axis=1)
        press = bearing.k_p * ((contact.predicted[plane][single] * normals).sum(axis=1) - bearing.sides[side])
        shares.append(bearing.k_s * lag / np.maximum(press, 0.1 * min(blocks.levels)))
    share = np.concatenate(shares)
    if share.size < 10:
        return 0.0
    mu = float(np.median(share))
    error = 1.25 * 1.4826 * float(np.median(np.abs(share - mu))) / math.sqrt(share.size)
    return mu if abs(mu) > max(_FRICTION, 5 * error) else 0.0


def drift_of(fit: BearingFit, contact: ContactFit) -> dict[int, np.ndarray]:
    """Return how far the residual moves from the start of the test to its end, shape (2,), m, by plane."""
    found = {}
    for plane, touching in contact.touching.items():
        corner = contact.kept & (touching.sum(axis=1) > 1)
        if corner.sum() < 10 or len(fit.records) > 1:
            continue
        time = fit.blocks.time[corner]
        x = (time - time.mean()) / max(float(np.ptp(time)), 1e-12)
        off = (fit.blocks.planes[plane] - contact.predicted[plane])[corner]
        found[plane] = np.asarray(x @ (off - off.mean(axis=0)) / (x @ x))
    return found
