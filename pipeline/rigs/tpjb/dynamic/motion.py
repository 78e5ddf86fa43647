"""From the amplitudes of single probes and accelerometers to displacement and acceleration in x and y.

Judges the sensors by their answers to the tones; a bad one is left out and said.
"""

from __future__ import annotations

import numpy as np

from pipeline.errors import listing
from pipeline.recording import Recording
from pipeline.rigs.tpjb.dynamic.record import Record, in_xy
from pipeline.rigs.tpjb.probe_faults import probe_faults
from pipeline.rigs.tpjb.probes import GAPS, Probes, probes_of

ACCELEROMETERS = ("acc_ua", "acc_ub", "acc_va", "acc_vb")
# Stiffness that a bearing may have, N/m.
PLAUSIBLE = (1e7, 1e11)
# Share of the displacement by which the planes may move apart; of the other, by which two accelerometers may.
_PITCH, _PAIR = 0.05, 0.05
# The stator moves about as much as it moves against the shaft, and more where the shaft is on a soft support.
_STATOR_RATIO = (0.4, 5.0)


def displacement_of(record: Record, recording: Recording) -> tuple[np.ndarray, np.ndarray, Probes]:
    """Return the displacement at tones and at second-order products, shapes (B, k, 2) and (B, p, 2), m.

    Raises
    ------
    InputError
        If u or v has no sound probe.
    """
    names = tuple(name for name in GAPS if name in record.amplitudes)
    amplitude = np.stack([record.amplitudes[name] for name in names], axis=-1)[record.usable] if names else None
    excluded: tuple[str, ...] = ()
    if amplitude is not None and amplitude.size:
        flat = amplitude.reshape(-1, len(names))
        covariance = 0.5 * (flat.conj().T @ flat).real / max(len(amplitude), 1)
        force = record.force[record.usable].reshape(-1, 2)
        pull = np.array([0.5 * (flat[:, i].conj() @ force[:, "uv".index(n[4])]).real for i, n in enumerate(names)])
        judged = probe_faults(names, covariance, with_force=pull / max(len(amplitude), 1), run=record.run)
        record.quality += judged.findings
        excluded = judged.excluded
    probes = probes_of(names, recording.conditions, excluded, record.run)
    record.quality += probes.findings
    if len(probes.planes) < 2:
        record.say(
            "warning",
            "probes in one plane only: a pitching stator would bias all coefficients by as much as that plane moves off the "
            "middle, which cannot be seen.",
        )
    _pitching(record, probes)
    tones, products = (
        np.stack([table[name] for name in probes.names], axis=-1) @ probes.displacement.T
        for table in (record.amplitudes, record.products)
    )
    return tones, products, probes


def _pitching(record: Record, probes: Probes) -> None:
    if len(probes.planes) < 2 or not record.usable.any():
        return
    amplitude = np.stack([record.amplitudes[name] for name in probes.names], axis=-1)[record.usable]
    one, two = ((amplitude @ probes.planes[p].T).mean(axis=0) for p in (1, 2))
    share = float(np.linalg.norm(two - one) / np.linalg.norm(two + one))
    if share > _PITCH:
        record.say(
            "warning",
            f"pitching motion: the probe planes move {100 * share:.2g} % of the displacement off their mean (more than 5 %). "
            "Check the pitch stabilisers and the line of the actuators.",
        )


def acceleration_of(record: Record, displacement: np.ndarray) -> np.ndarray | None:
    """Return the stator's acceleration, shape (B, k, 2), m/s^2; None (and why, in the record) without it.

    Two accelerometers of an axis are averaged; where they differ by more than 5 % the one that fits
    the displacement better is taken.
    """
    along = []
    d_uv = _uv(displacement)
    w = 2 * np.pi * record.tones
    for number, axis in enumerate("uv"):
        names = [name for name in ACCELEROMETERS if name[4] == axis and name in record.amplitudes]
        rough = -(w**2) * d_uv[..., number]
        ratios = {name: _ratio(record.amplitudes[name][record.usable], rough[record.usable]) for name in names}
        sound = [name for name in names if _STATOR_RATIO[0] < ratios[name] < _STATOR_RATIO[1]]
        # All of an axis inverted: whether they or the probes are, the impedance tells.
        sound = sound or [name for name in names if -_STATOR_RATIO[1] < ratios[name] < -_STATOR_RATIO[0]]
        if not names:
            record.no_acceleration = (
                f"no accelerometer along {axis}: the inertia of the stator cannot be taken off the force."
            )
            record.say("warning", record.no_acceleration)
            return None
        if not sound:
            record.no_acceleration = _implausible(axis, ratios) + _stiffness_hint(record, displacement)
            record.say("error", record.no_acceleration, names[0])
            return None
        _say_unsound(record, axis, names, sound, ratios)
        sound = _agreeing(record, sound, ratios)
        along.append(np.mean([record.amplitudes[name] for name in sound], axis=0))
    return in_xy(along[0], along[1])


def _uv(xy: np.ndarray) -> np.ndarray:
    from pipeline.rigs.tpjb.axes import FROM_UV

    return np.asarray(xy @ FROM_UV)


def _ratio(acceleration: np.ndarray, rough: np.ndarray) -> float:
    """Return the real share of `acceleration` in -w^2 d, weighted by size."""
    power = float((np.abs(rough) ** 2).sum())
    return float((rough.conj() * acceleration).sum().real / power) if power > 0 else 0.0


def opposed(acceleration: np.ndarray, rough: np.ndarray) -> str:
    """Return why the acceleration cannot be the stator's: it goes against `rough`, -w^2 d; '' where it does not."""
    share = _ratio(acceleration, rough)
    if share >= 0:
        return ""
    return (
        f"the acceleration is {share:.2g} times -w^2 d, against the displacement, which follows the force: the acceleration is of the "
        "wrong sign (or forces and gaps both are)"
    )


def _implausible(axis: str, ratios: dict[str, float]) -> str:
    ratio = next(iter(ratios.values()))
    hint = ""
    for factor, unit in ((9.80665, "in g but read as m/s^2"), (1 / 9.80665, "in m/s^2 but read as g")):
        if _STATOR_RATIO[0] < ratio * factor < _STATOR_RATIO[1]:
            hint = f" As if it were {unit}."
    if ratio < -_STATOR_RATIO[0]:
        hint = " As if its sign were inverted."
    if abs(ratio) < 0.02:
        hint = " As if it were not connected."
    return (
        f"{listing(ratios)}: {ratio:.2g} times -w^2 d along {axis}, where a stator on a film moves "
        f"{_STATOR_RATIO[0]:g} to {_STATOR_RATIO[1]:g} times that.{hint} Unit or sign of the acceleration? The inertia of the "
        "stator cannot be taken off."
    )


def _stiffness_hint(record: Record, displacement: np.ndarray) -> str:
    """Return a hint at the unit of the gaps or forces where force over displacement cannot be a bearing's."""
    moved = float(np.linalg.norm(displacement[record.usable]))
    stiffness = float(np.linalg.norm(record.force[record.usable])) / moved if moved > 0 else np.inf
    if PLAUSIBLE[0] < stiffness < PLAUSIBLE[1]:
        return ""
    return f" Force over displacement is {stiffness:.2g} N/m: unit of the gaps (um, mil = 25.4 um) or forces?"


def _say_unsound(record: Record, axis: str, names: list[str], sound: list[str], ratios: dict[str, float]) -> None:
    for name in names:
        if name not in sound:
            text = _implausible(axis, {name: ratios[name]}).split(" The inertia")[0]
            record.say("warning", f"{text} {listing(sound)} alone is used.", name)
    if len(names) == 1:
        record.say("note", f"{names[0]} is the only accelerometer along {axis}: a pitching stator would bias it.")


def _agreeing(record: Record, sound: list[str], ratios: dict[str, float]) -> list[str]:
    if len(sound) < 2:
        return sound
    a, b = (record.amplitudes[name][record.usable] for name in sound)
    apart = float(abs((a.conj() * (b - a)).sum()) / np.linalg.norm(a) ** 2)  # noise of either averages out
    if apart > _PAIR:
        text = (
            f"{listing(sound)} differ by {100 * apart:.2g} % ({listing(f'{ratios[n]:.3g}' for n in sound)} times -w^2 d): "
            "one of them is wrong, or the stator pitches; their mean is used. Calibrate them."
        )
        record.say("warning", text, sound[0])
    return sound
