"""What speaks for a comb of mesh lines, and what against it: whether it is that of these gears, or of others.

Two lines at the ratio 1 : 2 fit any gear, so a wrong number of teeth finds a wrong speed with them. Lines of both
trains at their own ratio do not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.gearbox.aligned_run import Span
from pipeline.rigs.gearbox.vibration.comb import Comb

# Power over the noise of a line that stands, and over the strongest mesh line of one that asks for an explanation: where
# only one train shows, and where both do.
_STANDS, _STRONG, _AS_STRONG = 20.0, 0.1, 0.5
# Shafts, planets and bearings turn within so many orders, and modulate the mesh by fewer.
_SHAFTS, _SIDEBANDS = 20.0, 7.0
_HARMONICS = 8
# Hz, and the share by which a grid's frequency may be off.
_MAINS, _GRID = (50.0, 60.0), 0.002
# Half width of a Hann line in lines of the resolution; a share of the frequency, for a speed that wanders.
_LOBE, _WANDERS = 2.0, 0.003
# Trains whose orders differ by nearly a whole factor have the same lines.
_WHOLE = 0.02
# A drive does not gain speed under load, but for what it compensates too much.
_FASTER = 0.005
# Another speed nearer than that share is the same; where it is sought, in nominal speeds.
_OTHER, _SOUGHT = 0.03, (0.6, 1.05)


@dataclass(frozen=True)
class Support:
    """What speaks for an input speed that a comb tells.

    Attributes
    ----------
    lines
        Orders of the comb that stand out of the noise.
    trains
        Trains that these lines belong to: 1 or 2; 1 where both have the same lines.
    hidden
        Whether the other train's line lies beyond the band of the log.
    unexplained
        Strong lines that are none of these gears', Hz, the strongest first; `excess` its power over that of the comb's
        strongest line.
    rival
        Another speed (rad/s) at which as many lines stand; NaN where there is none.
    gain
        Speed over that in FOS, less 1.
    """

    lines: tuple[float, ...]
    trains: int
    hidden: bool
    unexplained: tuple[float, ...]
    excess: float
    rival: float
    gain: float

    @property
    def doubt(self) -> str:
        """Say why the speed cannot be believed, empty where it can."""
        if math.isfinite(self.rival):
            return f"the mesh lines fit {self.rival:.4g} rad/s as well"
        sure = self.trains == 2 and len(self.lines) > 2
        if self.excess >= (_AS_STRONG if self.trains == 2 else _STRONG) and not sure:
            at = " and ".join(f"{f:.4g}" for f in self.unexplained[:2])
            return f"strong lines stand at {at} Hz that these teeth do not explain"
        if self.gain > _FASTER and not sure:
            return f"the input would turn {100 * self.gain:.1f} % faster under load than in FOS, which no drive does"
        return ""

    @property
    def weak(self) -> bool:
        """Tell whether a train whose line should be seen is not: stated teeth may be believed then, assumed ones not."""
        return self.trains < 2 and not self.hidden


def support(comb: Comb, speed: float, nominal: float, orders: Sequence[float], rate: float) -> Support:
    """Weigh the comb at a speed.

    Parameters
    ----------
    comb
        Spectrum over its noise, hum at rest taken out.
    speed, nominal
        Slip speed that was found, and the speed in FOS, rad/s.
    orders
        Mesh orders of both trains and their doubles, also those beyond the band.
    rate
        Sampling rate of the log, Hz: lines beyond half of it come back folded.
    """
    standing = _standing(comb, speed)
    pair = (min(orders), max(orders) / 2)
    ratio = pair[1] / pair[0]
    apart = abs(ratio - round(ratio)) > _WHOLE * ratio
    shown = [any(k in (order, 2 * order) for k in standing) for order in pair]
    trains = 2 if all(shown) and apart else 1
    hidden = not all(order in comb.orders for order in pair)
    tops = _tops(comb)
    power = comb.power
    strongest = max((_near(comb, order, speed) for order in standing), default=math.inf)
    # A train whose line lies beyond the band may show folded back.
    meshes = [order for order, seen in zip(pair, shown, strict=True) if seen or order not in comb.orders]
    odd = [i for i in tops if power[i] >= _STRONG * strongest and not _explained(comb, i, speed, meshes, rate)]
    odd.sort(key=lambda i: -power[i])
    excess = float(power[odd[0]]) / strongest if odd else 0.0
    frequencies = tuple(float(i) * comb.spacing for i in odd)
    rival = _rival(comb, speed, nominal, len(standing))
    return Support(standing, trains, hidden, frequencies, excess, rival, speed / nominal - 1.0)


def _near(comb: Comb, order: float, speed: float) -> float:
    """Return the power at a line of the comb, over the noise."""
    at = order * speed / (2 * math.pi * comb.spacing)
    reach = max(2.0, _WANDERS * at)
    return float(comb.power[max(int(at - reach), 0) : int(at + reach) + 2].max(initial=0.0))


def _standing(comb: Comb, speed: float) -> tuple[float, ...]:
    return tuple(order for order in comb.orders if _near(comb, order, speed) > _STANDS)


def _tops(comb: Comb) -> np.ndarray:
    """Return the bins of the lines that stand, one for each."""
    power, size = comb.power, max(int(_LOBE * comb.rate / comb.size / comb.spacing), 1)
    inner = power[1:-1]
    tops = 1 + np.flatnonzero((inner >= power[:-2]) & (inner > power[2:]) & (inner > _STANDS))
    return np.array([i for i in tops if power[i] >= power[max(i - size, 0) : i + size + 1].max()], dtype=int)


def _explained(comb: Comb, i: int, speed: float, meshes: Sequence[float], rate: float) -> bool:
    """Tell whether a line is one of the shafts, of the mains, or of a mesh that shows, with sidebands and folded back."""
    frequency, turn = i * comb.spacing, speed / (2 * math.pi)
    width = _LOBE * comb.rate / comb.size + _WANDERS * frequency
    if frequency < _SHAFTS * turn + width:
        return True
    if any(abs(frequency - mains * max(round(frequency / mains), 1)) < 0.5 + _GRID * frequency for mains in _MAINS):
        return True
    for mesh in meshes:
        for n in range(1, _HARMONICS + 1):
            at = n * mesh * turn
            folded = abs(at - rate * round(at / rate))
            if min(abs(frequency - at), abs(frequency - folded)) < _SIDEBANDS * turn + width:
                return True
    return False


def _rival(comb: Comb, speed: float, nominal: float, count: int) -> float:
    """Return another speed at which as many lines stand, NaN where there is none."""
    sought: tuple[Span, ...] = (
        (_SOUGHT[0] * nominal, (1 - _OTHER) * speed),
        ((1 + _OTHER) * speed, _SOUGHT[1] * nominal),
    )
    for limits in sought:
        if limits[1] > limits[0]:
            other, _ = comb.best(limits)
            if limits[0] <= other <= limits[1] and len(_standing(comb, other)) >= count:
                return other
    return math.nan
