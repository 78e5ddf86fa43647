"""Resistances and ultrafiltration coefficient: proportions of mean pressures and flows over whole strokes (rap.md, 5.4).

Every proportion comes with what it is when one block of time is left out; what cannot be told, with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.rap.pressures.agreement import jackknifed
from pipeline.rigs.rap.pressures.level_means import LevelMeans
from pipeline.rigs.rap.pressures.levels import Level
from pipeline.rigs.rap.tables import Signal

NO_EFFECT = (
    "the transmembrane pressure does not rise while ultrafiltration is set: does the ultrafiltrate pump draw what is set, is its line "
    "open, do the signs hold?"
)
"""Why there is no coefficient where the ultrafiltration does nothing to the pressure."""
TURNED = (
    "the transmembrane pressure falls when ultrafiltration comes on, where it must rise: the ultrafiltrate pump lowers its pressure. The sign of "
    "pressure_uf is turned: 'sign: -1' in the recipe"
)
"""Why there is no coefficient where the ultrafiltrate pressure goes the wrong way."""
K_UF_LARGEST = 2e-10
"""No membrane of this kind lets more through, m^3/(s Pa)."""
UF_OFF = 1e-9
"""Below this the ultrafiltration counts as off, m^3/s."""
# The same where it is not logged, Pa of transmembrane pressure.
_TMP_OFF = 150.0
_FEWEST = 3
# Resistances of two set-points that differ by a larger share are not one.
_MOVES = 0.2
_BLOCK = 2


@dataclass(frozen=True, eq=False)
class Proportion:
    """A proportion found: value, its values with each block left out (b,), error of the zero (relative)."""

    value: float
    left_out: np.ndarray
    zero: float

    @property
    def relative(self) -> float:
        """Relative standard error: scatter of the blocks and error of the zero."""
        spread = float(jackknifed(self.left_out[:, None])[0, 0])
        return math.hypot(math.sqrt(spread) / abs(self.value), self.zero)

    @property
    def dof(self) -> float:
        """Degrees of freedom of that."""
        return float(max(self.left_out.size - 1, 1))


def zeros(taps: Mapping[str, Signal], levels: Sequence[Level]) -> tuple[dict[str, float], dict[str, float]]:
    """Return by tap what it reads while the pumps stand and the standard error of that, Pa; empty where they never do."""
    zero, sd = {}, {}
    at_rest = [level for level in levels if level.steady and not level.turning and not (level.uf_set or 0.0) > UF_OFF]
    for tap, signal in taps.items():
        inside = np.zeros(signal.time.size, dtype=bool)
        for level in at_rest:
            inside |= (signal.time >= level.start) & (signal.time <= level.end)
        if inside.sum() >= 20:
            values = signal.values[inside]
            zero[tap] = float(values.mean())
            sd[tap] = float(values.std(ddof=1)) / math.sqrt(effective_size(values))
    return (zero, sd) if len(zero) == len(taps) else ({}, {})


def ultrafiltration(means: LevelMeans, levels: Sequence[Level], p: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the ultrafiltration in each window, m^3/s; where it is not logged, 0 where no pressure drives any, else NaN."""
    flow = np.array([np.nan if levels[i].uf_set is None else levels[i].uf_set for i in means.level], dtype=float)
    if {"prefilter", "return", "uf"} <= set(p):
        tmp = 0.5 * (p["prefilter"] + p["return"]) - p["uf"]
        flow = np.where(np.isnan(flow) & (np.abs(tmp) < _TMP_OFF), 0.0, flow)
    return np.asarray(flow)


def blood_flow(means: LevelMeans, location: str | None, uf: np.ndarray) -> np.ndarray:
    """Return the flow of blood before the filter in each window; NaN where the meter's place leaves it open."""
    if "flow" not in means.mean:
        return np.full(means.level.size, np.nan)
    metered = means.mean["flow"]
    if location == "access":
        return np.asarray(metered)
    if location == "return":
        return np.asarray(metered + uf)
    # Not stated: both places read the same where nothing is drawn off.
    return np.where(np.abs(uf) < UF_OFF, metered, np.nan)


def resistance(
    means: LevelMeans,
    p: Mapping[str, np.ndarray],
    zero_sd: Mapping[str, float],
    flow: np.ndarray,
    taps: tuple[str, ...],
    q: np.ndarray,
    zeroed: bool,
) -> Proportion | str:
    """Return the resistance from the drop at `taps` over the flow `q`, by windows; or why there is none."""
    missing = [tap for tap in taps if tap not in p]
    if missing:
        return f"the pressure {' and '.join(missing)} is missing or left out"
    sign = -1.0 if taps == ("access",) else 1.0
    drop = sign * (p[taps[0]] - (p[taps[1]] if len(taps) > 1 else 0.0))
    used = means.turning & np.isfinite(drop) & np.isfinite(q) & (np.abs(q) > 1e-8)
    if used.sum() < _FEWEST:
        known = np.isfinite(flow[means.turning]).any() if means.turning.any() else False
        return (
            "the pump turns in too few steady windows of 10 s"
            if known or not means.turning.any()
            else "the flow before the filter is open while fluid is drawn off: state flowmeter_location (access or return), or run without ultrafiltration"
        )
    x, y, block = q[used], drop[used], _blocks(means, used)
    if zeroed and (moved := _moved(means, used, y / x)):
        return moved
    levels_apart = float(np.ptp(x)) > 0.15 * float(np.abs(x).mean())
    if not zeroed and not levels_apart:
        return "the pump never stands and turns at one speed only: the zero of the sensors cannot be told from the drop; stop the pump for 20 s"
    through = zeroed
    value = _slope(x, y, through)
    left_out = np.array([_slope(x[block != b], y[block != b], through) for b in np.unique(block)])
    if left_out.size < 3 or not np.all(np.isfinite(left_out)):
        return "the pump turns in too few steady windows of 10 s"
    off = math.sqrt(sum(zero_sd.get(tap, 0.0) ** 2 for tap in taps)) * float(x.sum() / (x @ x)) if through else 0.0
    return (
        Proportion(value, left_out, abs(off / value))
        if value > 0
        else "the pressure does not rise with the flow: check signs and channels"
    )


def _moved(means: LevelMeans, used: np.ndarray, r: np.ndarray) -> str:
    """Return why there is no one resistance where it differs from level to level far beyond its scatter, else nothing."""
    level, at = means.level[used], means.windows.centre[used]
    numbers = [k for k in np.unique(level) if (level == k).sum() >= _FEWEST]
    if len(numbers) < 2:
        return ""
    each = np.array([float(np.median(r[level == k])) for k in numbers])
    scatter = float(np.median([np.std(r[level == k]) for k in numbers]))
    low, high = int(np.argmin(each)), int(np.argmax(each))
    if each[high] - each[low] < max(_MOVES * abs(float(np.median(each))), 10.0 * scatter):
        return ""
    when = [float(at[level == numbers[k]].mean()) for k in (low, high)]
    return (
        f"it does not stay within the run: {each[low]:.3g} Pa s/m^3 about {when[0]:.0f} s, {each[high]:.3g} about {when[1]:.0f} s (a clamp, "
        "a kink, a clot, or a zero left over?); identify the parts as runs of their own"
    )


def _slope(x: np.ndarray, y: np.ndarray, through: bool) -> float:
    if through:
        return float(x @ y / (x @ x))
    u = x - x.mean()
    return float(u @ y / (u @ u)) if float(u @ u) > 0 else math.nan


def _blocks(means: LevelMeans, used: np.ndarray) -> np.ndarray:
    """Return to which block of neighbouring windows each used window belongs, shape (used,)."""
    number = np.zeros(means.level.size, dtype=int)
    for level in np.unique(means.level):
        at = np.flatnonzero(means.level == level)
        number[at] = 1000 * level + np.arange(at.size) // _BLOCK
    return np.asarray(number[used])


def coefficient(
    means: LevelMeans, p: Mapping[str, np.ndarray], uf: np.ndarray, zero_sd: Mapping[str, float]
) -> Proportion | str:
    """Return K_uf from the transmembrane pressure with the ultrafiltration on, against that with it off or at rest."""
    missing = [tap for tap in ("prefilter", "return", "uf") if tap not in p]
    if missing:
        return f"the pressure {' and '.join(missing)} is missing or left out: there is no transmembrane pressure"
    tmp = 0.5 * (p["prefilter"] + p["return"]) - p["uf"]
    used = means.turning & np.isfinite(tmp) & np.isfinite(uf)
    on, off = used & (uf > UF_OFF), used & (np.abs(uf) <= UF_OFF)
    if on.sum() < _FEWEST:
        return "the ultrafiltration was never on, or is not logged (uf_flow_set), or the clock of its log is not known: nothing is seen to pass the membrane"
    if not off.any() and not zero_sd:
        return "the ultrafiltration is never off and the pump never stands: the zero of the transmembrane pressure is not known"
    block = _blocks(means, used)
    x, y, is_off = uf[used], tmp[used], off[used]

    def value(kept: np.ndarray) -> float:
        zero = float(y[kept & is_off].mean()) if off.any() and (kept & is_off).any() else 0.0
        drawn = kept & ~is_off
        return float(x[drawn] @ x[drawn] / (x[drawn] @ (y[drawn] - zero))) if drawn.any() else math.nan

    whole = value(np.ones(x.size, dtype=bool))
    if not 0.0 < whole < K_UF_LARGEST:
        return TURNED if -K_UF_LARGEST < whole < 0.0 else NO_EFFECT
    left_out = np.array([value(block != b) for b in np.unique(block)])
    if left_out.size < 3 or not np.all(np.isfinite(left_out)):
        return "the ultrafiltration was on in too few steady windows of 10 s"
    sd = zero_sd or {}
    zero = 0.0
    if not off.any():
        zero = (
            math.sqrt(0.25 * sd["prefilter"] ** 2 + 0.25 * sd["return"] ** 2 + sd["uf"] ** 2) * whole / float(x.mean())
        )
    return Proportion(whole, left_out, zero)
