"""One gearbox log -> its three boards: torques, encoder, vibration, each on its own clock.

Nothing is aligned, filtered or judged here; samples that are no numbers are bridged and told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.recording import Condition, QualityFinding, Recording

TORQUES = ("torque_in", "torque_out")
COUNT, SPEED = "encoder_count_out", "speed_out"
VIBRATIONS = ("acc_in_radial", "acc_in_axial", "acc_out_radial", "acc_out_axial", "acc_load_radial")
_PPR = 128.0
_DECODINGS = (1.0, 2.0, 4.0)
_LEAST_SECONDS = 2.0
_MOST_LOST = 0.2


@dataclass(frozen=True, eq=False)
class Signal:
    """Channels of one board: `time` of shape (n,), s of the board's own clock, and values of shape (n,) each, SI."""

    time: np.ndarray
    values: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.values[name]

    def __contains__(self, name: str) -> bool:
        return name in self.values

    @property
    def rate(self) -> float:
        """Samples per second, from the median step."""
        return float(1.0 / np.median(np.diff(self.time)))

    @property
    def span(self) -> tuple[float, float]:
        """Time of the first and of the last sample, s."""
        return float(self.time[0]), float(self.time[-1])

    def part(self, start: float, end: float) -> Signal:
        """Return the samples with ``start <= time <= end``."""
        inside = slice(int(np.searchsorted(self.time, start)), int(np.searchsorted(self.time, end, side="right")))
        return Signal(self.time[inside], {name: values[inside] for name, values in self.values.items()})

    def emptied(self) -> Signal:
        """Return the same channels without a sample."""
        return Signal(np.zeros(0), dict.fromkeys(self.values, np.zeros(0)))

    def on_clock(self, shift: float, drift: float = 0.0) -> Signal:
        """Return the same samples at ``time * (1 + drift) + shift``."""
        return Signal(self.time * (1.0 + drift) + shift, self.values)


@dataclass(frozen=True, eq=False)
class Record:
    """One usable run.

    Attributes
    ----------
    torque
        `torque_in` and `torque_out`, N m, on the clock of `torque_in`.
    encoder
        `encoder_count_out` (cumulative counts) where the log has it, else `speed_out`, rad/s.
    vibration, speed_in, brake_force
        None where the log has none.
    bridged
        Torque channel -> where straight lines stand for samples that are no numbers, s.
    counts_per_turn
        Pulses per turn times decoding; 0 where there are no counts.
    """

    run: str
    torque: Signal
    encoder: Signal
    vibration: Signal | None = None
    speed_in: Signal | None = None
    brake_force: Signal | None = None
    conditions: Mapping[str, Condition] = field(default_factory=dict)
    counts_per_turn: float = 0.0
    findings: tuple[QualityFinding, ...] = ()
    bridged: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    @property
    def has_counts(self) -> bool:
        """Tell whether the encoder gives counts and not a speed."""
        return COUNT in self.encoder

    @property
    def speed_nominal(self) -> float | None:
        """Nominal input speed as set, rad/s; None where the run does not say."""
        value = self.conditions.get("speed_nominal")
        return float(value) if isinstance(value, int | float) and value > 0 else None

    def emptied(self) -> Record:
        """Return the record without its samples: which boards there are, conditions and findings stay."""
        boards = {name: getattr(self, name) for name in ("torque", "encoder", "vibration", "speed_in", "brake_force")}
        return replace(self, **{name: board.emptied() for name, board in boards.items() if board is not None})

    def aligned(self, encoder: Signal, vibration: Signal | None) -> Record:
        """Return the record with encoder and vibration brought to the clock of the torques."""
        return replace(self, encoder=encoder, vibration=vibration)


def record_of(recording: Recording) -> Record:
    """Return the boards of a run.

    Raises
    ------
    InputError
        If a torque or the encoder is missing, too short or mostly no numbers.
    """
    run, findings = recording.run, list[QualityFinding]()
    missing = [name for name in TORQUES if name not in recording]
    if missing:
        raise InputError(
            f"run '{run}' has no channel {listing(missing)}; both shaft torques are needed. It has "
            f"{listing(channel.name for channel in recording)}. Map them in the recipe."
        )
    torque = _signal(recording, TORQUES, findings)
    if COUNT not in recording and SPEED not in recording:
        raise InputError(
            f"run '{run}' has neither '{COUNT}' nor '{SPEED}': without the output shaft's motion no stage can be told. "
            "Map one of them in the recipe."
        )
    encoder = _encoder(recording, findings)
    names = tuple(name for name in VIBRATIONS if name in recording)
    record = Record(
        run,
        torque,
        encoder,
        _signal(recording, names, findings) if names else None,
        _signal(recording, ("speed_in",), findings) if "speed_in" in recording else None,
        _signal(recording, ("brake_force",), findings) if "brake_force" in recording else None,
        dict(recording.conditions),
        bridged={name: _bridged(*recording.signal(name)) for name in TORQUES},
    )
    turn = _counts_per_turn(record, findings) if record.has_counts else 0.0
    return replace(record, counts_per_turn=turn, findings=tuple(findings))


def _signal(recording: Recording, names: Sequence[str], findings: list[QualityFinding]) -> Signal:
    """Return channels on the time of the first; NaNs are bridged by straight lines."""
    time = np.asarray(recording.signal(names[0])[0], dtype=float)
    if time.size < 10 or time[-1] - time[0] < _LEAST_SECONDS:
        raise InputError(
            f"run '{recording.run}', channel '{names[0]}': {time.size} samples over "
            f"{np.ptp(time) if time.size else 0.0:.3g} s; at least {_LEAST_SECONDS:g} s are needed."
        )
    values = {}
    for name in names:
        own, found = recording.signal(name)
        good = np.isfinite(found)
        if good.mean() < 1.0 - _MOST_LOST:
            raise InputError(
                f"run '{recording.run}', channel '{name}': {100 * (1 - good.mean()):.0f} % of the samples are no numbers."
            )
        if not good.all():
            lost = own[~good]
            text = (
                f"{(~good).sum()} samples are no numbers ({name}, {lost.min():.5g} to {lost.max():.5g} s); straight lines were put in their "
                "place"
            )
            findings.append(
                QualityFinding("warning", text, recording.run, name, (float(lost.min()), float(lost.max())))
            )
        whole = good.all() and (own is time or np.array_equal(own, time))
        values[name] = np.asarray(found if whole else np.interp(time, own[good], found[good]), dtype=float)
    return Signal(time, values)


def _bridged(time: np.ndarray, values: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Return from which number to which the samples between are none, s."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~np.isfinite(values), [False]]).astype(np.int8)))
    last = time.size - 1
    return tuple(
        (float(time[max(a - 1, 0)]), float(time[min(b, last)])) for a, b in zip(edges[0::2], edges[1::2], strict=True)
    )


def _encoder(recording: Recording, findings: list[QualityFinding]) -> Signal:
    """Return the counts, or the speed, without samples that are no numbers (a line through counts needs none)."""
    name = COUNT if COUNT in recording else SPEED
    time, values = recording.signal(name)
    good = np.isfinite(values)
    if good.sum() < 20 or np.ptp(time[good]) < _LEAST_SECONDS:
        raise InputError(
            f"run '{recording.run}', channel '{name}': {good.sum()} usable samples; at least {_LEAST_SECONDS:g} s are needed."
        )
    if not good.all():
        lost = time[~good]
        text = f"{(~good).sum()} samples of {name} from {lost.min():.5g} to {lost.max():.5g} s are no numbers and are left out"
        findings.append(QualityFinding("warning", text, recording.run, name, (float(lost.min()), float(lost.max()))))
    return Signal(np.asarray(time[good], dtype=float), {name: np.asarray(values[good], dtype=float)})


def _counts_per_turn(record: Record, findings: list[QualityFinding]) -> float:
    """Return counts per turn; an unknown decoding is the one whose speed lies nearest to the nominal one."""
    ppr = _number(record.conditions.get("encoder_ppr")) or _PPR
    decoding = _number(record.conditions.get("encoder_decoding"))
    if decoding:
        return ppr * decoding
    nominal = record.speed_nominal
    if nominal is None:
        text = "neither encoder_decoding nor speed_nominal is given: x4 decoding is assumed; speeds hang on it"
        findings.append(QualityFinding("warning", text, record.run, COUNT))
        return 4.0 * ppr
    time, counts = record.encoder.time, record.encoder[COUNT]
    step = max(1, round(0.5 * record.encoder.rate))
    rates = np.abs(counts[step:] - counts[:-step]) / (time[step:] - time[:-step])
    turn = 2.0 * np.pi * float(np.percentile(rates, 90)) / nominal
    decoding = min(_DECODINGS, key=lambda k: abs(np.log(max(turn, 1.0) / (ppr * k))))
    text = f"encoder_decoding is not given: x{decoding:g} fits speed_nominal best and is used"
    findings.append(QualityFinding("note", text, record.run, COUNT))
    return ppr * decoding


def _number(value: Condition | None) -> float | None:
    return float(value) if isinstance(value, int | float) and value > 0 else None
