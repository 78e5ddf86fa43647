"""How well the device kept the set volume: delivered against set, what it would have been without regulation (rap.md, section 6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.command import SET_POINT, Command, command_of
from pipeline.rigs.rap.therapy.tank_filter import TankCourse

_CLOSED = 0.002


@dataclass(frozen=True, eq=False)
class Regulation:
    """Account of a run's ultrafiltrate.

    Attributes
    ----------
    set_volume, delivered, delivered_sd
        What the set-point asks for, what ran into the tank over all fillings, m^3.
    error_share
        Delivered less set, over set.
    open_loop, open_loop_share
        What the pump would have delivered at the set rate (m^3), and its error over set.
    closed
        Whether the command follows the volume; None where command or set-point is missing.
    correction_time
        Time constant with which a lack of volume is made up, s.
    saturated
        Share of the time in which the command stands at an end of its range.
    time, ratio
        Command over set-point over time, for the report.
    """

    set_volume: float
    delivered: float
    delivered_sd: float
    error_share: float
    open_loop: float
    open_loop_share: float
    closed: bool | None
    correction_time: Estimate
    saturated: float
    time: np.ndarray
    ratio: np.ndarray
    problems: tuple[QualityFinding, ...]


def regulate(
    command: Command, set_point: Signal | None, course: TankCourse, *, device_volume: Signal | None = None
) -> Regulation:
    """Return how well the set volume was kept.

    Parameters
    ----------
    device_volume
        `uf_volume_rap`, by which the device regulates.

    Raises
    ------
    InputError
        If the run has no set-point, or it is zero throughout.
    """
    if set_point is None:
        raise InputError(f"without '{SET_POINT}' nobody knows what volume was wanted; log the set-point.")
    wanted = command_of(set_point, None)
    begin, end = course.time[0], course.time[-1]
    span = np.array([begin, end])
    target = float(np.diff(wanted.volume(span))[0])
    if not target > 0.0:
        raise InputError(f"'{SET_POINT}' is zero while the level is logged; there is nothing to regulate.")
    grid = course.time
    steps = np.diff(grid, append=grid[-1])
    rate, asked = wanted.at(grid), command.at(grid)
    open_loop = float((course.smoothed_gain * rate * steps).sum())
    on = (rate > 0.0) & (asked > 0.0)
    ratio = np.where(on, asked / np.where(rate > 0.0, rate, 1.0), np.nan)
    closed: bool | None = None
    correction = undetermined("correction_time", "the command is not logged beside the set-point")
    saturated = 0.0
    problems = []
    if command.source != SET_POINT and on.sum() > 60:
        values = ratio[on]
        closed = bool(values.std() > _CLOSED)
        ends = (values >= values.max() - 1e-9) | (values <= values.min() + 1e-9)
        saturated = float(ends.mean()) if closed and np.ptp(values) > 0.05 else 0.0
        correction = _correction(course, wanted, ratio, rate, on, closed, device_volume)
        if saturated > 0.2:
            text = f"the command stands at an end of its range for {100 * saturated:.0f} % of the time: the pump cannot make up what is missing."
            problems.append(QualityFinding("warning", text, channel=command.source))
    return Regulation(
        set_volume=target,
        delivered=course.total,
        delivered_sd=course.total_sd,
        error_share=course.total / target - 1.0,
        open_loop=open_loop,
        open_loop_share=open_loop / target - 1.0,
        closed=closed,
        correction_time=correction,
        saturated=saturated,
        time=grid,
        ratio=ratio,
        problems=tuple(problems),
    )


def _correction(
    course: TankCourse,
    wanted: Command,
    ratio: np.ndarray,
    rate: np.ndarray,
    on: np.ndarray,
    closed: bool,
    device_volume: Signal | None,
) -> Estimate:
    """Return T of ``u = q (1 + (V_set - V)/(q T))``, from the slope of the command on what the device thinks is missing."""
    from pipeline.estimation.uncertainty import newey_west

    name = "correction_time"
    if not closed:
        return undetermined(name, "the command keeps to the set-point: nothing is regulated")
    if device_volume is None:
        return undetermined(name, "the volume by which the device regulates, uf_volume_rap, is not logged")
    if len(course.segments) > 1:
        return undetermined(name, "the tank was emptied in between, and what the device then counts is not logged")
    own = np.interp(course.time, device_volume.time, device_volume.values)
    missing = wanted.volume(course.time) - own
    inner = on & (ratio < np.nanmax(ratio) - 1e-6) & (ratio > np.nanmin(ratio) + 1e-6)
    if inner.sum() < 300:
        return undetermined(name, "the command stands at an end of its range nearly throughout")
    x, y = missing[inner] / rate[inner], ratio[inner] - 1.0
    x, y = x - x.mean(), y - y.mean()
    slope = float(x @ y) / float(x @ x)
    residual = y - slope * x
    told = newey_west(-x[:, None], residual)
    sd = float(told.std_error[0])
    if not (slope > 0.0 and sd < 0.5 * slope and float(residual @ residual) < 0.5 * float(y @ y)):
        return undetermined(name, "the command does not follow what the device thinks is missing")
    return estimate(name, 1.0 / slope, sd / slope**2, dof=min(told.dof, math.inf))
