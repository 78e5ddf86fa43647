"""Which excitation each block is under, told by the forces themselves, and which blocks are fit for use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

IN_PHASE, ANTIPHASE, U_ONLY, V_ONLY, OTHER, QUIET = "in_phase", "antiphase", "u_only", "v_only", "other", "quiet"
# Pairs of excitations that tell both columns of H, the usual one first.
PAIRS: tuple[tuple[str, str], ...] = (
    (IN_PHASE, ANTIPHASE),
    (U_ONLY, V_ONLY),
    (IN_PHASE, U_ONLY),
    (IN_PHASE, V_ONLY),
    (ANTIPHASE, U_ONLY),
)
PAIRS += ((ANTIPHASE, V_ONLY), (OTHER, IN_PHASE), (OTHER, ANTIPHASE))

# How alike the steps of a tone's phase are from block to block before it is believed to move; 0 for noise.
_STEADY = 0.8


def excitation_of(force_u: np.ndarray, force_v: np.ndarray) -> list[str]:
    """Return the excitation of each block from its amplitudes along u and v, shape (B, k) each."""
    uu, vv = (np.abs(force_u) ** 2).sum(axis=1), (np.abs(force_v) ** 2).sum(axis=1)
    cross = (force_u * force_v.conj()).sum(axis=1)
    loudest = np.nanmax(uu + vv, initial=0.0)
    kinds = []
    for u, v, uv in zip(uu, vv, cross, strict=True):
        together = uv.real / np.sqrt(u * v) if u > 0 and v > 0 else 0.0
        if not u + v > 0.0025 * loudest:
            kinds.append(QUIET)
        elif v < 0.04 * u:
            kinds.append(U_ONLY)
        elif u < 0.04 * v:
            kinds.append(V_ONLY)
        else:
            kinds.append(IN_PHASE if together > 0.7 else ANTIPHASE if together < -0.7 else OTHER)
    return kinds


@dataclass(frozen=True)
class OddBlock:
    """A block that is not used: its number, the channel that shows it, and what is odd."""

    block: int
    channel: str
    reason: str


def odd_blocks(names: Sequence[str], residual: np.ndarray, size: np.ndarray, usable: np.ndarray) -> list[OddBlock]:
    """Name blocks where a channel holds far more or far less than lines and its usual noise.

    Parameters
    ----------
    names
        The c channels.
    residual
        What the lines leave, standard deviation, shape (B, c).
    size
        Of the tones, shape (c,): what is left is rounding where it is a millionth of that.
    usable
        Blocks that are judged, shape (B,) bool.
    """
    found: dict[int, OddBlock] = {}
    for column, name in enumerate(names):
        level = residual[usable, column]
        if level.size < 4 or not np.median(level) > 1e-6 * size[column]:
            continue
        typical = float(np.median(level))
        spread = max(1.4826 * float(np.median(np.abs(level - typical))), 0.03 * typical)
        for b in np.flatnonzero(usable):
            value = residual[b, column]
            if value > typical + 8 * spread and value > 1.5 * typical:
                reason = f"holds {value / typical:.1f} times its usual noise (a jump, a spike, or the drive changed)"
                found.setdefault(int(b), OddBlock(int(b), name, reason))
            elif value < 0.02 * typical:
                found.setdefault(int(b), OddBlock(int(b), name, "holds no noise (stuck or off)"))
    return [found[b] for b in sorted(found)]


def unlike_drive(force: np.ndarray, kinds: Sequence[str], usable: np.ndarray, tolerance: float = 0.2) -> list[int]:
    """Return blocks whose force differs in size from the others of their kind (switched on or over within).

    `force` are amplitudes along u and v, shape (B, k, 2).
    """
    size = np.sqrt((np.abs(force) ** 2).sum(axis=1))
    out = []
    for kind in set(kinds):
        members = [b for b in np.flatnonzero(usable).tolist() if kinds[b] == kind]
        if len(members) < 4:
            continue
        typical = np.median(size[members], axis=0)
        off = np.abs(size[members] - typical) > tolerance * typical.max()
        out += [int(b) for b, bad in zip(members, off.any(axis=1), strict=True) if bad]
    return sorted(out)


def stretches(kinds: Sequence[str], usable: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return runs of neighbouring blocks of one kind, odd ones between them skipped: kind and numbers."""
    out: list[tuple[str, list[int]]] = []
    for b in np.flatnonzero(usable).tolist():
        if out and out[-1][0] == kinds[b]:
            out[-1][1].append(b)
        else:
            out.append((kinds[b], [b]))
    return [(kind, np.array(members)) for kind, members in out if kind != QUIET]


def phase_advance(force: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Return what each tone's phase gains from block to block, turns, shape (k,), over neighbouring blocks.

    `force` are amplitudes, shape (B, k, 2), of blocks numbered `blocks`.
    """
    steps = np.zeros(force.shape[1], dtype=complex)
    sizes = np.zeros(force.shape[1])
    for i in range(blocks.size - 1):
        if blocks[i + 1] == blocks[i] + 1:
            steps += (force[i].conj() * force[i + 1]).sum(axis=1)
            sizes += np.linalg.norm(force[i], axis=1) * np.linalg.norm(force[i + 1], axis=1)
    steady = np.abs(steps) > _STEADY * sizes
    return np.where(steady & (sizes > 0), np.angle(steps) / (2 * np.pi), 0.0)


def aligned(force: np.ndarray, reference: np.ndarray | None) -> np.ndarray:
    """Return the factor of each tone, shape (k,), that turns mean amplitudes `force` into phase with `reference`.

    Both have the shape (k, 2). Records have no common origin of time; H does not see such a factor.
    """
    if reference is None:
        return np.ones(force.shape[0], dtype=complex)
    product = (force.conj() * reference).sum(axis=1)
    size = np.abs(product)
    return np.where(size > 0, product / np.where(size > 0, size, 1.0), 1.0)
