"""What a linear film cannot do: motion at sums and differences of the tones; and clocks that slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tpjb.dynamic.pooling import Pool


@dataclass(frozen=True, eq=False)
class Products:
    """Motion at second-order products under one excitation, shape (p,), m: amplitude and its noise.

    `share` is the motion at all of them over that at the tones, with its standard error.
    """

    kind: str
    frequency: np.ndarray
    amplitude: np.ndarray
    noise: np.ndarray
    share: float
    share_error: float


def second_order(pool: Pool) -> list[Products]:
    """Return the motion at second-order products for each excitation that has enough blocks.

    Coherent means within each stretch; what their scatter explains is taken off.
    """
    out = []
    for kind, parts, D in zip(pool.kinds, pool.at_products, pool.displacement, strict=True):
        means, noises = [], []
        for blocks in parts:
            if blocks.shape[0] > 2 and blocks.shape[1]:
                means.append((np.abs(blocks.mean(axis=0)) ** 2).sum(axis=1))
                noises.append((np.abs(blocks - blocks.mean(axis=0)) ** 2).sum(axis=(0, 2)) / blocks.shape[0])
                noises[-1] /= blocks.shape[0] - 1
        if not means:
            continue
        power, noise = np.mean(means, axis=0), np.mean(noises, axis=0)
        tones = float((np.abs(D.mean(axis=0)) ** 2).sum())
        excess = float((power - noise).sum())
        # The scatter of a sum of |mean|^2 about noise alone; with a signal s it grows by 2 s noise.
        spread = float(np.sqrt((noise**2 + 2 * np.maximum(power - noise, 0) * noise).sum() / len(means)))
        share = float(np.sqrt(max(excess, 0.0) / tones))
        error = spread / tones / (2 * share) if share**2 * tones > spread else float(np.sqrt(spread / tones))
        out.append(Products(kind, pool.products, np.sqrt(power), np.sqrt(noise), share, error))
    return out


def slip(pool: Pool, H: np.ndarray, keep: np.ndarray) -> tuple[float, float]:
    """Return how much later the displacement comes from second to second (s/s), and its standard error.

    The phase between measured displacement and that which the force explains, over time, all tones
    together; nothing but a slip of clocks makes it drift in proportion to frequency.

    Parameters
    ----------
    H
        Impedance, shape (k, 2, 2), for the tones `keep` of the pool, shape (all tones,) bool.
    """
    w = 2 * np.pi * pool.tones[keep]
    length = float(np.mean([record.block.length for record in pool.records]))
    inverse = np.linalg.inv(H)
    top = bottom = scatter = 0.0
    count = 0
    for F, D in zip(pool.force, pool.displacement, strict=True):
        explained = np.einsum("kij,bkj->bki", inverse, F[:, keep])
        late = -np.angle((explained.conj() * D[:, keep]).sum(axis=2)) / w
        weight = 1 / np.maximum(late.var(axis=0, ddof=1), 1e-30)
        mean = (late * weight).sum(axis=1) / weight.sum()
        time = length * (np.arange(mean.size) - (mean.size - 1) / 2)
        top += float(time @ mean)
        bottom += float(time @ time)
        count += mean.size - 2
        line = time * (time @ mean) / (time @ time) + mean.mean()
        scatter += float(((mean - line) ** 2).sum())
    slope = top / bottom
    return slope, float(np.sqrt(scatter / max(count, 1) / bottom))
