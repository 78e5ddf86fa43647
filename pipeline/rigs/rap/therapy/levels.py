"""From the ultrasonic distance to the level at the tank's centroid, where eq. 8 holds (rap.md, 3.7).

Tilt, air temperature and the conditions of validity are dealt with here; wild echoes are left to the filter's gate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Level, QualityFinding
from pipeline.rigs.rap.circuit.tank import (
    LARGEST_TILT,
    Tank,
    floor_margin,
    height_from_distance,
    tilt_of,
)
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.attitude import attitude, turned_axes, wrong_signs
from pipeline.rigs.rap.therapy.temperature_fit import AirTemperature

USABLE, NO_ECHO, OUT_OF_TANK, TILTED, CUT, BLIND, FROZEN = range(7)
REASONS = {
    USABLE: "usable",
    NO_ECHO: "no echo",
    OUT_OF_TANK: "distance outside of the tank",
    TILTED: "tilt over 12 deg",
    CUT: "tilted surface cuts the floor or the rim",
    BLIND: "below the level that the sensor sees",
    FROZEN: "distance frozen",
}
LEVEL_NOISE = 1e-3
"""Standard deviation of one echo, m (eq. 9)."""
_SLOSH, _WALKING_TILT = 6e-3, 4e-3
# How a tank may stand that nobody has levelled, rad (1 sigma).
_UNKNOWN_TILT = math.radians(2.0)
_FROZEN_FOR = 60
_OUTSIDE = 0.02


@dataclass(frozen=True, eq=False)
class Levels:
    """Level of the liquid at the centroid; arrays of shape (n,).

    Attributes
    ----------
    time, level, variance
        Moment (device's clock, s), height (m; NaN where eq. 8 does not hold) and its variance (m^2) for one echo.
    raw
        Height without the corrections for tilt and temperature, m; NaN without echo.
    common_sd
        What the air's temperature, or a tilt that is not logged, leaves uncertain in the height, the same for neighbours, m.
    tilt, moving
        Angle to the vertical (rad), whether the tank is being moved.
    why
        Key of `REASONS`.
    """

    time: np.ndarray
    level: np.ndarray
    variance: np.ndarray
    raw: np.ndarray
    common_sd: np.ndarray
    tilt: np.ndarray
    moving: np.ndarray
    why: np.ndarray
    problems: tuple[QualityFinding, ...]

    @property
    def usable(self) -> np.ndarray:
        """Where there is a level, bool, shape (n,)."""
        return np.asarray(np.isfinite(self.level))

    @property
    def first(self) -> float | None:
        """Moment of the first usable level, s."""
        found = np.flatnonzero(self.usable)
        return float(self.time[found[0]]) if found.size else None

    @property
    def share_valid(self) -> float:
        """Usable share of the levels from the first usable one on; 0 without any."""
        found = np.flatnonzero(self.usable)
        return float(self.usable[found[0] :].mean()) if found.size else 0.0


def tank_of(conditions: Mapping[str, float | str | bool]) -> tuple[Tank, tuple[str, ...]]:
    """Return the tank that a run's conditions describe, and what had to be assumed.

    Raises
    ------
    InputError
        If the floor's size or the sensor's height is not stated, or the echo model is unknown.
    """
    missing = [name for name in ("tank_lx", "tank_ly", "level_sensor_z") if conditions.get(name) is None]
    if missing:
        raise InputError(
            f"the level cannot become a volume without the condition{'s' if len(missing) > 1 else ''} {', '.join(missing)}. "
            "State them in runs.csv, in the log or in the recipe, in metres."
        )
    assumed = []

    def given(name: str, otherwise: float, words: str) -> float:
        value = conditions.get(name)
        if value is None:
            assumed.append(words)
            return otherwise
        return float(value)

    Lx, Ly, z = (float(conditions[name]) for name in ("tank_lx", "tank_ly", "level_sensor_z"))
    H = given("tank_height", z, "tank_height is not stated: the rim is taken to be at the sensor")
    dx = given(
        "level_sensor_dx",
        0.0,
        "level_sensor_dx is not stated: the sensor is taken to be over the centroid, so tilt about y is not corrected",
    )
    dy = given(
        "level_sensor_dy",
        0.0,
        "level_sensor_dy is not stated: the sensor is taken to be over the centroid, so tilt about x is not corrected",
    )
    blind = given("tank_blind_level", 0.0, "tank_blind_level is not stated: every valid echo is taken for good")
    reference = given("echo_reference_temperature", 293.15, "echo_reference_temperature is not stated: 20 degC taken")
    echo = str(conditions.get("echo_model") or "").strip().lower()
    if not echo:
        assumed.append(
            "echo_model is not stated: the distance is taken to run down the tank's axis (1.5 % from the specular one at 10 deg)"
        )
    if echo not in ("", "axis", "specular"):
        raise InputError(f"the condition echo_model is '{echo}'; known are axis and specular.")
    tank = Tank(Lx, Ly, H, z, dx, dy, blind, reference, "specular" if echo == "specular" else "axis")
    return tank, tuple(assumed)


def level_course(
    distance: Signal,
    tank: Tank,
    *,
    valid: Signal | None = None,
    accelerations: Sequence[Signal | None] = (None, None, None),
    temperature: AirTemperature | None = None,
) -> Levels:
    """Return the level at the centroid at each echo.

    Parameters
    ----------
    distance
        `uf_level_distance`; faster than 2 Hz it is reduced to medians over 1 s.
    valid
        `uf_echo_valid`; without it every distance within the tank counts as an echo.
    accelerations
        `tank_accel_x`, `_y`, `_z`; without all three the tank is taken to stand upright and still.
    temperature
        Of the air in the tank; without it the sensor's own assumption is kept.

    Raises
    ------
    InputError
        If the level moves against the tilt.
    """
    problems: list[QualityFinding] = []
    time, D = _echoes(distance, valid)
    n, moving = attitude(time, accelerations, problems)
    told = all(a is not None for a in accelerations)
    turned = turned_axes(tank.z - D, n, tank)
    if turned:
        raise InputError(wrong_signs(turned))
    tilt_doubt = 0.0 if told else math.hypot(tank.dx, tank.dy) * _UNKNOWN_TILT
    T, T_sd = _air(time, tank, temperature, problems)
    tilt = tilt_of(n)
    upright = np.where(n[:, 2:] > 0.3, n, np.array([0.0, 0.0, 1.0]))
    level = height_from_distance(tank, D, upright, T)
    why = np.where(np.isfinite(D), USABLE, NO_ECHO)
    outside = (level < -_OUTSIDE) | (level > tank.H + _OUTSIDE)
    why[(why == USABLE) & outside] = OUT_OF_TANK
    why[(why == USABLE) & (tilt > LARGEST_TILT)] = TILTED
    why[(why == USABLE) & _frozen(D)] = FROZEN
    # Conditions on the level itself look at its median over half a minute: single noisy levels would be chosen high.
    steady = _running_median(level, why == USABLE)
    margin = floor_margin(tank, upright)
    cut = (steady <= margin) | (steady >= tank.H - margin)
    why[(why == USABLE) & cut] = CUT
    blind = steady < tank.blind - (0.0 if valid is None else LEVEL_NOISE)
    why[(why == USABLE) & blind] = BLIND
    variance = np.where(moving, LEVEL_NOISE**2 + _SLOSH**2 + _WALKING_TILT**2, LEVEL_NOISE**2)
    _tell(time, why, problems)
    if valid is not None and not np.isfinite(D).any():
        problems += _flag_doubted(distance, tank)
    return Levels(
        time=time,
        level=np.where(why == USABLE, level, np.nan),
        variance=variance,
        raw=tank.z - D,
        common_sd=np.hypot(np.where(np.isfinite(D), D, tank.z) * T_sd / (2.0 * T), tilt_doubt),
        tilt=tilt,
        moving=moving,
        why=why,
        problems=tuple(problems),
    )


def _flag_doubted(distance: Signal, tank: Tank) -> list[QualityFinding]:
    """Doubt a flag that denies every echo of a sensor that reads plausible distances."""
    read = distance.values[(distance.values > 0.0) & (distance.values < 1.1 * tank.z)]
    if read.size < 0.5 * distance.values.size or not np.ptp(read) > LEVEL_NOISE:
        return []
    text = "uf_echo_valid denies every echo although the distances lie within the tank and move: is it dead, or inverted? Leave it out in the recipe to use them."
    return [QualityFinding("warning", text, channel="uf_echo_valid")]


def _echoes(distance: Signal, valid: Signal | None) -> tuple[np.ndarray, np.ndarray]:
    """Return moments (n,) and distances (n,), NaN without echo, at most one a second."""
    time, D = distance.time, np.where(distance.values > 0.0, distance.values, np.nan)
    if valid is not None:
        at = np.clip(np.searchsorted(valid.time, time, side="right") - 1, 0, valid.time.size - 1)
        D = np.where(valid.values[at] > 0.5, D, np.nan)
    if time.size > 2 and distance.rate > 2.0:
        second = np.floor(time - time[0]).astype(int)
        starts = np.flatnonzero(np.diff(second, prepend=-1))
        pieces = np.split(D, starts[1:])
        with np.errstate(invalid="ignore"):
            D = np.array([np.median(p[np.isfinite(p)]) if np.isfinite(p).any() else np.nan for p in pieces])
        time = np.add.reduceat(time, starts) / np.diff(np.append(starts, time.size))
    return time, D


def _air(
    time: np.ndarray, tank: Tank, temperature: AirTemperature | None, problems: list[QualityFinding]
) -> tuple[np.ndarray, float]:
    """Return the air's temperature (n,) and its standard uncertainty, K."""
    if temperature is None:
        text = (
            f"no air temperature: the ultrasonic sensor's own {tank.reference - 273.15:.0f} degC is kept. "
            "Each kelvin is worth 0.17 % of the distance, about 0.35 mm or 3 mL at 0.2 m."
        )
        problems.append(QualityFinding("warning", text, channel="temperature_air_rap"))
        return np.full(time.size, tank.reference), 7.0
    return temperature.at(time), temperature.sd


def _frozen(D: np.ndarray) -> np.ndarray:
    """Tell where a distance repeats itself to the last digit for a minute and more, shape (n,)."""
    starts = np.flatnonzero(np.diff(D, prepend=np.nan) != 0.0)
    lengths = np.diff(np.append(starts, D.size))
    return np.asarray(np.repeat(lengths >= _FROZEN_FOR, lengths)) if starts.size else np.zeros(D.size, dtype=bool)


def _running_median(level: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Return the median of the 31 good levels around each good one, NaN elsewhere, shape (n,)."""
    from scipy.ndimage import median_filter

    out = np.full(level.size, np.nan)
    if good.any():
        out[good] = median_filter(level[good], 31, mode="nearest")
    return out


def _tell(time: np.ndarray, why: np.ndarray, problems: list[QualityFinding]) -> None:
    """Add what is wrong with the echoes."""
    span = (float(time[0]), float(time[-1])) if time.size else (math.nan, math.nan)
    channel = "uf_level_distance"
    usable = np.flatnonzero(why == USABLE)
    if not usable.size:
        common = int(np.bincount(why).argmax()) if why.size else NO_ECHO
        text = f"no usable level in the whole run; most often: {REASONS[common]}. "
        text += (
            "Is the distance in metres, and level_sensor_z the sensor's height over the floor?"
            if common in (OUT_OF_TANK, CUT)
            else "The volume rests on the pump's command alone."
        )
        problems.append(
            QualityFinding("error" if common == OUT_OF_TANK else "warning", text, channel=channel, span=span)
        )
        return
    after = why[usable[0] :]
    share = float((after == USABLE).mean())
    if share < 0.8:
        away = int((after != USABLE).sum())
        step = float(np.median(np.diff(time))) if time.size > 1 else 1.0
        common = int(np.bincount(after[after != USABLE]).argmax())
        text = f"level-blind for {away * step / 60:.0f} min after the first echo (usable {100 * share:.0f} %), most often: {REASONS[common]}; dead reckoning there."
        problems.append(QualityFinding("warning", text, channel=channel, span=(float(time[usable[0]]), span[1])))
    for code in (TILTED, CUT, FROZEN, OUT_OF_TANK):
        found = np.flatnonzero(why == code)
        if found.size > max(30, 0.02 * why.size if code == OUT_OF_TANK else 0):
            text = f"{found.size} levels are not used: {REASONS[code]}."
            where = (float(time[found[0]]), float(time[found[-1]]))
            grave: Level = "note" if code == TILTED and found.size < 0.02 * why.size else "warning"
            problems.append(QualityFinding(grave, text, channel=channel, span=where))
