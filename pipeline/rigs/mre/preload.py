"""Runs of other preloads, and the MR effect at equal force and at equal amplitude (mre.md T6).

The dynamic fit belongs to one preload; here the others get their own k2 and k_MR with its shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.mre.harmonic_fit import DynamicFit
from pipeline.rigs.mre.loop import Loop


@dataclass(frozen=True, eq=False)
class PreloadState:
    """Stiffness at one preload (N) and current (A).

    `secant` at the run's own amplitude and force (measured), `static` = k2 + k_MR(I) of the model at
    this preload, `secant_equal` = model at the amplitude of the 0 A run of this preload.
    """

    preload: float
    current: float
    runs: tuple[str, ...]
    amplitude: float
    force_amplitude: float
    secant: Estimate
    static: Estimate
    secant_equal: Estimate


@dataclass(frozen=True, eq=False)
class PreloadTable:
    """States by preload and current; `effects` are `mr_effect_force` and `mr_effect_amplitude` at
    {"coil_current", "preload"}.
    """

    states: tuple[PreloadState, ...]
    effects: tuple[Estimate, ...]


def split_by_preload(loops: Sequence[Loop], tolerance: float = 25.0) -> tuple[list[Loop], list[Loop]]:
    """Return the loops of the preload with most runs (the dynamic fit takes them) and the others."""
    raise NotImplementedError


def preload_table(fit: DynamicFit | None, loops: Sequence[Loop]) -> PreloadTable:
    """Compare currents at equal force and equal amplitude, per preload; `loops` are those of T6."""
    raise NotImplementedError
