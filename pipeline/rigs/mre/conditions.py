"""Conditions that the MRE experiments share: current, preload, the pads."""

from __future__ import annotations

from pipeline.rigs.experiment import ConditionSpec, Range

SIZE = Range(0, 1, above=True)
COIL_CURRENT = ConditionSpec("coil_current", "A", "coil current as set", range=Range(-100, 100))
PRELOAD = ConditionSpec("preload", "N", "axial load on the pads at 0 A", range=Range(0, 1e6))
SAMPLE: tuple[ConditionSpec, ...] = (
    ConditionSpec("pad_diameter", "m", "diameter of a pad", range=SIZE),
    ConditionSpec("pad_height", "m", "height of a pad", range=SIZE),
    ConditionSpec("powder_fraction", "1", "volume fraction of iron powder", range=Range(0, 1)),
    ConditionSpec("matrix_shear_modulus", "Pa", "shear modulus of the matrix", range=Range(1e3, 1e9)),
    ConditionSpec("poisson_ratio", "1", "Poisson's ratio", range=Range(-1, 0.5)),
    ConditionSpec("pad_id", "", "which pads"),
    ConditionSpec("sequence_index", "1", "order of the runs (Mullins effect, heating)"),
)
"""The pads and the order of the runs."""
MICROMECHANICS: tuple[ConditionSpec, ...] = (
    ConditionSpec("gap_ratio", "1", "distance of neighbours in a chain over their diameter", range=Range(1, 10)),
    ConditionSpec("powder_saturation", "T", "saturation polarisation of the powder", range=Range(0, 3, above=True)),
    ConditionSpec("powder_permeability", "1", "relative permeability of the powder", range=Range(1, 1e6, above=True)),
    ConditionSpec(
        "flux_per_current", "T/A", "flux density per coil current, where none is logged", range=Range(0, 10, above=True)
    ),
)
"""Optional, for the micromechanical model."""
