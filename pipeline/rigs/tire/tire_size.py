"""The words on a tire's side wall: "245/40R18" -> width, diameter and free radius."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pipeline.errors import InputError

_INCH = 0.0254
_METRIC = re.compile(
    r"^\s*(?:P|LT|C|T|ST)?\s*(?P<width>\d{3})\s*[/-]\s*(?P<aspect>\d{2,3})\s*-?\s*(?P<kind>Z?R|ZR?F?|RF|[DB])?\s*-?\s*"
    r"(?P<rim>\d{2}(?:[.,]5)?)(?:\s*(?:C|LT))?(?![\d.,]).*$",
    re.IGNORECASE | re.DOTALL,
)


@dataclass(frozen=True)
class TireSize:
    """Nominal width and rim diameter, m; aspect = height of the side wall over the width."""

    width: float
    aspect: float
    rim: float

    @property
    def diameter(self) -> float:
        """Nominal outer diameter, m."""
        return self.rim + 2.0 * self.aspect * self.width

    @property
    def radius(self) -> float:
        """Half the nominal diameter, m: Ro, the free outer radius."""
        return 0.5 * self.diameter


def tire_size(text: object, where: str = "tire_size") -> TireSize:
    """Return what a designation such as ``"245/40 ZR18 97Y"`` stands for.

    Parameters
    ----------
    text
        Width (mm), aspect ratio (%) and rim (in), as moulded on the tire; load index and speed may follow.
    where
        For the message.

    Raises
    ------
    InputError
        If it does not read so, or no such tire can be.

    Examples
    --------
    >>> round(tire_size("245/40R18").radius, 4)
    0.3266
    """
    found = _METRIC.match(str(text))
    if not found:
        raise InputError(f"{where}: '{text}' is no tire size; expected width/aspect R rim, for example '245/40R18'.")
    width, aspect = float(found["width"]) * 1e-3, float(found["aspect"]) / 100.0
    size = TireSize(width, aspect, float(found["rim"].replace(",", ".")) * _INCH)
    if not (0.1 <= width <= 0.5 and 0.2 <= aspect <= 1.0 and 0.2 <= size.rim <= 0.7):
        raise InputError(
            f"{where}: '{text}' would be {size.width * 1e3:.0f} mm wide, {aspect:.0%} high, on a rim of "
            f"{size.rim / _INCH:.3g} in; expected 100 to 500 mm, 20 to 100 %, 8 to 27 in, for example '245/40R18'."
        )
    return size
