"""The synthetic radio: samples in packets with a counter that wraps, lost in bursts, or not sent at all."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tire.synthetic.truth import TireTruth


def lost_packets(n: int, loss: float, burst: float, rng: np.random.Generator) -> np.ndarray:
    """Return which of n packets are lost, bool, shape (n,): a Gilbert-Elliott channel that loses all while it is bad.

    Parameters
    ----------
    loss, burst
        Share of packets lost; mean length of a loss, packets.
    """
    lost = np.zeros(n, dtype=bool)
    if loss == 0.0:
        return lost
    good = burst * (1.0 - loss) / loss
    at = int(rng.geometric(min(1.0, 1.0 / good)))
    while at < n:
        length = int(rng.geometric(1.0 / burst))
        lost[at : at + length] = True
        at += length + int(rng.geometric(min(1.0, 1.0 / good)))
    return lost


def received(
    truth: TireTruth, time: np.ndarray, flex: np.ndarray, rest: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples that arrive (index, shape (m,)) and the packet counter of each, shape (m,).

    Parameters
    ----------
    time, flex
        Time (s) and voltage (V) of all samples, shape (n,) each; samples that fill no packet are never sent.
    rest
        Voltage (V) at which a gated transmitter sleeps.
    """
    frames = truth.frames_per_packet
    n = flex.size // frames
    first = int(rng.integers(0, 1 << min(truth.counter_bits, 62)))
    sent = np.ones(n, dtype=bool)
    if truth.gated:
        sent = np.abs(flex[: n * frames].reshape(n, frames) - rest).max(axis=1) > truth.gate
    counter = np.arange(n) if truth.gated_counts else np.cumsum(sent) - 1
    arrives = sent & ~lost_packets(n, truth.loss, truth.burst, rng)
    if len(truth.silence) == 2:
        begins = time[: n * frames : frames]
        arrives &= (begins < truth.silence[0]) | (begins >= truth.silence[1])
    kept = np.flatnonzero(arrives)
    index = (kept[:, None] * frames + np.arange(frames)).ravel()
    return index, np.repeat((first + counter[kept]) % 2**truth.counter_bits, frames)
