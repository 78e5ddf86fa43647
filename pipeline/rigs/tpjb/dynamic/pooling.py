"""Blocks of all runs of one operating point, gathered by excitation and brought into phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import InputError, listing, nearest
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tpjb.conditions import mean_of
from pipeline.rigs.tpjb.dynamic import excitation
from pipeline.rigs.tpjb.dynamic.motion import ACCELEROMETERS, acceleration_of, displacement_of
from pipeline.rigs.tpjb.dynamic.record import Record, in_xy
from pipeline.rigs.tpjb.dynamic.sorting import read_record
from pipeline.rigs.tpjb.probes import GAPS, probes_of

# Blocks that an excitation must have; share by which the static force may differ from what the run states.
_LEAST_BLOCKS, _LOAD = 3, 0.02
_MODES = (excitation.IN_PHASE, excitation.ANTIPHASE, excitation.U_ONLY, excitation.V_ONLY)


@dataclass(eq=False)
class Pool:
    """Blocks of one operating point for each of two excitations.

    Attributes
    ----------
    tones, products
        Hz, shape (k,), (p,).
    force, displacement, acceleration
        By excitation: amplitudes in x and y, shape (B, k, 2); accelerations are None where they are unknown.
    at_products
        By excitation: displacement at second-order products, shape (B, p, 2), for each stretch of one record.
    dropped
        Tones that are not used, with the reason.
    missing
        Why no impedance can be told; '' where it can.
    """

    at: dict[str, float | str | bool]
    members: list[Recording]
    records: list[Record]
    tones: np.ndarray
    products: np.ndarray
    shaft: float | None
    kinds: tuple[str, ...] = ()
    force: list[np.ndarray] = field(default_factory=list)
    displacement: list[np.ndarray] = field(default_factory=list)
    acceleration: list[np.ndarray] | None = None
    at_products: list[list[np.ndarray]] = field(default_factory=list)
    dropped: dict[float, str] = field(default_factory=dict)
    missing: str = ""

    @property
    def label(self) -> str:
        """The operating point for people: ``40 kN, 104.7 rad/s``."""
        parts = [str(self.at["bearing"])] if "bearing" in self.at else []
        if "static_load" in self.at:
            parts.append(f"{float(self.at['static_load']) / 1e3:g} kN")
        if "shaft_speed" in self.at:
            parts.append(f"{float(self.at['shaft_speed']):g} rad/s")
        return ", ".join(parts) or "all runs"

    @property
    def blocks(self) -> tuple[int, ...]:
        """How many blocks each excitation has."""
        return tuple(blocks.shape[0] for blocks in self.force)


@dataclass(eq=False)
class _Gathered:
    """Parts of one excitation, each brought into phase with the first."""

    reference: np.ndarray | None = None
    force: list[np.ndarray] = field(default_factory=list)
    displacement: list[np.ndarray] = field(default_factory=list)
    acceleration: list[np.ndarray | None] = field(default_factory=list)
    products: list[np.ndarray] = field(default_factory=list)

    def add(self, F: np.ndarray, D: np.ndarray, A: np.ndarray | None, products: np.ndarray) -> None:
        mean = F.mean(axis=0)
        factor = excitation.aligned(mean, self.reference)[None, :, None]
        if self.reference is None:
            self.reference = mean
        self.force.append(F * factor)
        self.displacement.append(D * factor)
        self.acceleration.append(None if A is None else A * factor)
        self.products.append(products)


def pool(at: dict[str, float | str | bool], members: Sequence[Recording], orders: int) -> tuple[Pool, dict[str, str]]:
    """Read the runs of one operating point; return what they hold, and why runs were left out.

    Raises
    ------
    InputError
        If none of them can be read.
    """
    records: list[tuple[Recording, Record]] = []
    left_out: dict[str, str] = {}
    for recording in members:
        try:
            records.append((recording, read_record(recording, [*GAPS, *ACCELEROMETERS], orders)))
            probes_of(records[-1][1].amplitudes, recording.conditions, run=recording.run)
        except InputError as error:
            left_out[recording.run] = str(error)
            records = [entry for entry in records if entry[0] is not recording]
    if not records:
        raise InputError(next(iter(left_out.values())))
    kept, columns, dropped = _common_tones([record for _, record in records])
    shafts = [record.shaft for _, record in records if record.shaft]
    found = Pool(
        at,
        [recording for recording, _ in records],
        [record for _, record in records],
        kept,
        records[0][1].others,
        float(np.mean(shafts)) if shafts else None,
        dropped=dropped,
    )
    for recording, record in records:
        check_state(record, recording)
    found.missing = _missing_direction(found.records)
    clipped = " ".join(record.unusable for record in found.records if record.unusable)
    if found.missing and clipped:
        found.missing = clipped
    if not found.missing:
        _gather(found, records, columns)
    return found, left_out


def _gather(found: Pool, records: Sequence[tuple[Recording, Record]], columns: Sequence[np.ndarray]) -> None:
    """Fill the pool with the blocks of the pair of excitations that tells both directions."""
    gathered: dict[str, _Gathered] = {}
    for (recording, record), pick in zip(records, columns, strict=True):
        if record.unusable:
            continue
        D, products, _ = displacement_of(record, recording)
        A = acceleration_of(record, D)
        F = in_xy(record.amplitudes["force_u"], record.amplitudes["force_v"])
        same = record.others.shape == found.products.shape and np.allclose(record.others, found.products)
        for kind, blocks in excitation.stretches(record.kinds, record.usable):
            rows = np.ix_(blocks, pick)
            at_products = products[blocks] if same else np.zeros((0, found.products.size, 2))
            turned = _unwound(F[rows], D[rows], None if A is None else A[rows], blocks)
            gathered.setdefault(kind, _Gathered()).add(*turned, at_products)
    _choose_pair(found, gathered)


def _common_tones(records: Sequence[Record]) -> tuple[np.ndarray, list[np.ndarray], dict[float, str]]:
    """Return the tones that all runs have, where they stand in each run, and the others with the reason."""
    first = records[0].tones
    dropped = {tone: reason for record in records for tone, reason in record.dropped.items()}
    near = [np.abs(first[:, None] - record.tones).argmin(axis=1) for record in records]
    common = np.ones(first.size, dtype=bool)
    for record, index in zip(records, near, strict=True):
        common &= np.abs(record.tones[index] - first) < 0.05
        for tone in record.tones:
            if np.abs(first - tone).min() >= 0.05 and not any(abs(tone - f) < 0.05 for f in dropped):
                dropped[float(tone)] = f"not in every run of this operating point (in '{record.run}')"
    for tone in first[~common]:
        if not any(abs(tone - f) < 0.05 for f in dropped):
            dropped[float(tone)] = "not in every run of this operating point"
    if not common.any():
        names = listing(record.run for record in records)
        raise InputError(f"runs {names} share no tone; both excitations must have the same tones.")
    return first[common], [index[common] for index in near], dropped


def check_state(record: Record, recording: Recording) -> None:
    """Say it where forces show another excitation or static load than the run states."""
    stated = recording.conditions.get("static_load")
    measured = mean_of(recording, "force_static")
    if isinstance(stated, float) and measured is not None and abs(measured - stated) > _LOAD * abs(stated):
        text = f"the static force is {measured:.4g} N, the run states a static load of {stated:.4g} N."
        record.say("warning", text, "force_static")
    shown = {kind for kind, used in zip(record.kinds, record.usable, strict=True) if used}
    readable = {excitation.U_ONLY: "force along u only", excitation.V_ONLY: "force along v only"}
    seen = listing(readable.get(kind, kind.replace("_", "-")) for kind in sorted(shown))
    stated_mode = str(recording.conditions.get("mode") or "").strip()
    mode = _mode_of(stated_mode)
    if mode not in ("", *_MODES):
        text = f"mode '{stated_mode}' is not known.{nearest(mode, _MODES)} Known are {listing(_MODES)}"
        record.say("warning", f"{text}; the forces show {seen or 'none'} and are believed.")
    elif mode and shown and mode not in shown:
        off = {excitation.U_ONLY: "v", excitation.V_ONLY: "u"}
        hint = next((f" Is the actuator along {off[kind]} off?" for kind in shown if kind in off), "")
        text = f"the run states mode {mode.replace('_', '-')}, its forces show {seen}; the forces are believed.{hint}"
        record.say("warning", text)


def _mode_of(text: str) -> str:
    """Return a mode as written in the way this module writes it."""
    plain = text.lower().replace("-", "_").replace(" ", "_").replace("inphase", "in_phase")
    return plain.replace("anti_phase", excitation.ANTIPHASE).replace("out_of_phase", excitation.ANTIPHASE)


def _unwound(
    F: np.ndarray, D: np.ndarray, A: np.ndarray | None, blocks: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Take out what the clocks of generator and logger drift apart, where it is worth a turn's tenth.

    Force, displacement and acceleration turn together, so H does not change; the means would fade.
    """
    advance = excitation.phase_advance(F, blocks)
    turns = advance * (blocks[-1] - blocks[0])
    slow = np.where(np.abs(turns) > 0.05, advance, 0.0)
    factor = np.exp(-2j * np.pi * slow * (blocks - blocks[0])[:, None])[..., None]
    return F * factor, D * factor, None if A is None else A * factor


def _missing_direction(records: Sequence[Record]) -> str:
    """Return why the excitations of all runs do not tell both directions; '' where they do."""
    counts: dict[str, int] = {}
    for record in records:
        for kind, blocks in excitation.stretches(record.kinds, record.usable):
            counts[kind] = counts.get(kind, 0) + blocks.size
    enough = {kind for kind, count in counts.items() if count >= _LEAST_BLOCKS}
    if any(set(pair) <= enough for pair in excitation.PAIRS):
        return ""
    have = listing(f"{kind.replace('_', '-')} ({count} blocks)" for kind, count in counts.items())
    off = {excitation.U_ONLY: "v", excitation.V_ONLY: "u"}
    hint = next(
        (f" Is the actuator along {off[kind]} off, or its force in another unit?" for kind in counts if kind in off), ""
    )
    return (
        f"excitations are not independent: the runs hold {have}. One excitation in phase and one in antiphase are needed, of at "
        f"least {_LEAST_BLOCKS} blocks each.{hint}"
    )


def _choose_pair(found: Pool, gathered: dict[str, _Gathered]) -> None:
    enough = {kind for kind, part in gathered.items() if sum(b.shape[0] for b in part.force) >= _LEAST_BLOCKS}
    pair = next(pair for pair in excitation.PAIRS if set(pair) <= enough)
    parts = [gathered[kind] for kind in pair]
    found.kinds = pair
    found.force = [np.concatenate(part.force) for part in parts]
    found.displacement = [np.concatenate(part.displacement) for part in parts]
    found.at_products = [part.products for part in parts]
    accelerations = [[a for a in part.acceleration if a is not None] for part in parts]
    if all(len(a) == len(part.force) for a, part in zip(accelerations, parts, strict=True)):
        found.acceleration = [np.concatenate(a) for a in accelerations]


def noticed(pools: Sequence[Pool]) -> list[QualityFinding]:
    """Return all that was noticed about the runs of pools."""
    return [finding for one in pools for record in one.records for finding in record.quality]
