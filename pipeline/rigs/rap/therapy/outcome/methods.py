"""The methods paragraphs of `rap.therapy`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.rigs.rap.therapy.outcome.frames import runs_of


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from, of the parts that the runs have."""
    if "parts" not in findings.arrays:
        return []
    parts = (
        ("clocks", _clocks),
        ("temperature", _temperature), ("volume", _volume), ("membrane", _membrane), ("battery", _battery), ("states", _alarms),
        ("redundancy", _redundancy),
    )  # fmt: skip
    return [_runs(findings), *(text(findings) for array, text in parts if not findings.arrays[array].empty)]


def _runs(findings: Findings) -> str:
    runs = runs_of(findings.arrays["parts"])
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    return (
        f"{counted(len(runs), 'run')} of a wearable ultrafiltration device at its bench (RAP 2019); each tells what its channels allow. Device, "
        "bench and scale keep clocks of their own: nothing was joined by row. Units, signs and exchanged channels were judged before anything "
        f"else, and channels that failed do not enter.{told}"
    )


def _clocks(_findings: Findings) -> str:
    return (
        "Clocks: lag and rate of the device's clock against the bench's come from the phase of the pulsation that both see, after a coarse lag from "
        "starts, stops and changes of speed (Knapp and Carter 1976); temperatures are compared on one clock."
    )


def _temperature(findings: Findings) -> str:
    return (
        "Temperature: T = T∞ + (T₀ - T∞) exp(-t/τ) was fitted to each sensor by least squares; errors from the scaled covariance and half a step of "
        "resolution. The device's error is its reading less the bench's at the device's samples; in percent of the bench's degrees Celsius for "
        f"comparison with the paper alone, tolerance {100 * _setting(findings, 'temperature_tolerance', 0.05):g} %."
    )


def _volume(_findings: Findings) -> str:
    return (
        "Ultrafiltrate: the ultrasonic distance became a height at the tank's centroid with the tilt from low-passed accelerometers and the speed of "
        "sound at the air's temperature (own eq. (8)); levels outside of the geometry's validity, below the blind level, at more than 12 deg or without "
        "echo were left out. A Kalman filter (Kalman 1960) carries volume and pump gain from the pump's command and takes the levels (eq. (9)); an "
        "innovation beyond 3 standard deviations is passed over, 60 in a row inflate the covariance. Drains close a segment and volumes add up. A "
        "smoother fills in the blind start. Mass became volume by the fluid's density and the tare; the scale's clock was set to the device's by "
        "what both see, and the error counts from the first echo. Level offset and first volume, area and pump gain trade one to one: only the "
        "scale tells."
    )


def _membrane(_findings: Findings) -> str:
    return (
        "Membrane: TMP = (P_pre + P_ret)/2 - P_uf from 60 s means, zeroed where the pump stands before and after the run, the device's gains taken "
        "out where the bench reads the same taps. K = s u/TMP was fitted by K₀/(1 + a t/5 h); intervals from 40 min blocks with the errors that the "
        "slowly varying pump gain makes, and the zeros' uncertainty (type B). An interval of a that excludes 0 is a trend, whatever its cause."
    )


def _battery(findings: Findings) -> str:
    return (
        "Battery: voltage times current, integrated; the runtime is the stated energy times the efficiency over the mean power, held against "
        f"{_setting(findings, 'therapy_duration', 18000.0) / 3600.0:g} h."
    )


def _alarms(findings: Findings) -> str:
    high, low = _setting(findings, "alarm_high", 1.6), _setting(findings, "alarm_low", 0.5)
    return (
        "Alarms: states and alarms were re-derived from pressures, flags, set-points and events by a state machine of rigfit's own, for the paper's "
        "thresholds are not in its text. Resistances of access, filter, return and membrane on 1 s means, zeroed and over their baselines, raise an "
        f"alarm above {high:g} or below {low:g} for {_setting(findings, 'alarm_hold', 1.0):g} s, not within "
        f"{_setting(findings, 'alarm_blanking', 3.0):g} s of a pump start; blood that stands for more than "
        f"{_setting(findings, 'stagnation_limit', 120.0):g} s raises PROLONGED_STAGNATION. Each is held against the nearest logged code of its name."
    )


def _redundancy(findings: Findings) -> str:
    return (
        "Redundancy: the skew of the protective unit's samples comes from the phase of the cross-spectrum at the pulsation and was taken out; then "
        f"{_setting(findings, 'mismatch_samples', 3):g} samples in a row beyond {_setting(findings, 'mismatch_threshold', 300.0):g} Pa, or a two-sided "
        f"cumulative sum of 1 s means (Page 1954; allowance {_setting(findings, 'cusum_allowance', 20.0):g} Pa, limit "
        f"{_setting(findings, 'cusum_limit', 80.0):g} Pa), is a mismatch. Bounds of rates are those of a Poisson process."
    )


def _setting(findings: Findings, name: str, usual: float) -> float:
    return float(findings.settings.get(name, usual))
