"""One run read block by block: amplitudes of force, displacement and acceleration in x and y.

What excitation a block belongs to and what is fit for use is told by `excitation`; here the way from
channels to amplitudes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import Level, QualityFinding, Recording
from pipeline.rigs.tpjb.axes import FROM_UV
from pipeline.rigs.tpjb.dynamic import excitation, tones
from pipeline.rigs.tpjb.dynamic.blocks import BlockFits, Lines, fit_blocks
from pipeline.rigs.tpjb.dynamic.tones import BlockLength
from pipeline.rigs.tpjb.dynamic.turning import follow, shaft_of

FORCES = ("force_u", "force_v")
# Phase that a tone may gain within a block before it is taken for another frequency, turns.
_OFF_TONE = 0.02


@dataclass(eq=False)
class Record:
    """Amplitudes of one run, B blocks, k tones, c channels, and what was noticed.

    Attributes
    ----------
    tones, others
        Hz, shape (k,) and (p,): the tones, and the second-order products that are looked for.
    dropped
        Tones that are not used, with the reason.
    amplitudes, products
        By channel: shape (B, k) and (B, p), complex.
    residual
        By channel: standard deviation of what is left, shape (B,).
    kinds, usable
        Excitation of each block and whether it is used.
    unusable
        Why no block is used; '' where some are.
    no_acceleration
        Why the stator's acceleration is not known; '' where it is.
    """

    run: str
    tones: np.ndarray
    others: np.ndarray
    start: np.ndarray
    block: BlockLength
    shaft: float | None
    amplitudes: dict[str, np.ndarray]
    products: dict[str, np.ndarray]
    residual: dict[str, np.ndarray]
    kinds: list[str] = field(default_factory=list)
    usable: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    dropped: dict[float, str] = field(default_factory=dict)
    quality: list[QualityFinding] = field(default_factory=list)
    unusable: str = ""
    no_acceleration: str = ""

    def say(
        self, level: Level, message: str, channel: str | None = None, span: tuple[float, float] | None = None
    ) -> None:
        """Note something about this run."""
        self.quality.append(QualityFinding(level, message, self.run, channel, span))

    def span_of(self, blocks: Sequence[int] | np.ndarray) -> tuple[float, float]:
        """Return the time from the first to the last of `blocks`, s."""
        return float(self.start[min(blocks)]), float(self.start[max(blocks)] + self.block.length)

    @property
    def force(self) -> np.ndarray:
        """Force along u and v, shape (B, k, 2)."""
        return np.stack([self.amplitudes[name] for name in FORCES], axis=2)


def in_xy(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the x and y components, shape (..., 2), of amplitudes along u and v, shape (...) each."""
    return np.asarray(np.stack((u, v), axis=-1) @ FROM_UV.T)


def read_amplitudes(recording: Recording, channels: Sequence[str], orders: int, *, still: bool = False) -> Record:
    """Read one run.

    Parameters
    ----------
    channels
        Those to fit beside the forces, of those that the run has.
    orders
        Shaft orders that are fitted along.
    still
        The shaft does not turn, or is of no concern.

    Raises
    ------
    InputError
        If the run has no tone, or is too short for the blocks.
    """
    names = [*FORCES, *(name for name in channels if name in recording)]
    return _amplitudes(recording, names, orders, still)


def _amplitudes(recording: Recording, names: list[str], orders: int, still: bool) -> Record:
    noticed: list[QualityFinding] = []
    begin, end, worst = _span(recording, names)
    shaft, measured = (None, True) if still else shaft_of(recording, noticed)
    turning = shaft.frequency((begin + end) / 2, max((end - begin) / 2, 1e-3)) if shaft else None
    commanded = _tones(recording, noticed)
    kept, dropped, block = _kept_tones(recording.run, commanded, turning, orders, end - begin + worst)
    known = still or turning is not None or measured
    others = tones.second_order_products(kept, turning, orders, block.length) if known else np.zeros(0)
    lines = Lines(kept, shaft, orders, others)
    fits, names, said = _fitted(recording, names, lines, begin, block)
    again = False
    if shaft is not None and not measured and orders:
        lines = replace(lines, shaft=follow(recording, names, replace(lines, others=np.zeros(0)), begin, block))
        turning = lines.shaft.frequency((begin + end) / 2, end - begin) if lines.shaft else turning
        again = True
    force = np.stack([_of(fits, name, "tones") for name in FORCES], axis=2)
    advance = _advance(force)
    if np.abs(advance).max(initial=0.0) > _OFF_TONE:
        refined = kept + advance / block.length
        noticed.append(
            QualityFinding(
                "note",
                f"the tones in the force are {listing(f'{f:.4f}' for f in refined)} Hz, not "
                f"{listing(f'{f:g}' for f in kept)} Hz; those found are used.",
                recording.run,
            )
        )
        lines, again = replace(lines, tones=refined), True
    if again:
        fits, names, said = _fitted(recording, names, lines, begin, block)
    return Record(
        recording.run,
        lines.tones,
        others,
        fits[0].start,
        block,
        turning,
        {name: _of(fits, name, "tones") for name in names},
        {name: _of(fits, name, "others") for name in names},
        {name: _of(fits, name, "residual") for name in names},
        dropped=dropped,
        quality=[*noticed, *said],
    )


def _span(recording: Recording, names: Sequence[str]) -> tuple[float, float, float]:
    """Return where the streams of `names` begin and end together, s, and their largest step."""
    streams = {recording.stream_of(name).name: recording.stream_of(name) for name in names}.values()
    begin, end = max(s.span[0] for s in streams), min(s.span[1] for s in streams)
    step = max(s.duration / max(s.size - 1, 1) for s in streams)
    if not end > begin:
        raise InputError(f"run '{recording.run}': forces, gaps and accelerations have no time in common.")
    return begin, end, step


def _tones(recording: Recording, noticed: list[QualityFinding]) -> np.ndarray:
    commanded = tones.commanded_tones(recording)
    if commanded is not None and commanded.size:
        return commanded
    found = tones.tones_in(recording.stream_of("force_u"), FORCES)
    if not found.size:
        raise InputError(
            f"run '{recording.run}': no tone stands out of force_u or force_v and 'excitation_tones' is not given; is "
            "this a dynamic test? Give the tones, for example 'excitation_tones: 7 11 13 Hz'."
        )
    text = f"'excitation_tones' is not given; the forces hold {listing(f'{f:g}' for f in found)} Hz."
    noticed.append(QualityFinding("note", text, recording.run))
    return found


def _kept_tones(
    run: str, wanted: np.ndarray, shaft: float | None, orders: int, duration: float
) -> tuple[np.ndarray, dict[float, str], BlockLength]:
    """Return the tones that are apart from the shaft orders, the others with the reason, and the block."""
    block = tones.block_length(wanted, shaft, orders, duration)
    bad = tones.on_shaft_orders(wanted, shaft, orders, block.length)
    dropped = {}
    for tone in wanted[bad]:
        order = max(1, round(tone / shaft)) if shaft else 0
        dropped[float(tone)] = (
            f"within 2/T_b = {2 / block.length:.3g} Hz of shaft order {order} ({order * (shaft or 0):.4g} Hz)"
        )
    kept = wanted[~bad]
    if kept.size:
        block = tones.block_length(kept, shaft, orders, duration)
    if not kept.size:
        raise InputError(f"run '{run}': every tone stands on a shaft order; excite between the orders.")
    if block.blocks < tones.LEAST_BLOCKS:
        raise InputError(
            f"run '{run}': {duration:.4g} s hold {block.blocks} blocks of {block.length:.3g} s, which whole cycles of the tones "
            f"{listing(f'{f:g}' for f in kept)} Hz take; at least {tones.LEAST_BLOCKS} are needed for an error. Log longer."
        )
    return kept, dropped, block


def _fitted(
    recording: Recording,
    names: list[str],
    lines: Lines,
    begin: float,
    block: BlockLength,
) -> tuple[list[BlockFits], list[str], list[QualityFinding]]:
    """Fit each stream; channels that are mostly no number are left out, which the third part says."""
    said: list[QualityFinding] = []
    by_stream: dict[str, list[str]] = {}
    for name in names:
        by_stream.setdefault(recording.stream_of(name).name, []).append(name)
    fits = []
    for stream_name, members in by_stream.items():
        stream = recording.streams[stream_name]
        fit = fit_blocks(stream, members, lines, begin, block.length, block.blocks)
        empty = [name for name, count in zip(members, fit.invalid, strict=True) if count > 0.2 * stream.size]
        if set(empty) & set(FORCES):
            raise InputError(
                f"run '{recording.run}': {listing(empty)} hold no numbers; without both forces nothing can be told."
            )
        if empty:
            for name in empty:
                text = f"{name} is no number for more than a fifth of the log; it is left out."
                said.append(QualityFinding("warning", text, recording.run, name))
            members = [name for name in members if name not in empty]
            names = [name for name in names if name not in empty]
            if not members:
                continue
            fit = fit_blocks(stream, members, lines, begin, block.length, block.blocks)
        for name, count in zip(members, fit.invalid, strict=True):
            if count:
                text = f"{name} is no number in {count} samples; these rows do not count."
                said.append(QualityFinding("note", text, recording.run, name))
        fits.append(fit)
    return fits, names, said


def _of(fits: Sequence[BlockFits], name: str, what: str) -> np.ndarray:
    for fit in fits:
        if name in fit.names:
            return np.asarray(getattr(fit, what)[..., fit.names.index(name)])
    raise LookupError(name)


def _advance(force: np.ndarray) -> np.ndarray:
    valid = np.flatnonzero(np.isfinite(force).all(axis=(1, 2)))
    return excitation.phase_advance(force[valid], valid) if valid.size > 1 else np.zeros(force.shape[1])
