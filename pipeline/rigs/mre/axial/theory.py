"""E A/h of the pads by eq. (1), and what faces that cannot slip would make of it; where the conditions tell enough."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.recording import Condition
from pipeline.rigs.mre.micromechanics.dipoles import compound_modulus, young_modulus

_NEEDED = ("pad_diameter", "pad_height", "powder_fraction", "matrix_shear_modulus", "poisson_ratio")


@dataclass(frozen=True)
class Theory:
    """Young's modulus E (Pa), stiffness E A/h of the pads in parallel (N/m), shape factor S."""

    modulus: float
    stiffness: float
    shape_factor: float

    @property
    def bonded(self) -> float:
        """Stiffness with faces that do not slip, E (1 + 2 S^2) A/h, N/m (Gent and Lindley 1959)."""
        return self.stiffness * (1 + 2 * self.shape_factor**2)


def theory_of(conditions: Mapping[str, Condition]) -> Theory | list[str]:
    """Return what theory says of these pads, or the names of the conditions that are missing.

    Examples
    --------
    >>> pads = {"pad_diameter": 0.05, "pad_height": 0.006, "powder_fraction": 0.25}
    >>> found = theory_of({**pads, "matrix_shear_modulus": 0.3e6, "poisson_ratio": 0.2})
    >>> round(found.stiffness / 1e3, 1), round(found.shape_factor, 3), round(found.bonded / found.stiffness, 2)
    (516.9, 2.083, 9.68)
    """
    given = {name: conditions.get(name) for name in _NEEDED}
    numbers = {name: float(value) for name, value in given.items() if isinstance(value, float | int)}
    missing = [name for name in _NEEDED if name not in numbers]
    if missing:
        return missing
    diameter, height = numbers["pad_diameter"], numbers["pad_height"]
    count = conditions.get("n_pads", 1.0)
    area = math.pi * diameter**2 / 4 * (float(count) if isinstance(count, float | int) else 1.0)
    G = float(compound_modulus(numbers["matrix_shear_modulus"], numbers["powder_fraction"]))
    E = young_modulus(G, numbers["poisson_ratio"])
    return Theory(E, E * area / height, diameter / (4 * height))
