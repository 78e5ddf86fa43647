"""The methods paragraphs of `rap.flow`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.rigs.rap.flow.declaration import FlowSettings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    if "windows" not in findings.arrays:
        return []
    return [_windows(findings), _estimators(), _meter(findings), _uncertainty(findings)]


def _windows(findings: Findings) -> str:
    settings = FlowSettings.model_validate(findings.settings or {})
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    return (
        f"The device's pressures (RAP 2019) were cut into windows of {settings.window:g} s between starts, stops, steps of set-points and clamp changes; "
        f"{settings.settle:g} s behind and {settings.before:g} s ahead of each change were left out. In each window the roller passages' frequency is the peak of the "
        f"periodogram between {settings.slowest:g} and {settings.fastest:g} Hz, refined within 8 % by least squares of mean, trend and three harmonics at the exact stamps; the amplitude A_1 is that of "
        "the same fit. Windows in which the line is below six of its standard errors (pump stopped), in which the frequency jumps by a factor 2 or 3 while the level stays "
        "(another line of the pump) or whose residual is far above the others' are left out. Mean pressures are zeroed by what the sensors read while the pump "
        f"stands.{told}"
    )


def _estimators() -> str:
    return (
        "Estimators: E0, Q = V f with V from the unclamped set-point nearest to 60 mL/min; E1, Q = V f from all calibration windows; E2, Q = V_g f - A_1 [y_0 + y_1 (f - 2 Hz)]; "
        "E3, Q = f [V_0 - C_p (P_pre - P_a)]. All are linear least squares against the meter on windows of the calibration set, and were tried on the hold-out set. E2 is not "
        "calibrated where no operating points differ in pulsation at one speed: three coefficients on three unclamped set-points fit anything. The algorithm of the device itself "
        "is not published."
    )


def _meter(findings: Findings) -> str:
    meter = findings.arrays["meter"].iloc[0]
    line = {
        "access": "on the access line, where it reads the blood flow",
        "return": "on the return line; the UF rate was added to its reading",
    }
    unknown = "on an unknown line; only windows without ultrafiltration were held against it"
    by_run = "on the access or the return line, as each run states; on the latter the UF rate was added to its reading"
    told = line.get(str(meter["used"]), by_run if meter["used"] else unknown)
    return (
        f"The flow meter sits {told}. Its clock was aligned with the device's by the pressures that both log (steps and pump lines; lag and rate), or by its own steps where "
        "the bench logs no pressure, and its mean over the same windows is the reference. A zero that it shows while the pump stands is taken off where it is more than "
        "4 standard errors and 0.3 mL/min."
    )


def _uncertainty(findings: Findings) -> str:
    meter = findings.arrays["meter"].iloc[0]
    parts = [f"{100 * meter['gain_u']:.2g} % of the meter's gain"]
    if meter["uf_u"] > 0.0:
        parts.append(f"{100 * meter['uf_u']:.2g} % of the UF rate that is added")
    if meter["zero_u"] > 0.0:
        parts.append(f"{meter['zero_u']:.0f} Pa of unknown zero (E3)")
    return (
        "Standard errors of coefficients come from the scatter of operating points (means of one speed and clamp setting; a law's misfit lies there and not in the "
        "noise of windows), or from the spread of the coefficients over left-out set-points where that is clearly larger. The covariance of a fit to all windows would be several times too small. "
        f"Type B is added: {listing(parts)}. Flows carry the error of operating points that were left out, and where the meter contradicts them that difference. Errors relative "
        "to the meter are statistics of the windows and carry no interval."
    )
