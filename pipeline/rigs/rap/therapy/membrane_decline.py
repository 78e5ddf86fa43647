"""Coefficient of the membrane and its decline over a run, from 60 s means (rap.md, 3.8 and 5.7).

Resistance form K = K_0/(1 + a t/5 h). The errors come from the slow estimate of the pump's gain, so intervals are from
blocks of 40 min, corrected for what few blocks and two fitted numbers hide.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.circuit.membrane import T_REF, effective_pressure, water_viscosity
from pipeline.rigs.rap.therapy.command import Command
from pipeline.rigs.rap.therapy.decline_line import fitted_line
from pipeline.rigs.rap.therapy.gain_posterior import GainPosterior
from pipeline.rigs.rap.therapy.tank_kalman import GAIN_SD
from pipeline.rigs.rap.therapy.transmembrane import Transmembrane

BLOCK = 2400.0
_LEAST_BLOCKS = 3.0
_LEAST_TMP = 200.0
_PER_KELVIN = 0.02
# Proteins of blood, about 25 mmHg.
_OSMOTIC = 3333.0
# How well that is known, as a share (1 sigma), and from which share of it on a rest of the ultrafiltrate shows it.
_OSMOTIC_SHARE_U, _OSMOTIC_SEEN = 0.2, 0.45


@dataclass(frozen=True, eq=False)
class Decline:
    """Membrane over a run.

    Attributes
    ----------
    initial, decline
        K_0 (m^3/(s Pa)) and a.
    time, k, k_sd, fitted, used
        60 s values at the middle of each (device's clock), their standard errors, the fit, whether they took part; (n,).
    band
        95 % band of the fit, shape (n, 2).
    pressure_u, pressure_u_decline
        What the sensors' unknown zeros add to the errors of K_0 (m^3/(s Pa)) and a (type B).
    naive_sd
        Standard error of a from least squares alone, as if the values were independent.
    p_no_decline
        Probability of so large a decline, or larger, where there is none; NaN where not tested.
    explanations
        What else than fouling would look like this, in sentences.
    """

    initial: Estimate
    decline: Estimate
    time: np.ndarray
    k: np.ndarray
    k_sd: np.ndarray
    fitted: np.ndarray
    band: np.ndarray
    used: np.ndarray
    start: float
    pressure_u: float
    pressure_u_decline: float
    naive_sd: float
    p_no_decline: float
    n_blocks: float
    explanations: tuple[str, ...]
    problems: tuple[QualityFinding, ...]

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval of a excludes no change."""
        ci = self.decline.ci95
        return ci is not None and (ci[0] > 0.0 or ci[1] < 0.0)


def decline(
    pressure: Transmembrane,
    gain: GainPosterior | None,
    command: Command,
    *,
    fluid: str = "saline",
    start: float | None = None,
    t_ref: float = T_REF,
    block: float = BLOCK,
    fluid_temperature: tuple[np.ndarray, np.ndarray] | None = None,
    rate_error: tuple[np.ndarray, np.ndarray] | None = None,
) -> Decline:
    """Fit K_0 and a to 60 s values of rate over transmembrane pressure.

    Parameters
    ----------
    gain
        The pump's, from `pump_gain.mean_gain(...).posterior`; without it the command is taken at its word, to 15 %.
    start
        Where t = 0 of the decline is, s; by default when the ultrafiltrate pump starts.
    fluid_temperature
        Moments (s) and temperatures (K) of the fluid; K is then that at its mean temperature (viscosity).
    rate_error
        Moments (s) and what the rate may be off there, as a share (type B).

    Raises
    ------
    InputError
        If the ultrafiltrate pump never runs against a transmembrane pressure.
    """
    problems: list[QualityFinding] = []
    time = pressure.time
    osmotic, told = _osmotic(fluid, pressure)
    tmp = effective_pressure(pressure.tmp, osmotic)
    k, errors = _values(pressure, tmp, gain, command, fluid_temperature)
    gain_sd = np.sqrt(np.diag(errors))
    used = np.isfinite(k) & (k > 0.0) & (gain_sd < 0.3)
    used &= ~_wild(k, used)
    if used.sum() < 5:
        raise InputError(
            "the ultrafiltrate pump never runs for a few minutes against a positive transmembrane pressure, so the "
            "membrane shows no coefficient. Look at the signs of the pressures and at uf_pump_command."
        )
    origin = start if start is not None else (command.started if command.started is not None else float(time[0]))
    t = (time - origin) / t_ref
    r = 1.0 / k[used]
    shape = np.outer(r, r) * errors[np.ix_(used, used)] + np.diag((r * pressure.scatter[used] / tmp[used]) ** 2)
    notes = _notes(fluid_temperature is not None, osmotic, pressure) + told
    common = [math.hypot(pressure.offset_u, _OSMOTIC_SHARE_U * osmotic) / tmp[used] * r, pressure.gain_u * r]
    if rate_error is not None:
        common.append(np.interp(time[used], *rate_error) * r)
        notes += (
            f"; a rate that may be {100 * float(np.abs(rate_error[1]).max()):.1f} % off (type B, in the standard error)"
        )
    long_enough = float(np.ptp(time[used])) >= _LEAST_BLOCKS * block
    line = fitted_line(t[used], r, shape, common, max(round(block / pressure.bin), 2))
    initial, slope = line.estimates(notes)
    fitted, band = line.course(t)
    if not long_enough:
        reason = (
            f"{np.ptp(time[used]) / 60.0:.0f} min with ultrafiltration cannot tell a decline, whose errors hang together for "
            f"most of an hour; run it for {_LEAST_BLOCKS * block / 3600.0:.0f} h and more"
        )
        slope = undetermined("k_uf_decline", reason)
    found = Decline(
        initial=initial,
        decline=slope,
        time=time,
        k=k,
        k_sd=k * gain_sd,
        fitted=fitted,
        band=band,
        used=used,
        start=origin,
        pressure_u=float(line.common_u[0]),
        pressure_u_decline=float(line.common_u[1]),
        naive_sd=line.naive_sd,
        p_no_decline=line.p_no_decline if long_enough else math.nan,
        n_blocks=float(used.sum()) * pressure.bin / block,
        explanations=(),
        problems=(),
    )
    return _explained(found, fluid, float(np.mean(tmp[used])), t_ref, problems)


def _values(
    pressure: Transmembrane,
    tmp: np.ndarray,
    gain: GainPosterior | None,
    command: Command,
    fluid_temperature: tuple[np.ndarray, np.ndarray] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return K of each mean (NaN where the pump was not running throughout), and the covariance of the rate's relative errors."""
    time, half = pressure.time, 0.5 * pressure.bin
    asked = (command.volume(time + half) - command.volume(time - half)) / pressure.bin
    moments = np.stack([command.at(time + share * half) for share in np.linspace(-1.2, 1.0, 12)])
    steady = moments.min(axis=0) > 0.5 * moments.max(axis=0)
    if gain is None:
        course, errors = np.ones(time.size), np.full((time.size, time.size), GAIN_SD**2)
    else:
        course = np.interp(time, gain.middle, gain.course)
        at = np.clip(np.searchsorted(gain.edges, time, side="right") - 1, 0, gain.middle.size - 1)
        errors = gain.covariance[np.ix_(at, at)] / np.outer(course, course)
    with np.errstate(divide="ignore", invalid="ignore"):
        k = np.where(steady & (tmp > _LEAST_TMP), course * asked / tmp, np.nan)
    if fluid_temperature is not None:
        T = np.interp(time, *fluid_temperature)
        k = k * water_viscosity(T) / float(water_viscosity(T.mean()))
    return k, errors


def _wild(k: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Tell which values stand far off their neighbours of a quarter of an hour: occlusions, a closed clamp."""
    from scipy.ndimage import median_filter

    out = np.zeros(k.size, dtype=bool)
    if used.sum() < 8:
        return out
    off = np.abs(k[used] / median_filter(k[used], 15, mode="nearest") - 1.0)
    out[used] = off > max(6.0 * 1.4826 * float(np.median(off)), 0.03)
    return out


def _osmotic(fluid: str, pressure: Transmembrane) -> tuple[float, str]:
    """Return what the proteins hold back, Pa, and a remark.

    With the pumps at rest blood draws the ultrafiltrate down to that: where the rest shows it, it went with the zero.
    """
    if fluid.strip().lower() != "blood":
        return 0.0, ""
    rest = pressure.zeros.get("uf")
    if rest is None or rest > -_OSMOTIC_SEEN * _OSMOTIC:
        return _OSMOTIC, ""
    return 0.0, (
        f"; blood: at rest the ultrafiltrate reads {rest:.0f} Pa, which is the proteins' osmotic pressure and the sensor's zero, both "
        "taken off"
    )


def _notes(normalised: bool, osmotic: float, pressure: Transmembrane) -> str:
    """Return what the numbers hold, for their description."""
    told = [
        "brought to the fluid's mean temperature by its viscosity"
        if normalised
        else "not brought to one temperature: none of the fluid is logged over time; 1 K is about 2 %",
        f"zeros leave {pressure.offset_u:.0f} Pa open in the transmembrane pressure and gains {100 * pressure.gain_u:.1f} % "
        "(type B, in the standard error)",
    ]
    if osmotic:
        told.append(f"blood: {osmotic:.0f} Pa of the proteins' osmotic pressure taken off, an assumption")
    return "; ".join(told)


def _explained(found: Decline, fluid: str, tmp: float, t_ref: float, problems: list[QualityFinding]) -> Decline:
    """Add what else than fouling would look like that, and doubt a decline on saline."""
    a = found.decline.value
    if a is None:
        return replace(found, problems=tuple(problems))
    share = a / (1.0 + a)
    hours = t_ref / 3600.0
    word = "lost" if share > 0 else "gained"
    explanations = (
        f"a fluid {abs(share) / _PER_KELVIN:.1f} K {'cooler' if share > 0 else 'warmer'} after {hours:.0f} h (viscosity, 2 %/K)",
        f"a zero of the transmembrane pressure that drifts by {abs(share) * tmp:.0f} Pa in {hours:.0f} h",
        f"an ultrafiltration rate that is taken {100 * abs(share):.1f} % too {'low' if share > 0 else 'high'} at the end",
        "air trapped in the filter, which takes membrane out of use",
    )
    if found.excludes_zero and fluid.strip().lower() == "saline":
        text = (
            f"the membrane has {word} {100 * abs(share):.0f} % of its coefficient after {hours:.0f} h, on saline, which holds no "
            f"protein and cannot foul it. What would look alike: {'; '.join(explanations)}. Check these before the membrane."
        )
        problems.append(QualityFinding("warning", text, channel="pressure_uf_rap"))
    return replace(found, explanations=explanations, problems=tuple(problems))
