"""Gain of the ultrafiltrate pump over a run: delivered over asked, over the part with echoes (rap.md, eq. 9, section 11)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.therapy.command import SET_POINT, Command
from pipeline.rigs.rap.therapy.gain_posterior import GainPosterior, gain_posterior
from pipeline.rigs.rap.therapy.tank_filter import TankCourse


@dataclass(frozen=True, eq=False)
class PumpGain:
    """Gain of the pump.

    Attributes
    ----------
    gain
        Mean over the valid part; its error is that of the long-run mean, which a gain that wanders shows but partly.
    realised_sd
        Error of the mean as it was in this run.
    posterior
        The gain's course and how its errors hang together.
    wander_sd, wander_time
        How far it strays (1) and its memory (s), both roughly known.
    """

    gain: Estimate
    realised_sd: float
    posterior: GainPosterior
    wander_sd: float
    wander_time: float
    problems: tuple[QualityFinding, ...]


def mean_gain(course: TankCourse, command: Command) -> PumpGain:
    """Return the pump's gain.

    Raises
    ------
    InputError
        If there is no echo, or nothing was asked for while there were echoes.
    """
    found = gain_posterior(course, command)
    if found is None or course.first_echo is None or course.last_echo is None:
        raise InputError(
            "there are no echoes while the ultrafiltrate pump runs, so the volume is the pump's command alone and its gain "
            "cannot be told."
        )
    valid = (found.edges[1:] > course.first_echo) & (found.edges[:-1] < course.last_echo)
    asked = np.where(valid, found.asked, 0.0)
    if not asked.sum() > 0.0:
        raise InputError("the ultrafiltrate pump does not run while there are echoes; its gain cannot be told.")
    value, realised, lasting = found.mean(asked / asked.sum())
    source = "set-point (the command is not logged)" if command.source == SET_POINT else "command"
    remark = (
        f"delivered over {source}, mean from the first to the last echo; in this run it was {value:.4f} +- {1.96 * realised:.4f}, the "
        f"error told holds that the gain wanders by about {found.wander_sd:.2g} within {found.wander_time / 60.0:.0f} min"
    )
    problems = []
    if abs(value - 1.0) > 0.05 + 2.0 * realised:
        text = f"the ultrafiltrate pump delivers {value:.3f} of what it is asked for. Calibrate it, or look at the tank's geometry."
        problems.append(QualityFinding("warning", text, channel=command.source))
    return PumpGain(
        estimate("uf_pump_gain", value, lasting, reason=remark),
        realised,
        found,
        found.wander_sd,
        found.wander_time,
        tuple(problems),
    )
