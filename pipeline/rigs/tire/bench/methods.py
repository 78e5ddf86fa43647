"""The methods paragraphs of `tire.bench`, written from the findings and the settings that were used."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    if "runs" not in findings.arrays:
        return []
    paragraphs = [_passages(findings), _references()]
    if not findings.arrays["calibration"].empty:
        paragraphs.append(_calibration(findings))
    if not findings.arrays["ring"].empty:
        paragraphs += [_ring(findings), _uncertainty(findings)]
    if not findings.arrays["film"].empty:
        paragraphs.append(_film())
    return paragraphs


def _passages(findings: Findings) -> str:
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    return (
        "A flex sensor and a PVDF film on the inner liner of a tire were logged by a radio on the wheel (Breglio et al. 2019). Samples were put "
        "on the grid of the microcontroller by index and packet counter; lost ones stay empty and are never interpolated. Divider voltages "
        "became resistance R2 by the inverse of eq. (4), and everything was worked out in R2. Passages were found as the high peaks of the flex "
        "sensor and timed by least squares against the running mean of aligned passages and its derivative, over valid samples only. Phase "
        "between passages is a monotone cubic (order tracking, Fyfe and Munck 1997); each revolution was sorted into angle bins and the "
        "revolutions averaged with their baselines removed (synchronous average, Braun 2011), outliers rejected. Standard errors come from "
        f"the scatter of the revolutions. Peak, dips and lengths were read off the mean, orders beyond those that the sensor feels faded out.{told}"
    )


def _references() -> str:
    return (
        "Load (and hub height) of a run is the mean of the bench's channel about its passages, speed that over the same revolutions. The effective rolling radius is the slope of the "
        "line through the origin of surface speed over mean rotation, V = Re Ω, weighted by the noise of the means; an intercept was tested for "
        "and not kept. Re was taken as the belt's radius R, as an inextensible belt without slip rolls on it."
    )


def _calibration(findings: Findings) -> str:
    n = int(findings.arrays["calibration"]["used"].sum())
    return (
        f"The peak of the averaged R2 over its mean was regressed on load as a quadratic ({counted(n, 'run')}), and inverted with the classical "
        "calibration interval (Fieller 1954): load was never regressed on peak. The lack of fit was tested where loads repeat. The sensitivity in volts is the "
        "slope at mid-range through eq. (4). Runs were held against each other before: flex over PVDF at one speed, peak over load; the one without "
        "which the others agree best was left out where it departs from their law by more than 3 % and four standard errors."
    )


def _ring(findings: Findings) -> str:
    fit = findings.arrays["fit"].iloc[0]
    return (
        "The belt is an inextensible elastic ring under pressure on a radial and a tangential foundation (after Gong 1993, derived anew), the "
        "tread a layer of springs kt on a flat rigid road; the contact was solved by an active set on "
        "4096 angles. The sensor averages the curvature over its length Ls and lags by tau_f. EI, b, kw, kv, kt, eta, c, tau_f and Ls were "
        f"fitted to the averaged waveforms of {counted(len(findings.arrays['ring_runs']), 'run')} at once by bounded least squares (a decade "
        f"either side of the start, further starts where one ends at a bound or far from the data), each bin weighted by its standard error; angle, R0, a drift of R0 "
        f"and the error of the mean load of each run were fitted along. R = {1e3 * fit['R']:.2f} mm, Ro = {1e3 * fit['Ro']:.1f} mm. The contact length is the span over which the fitted "
        "road presses. Model and data were both cut at the sensor's highest useful order. A residual that is larger than its noise and correlated "
        "from angle to angle is told as misfit, and no parameter then stands as the truth."
    )


def _uncertainty(findings: Findings) -> str:
    table = findings.arrays["type_b"]
    shares = [
        f"{_SOURCES.get(str(row['source']), str(row['source']))} {100 * row['relative']:.2g} %"
        for row in table.to_dict("records")
        if math.isfinite(row["relative"]) and row["relative"] > 0.0
    ]
    return (
        "Covariances of the fit were scaled by the reduced chi-square where it exceeds one and by the correlation of the residual (type A). What "
        f"all runs share was propagated to first order and added (type B, GUM): {listing(shares, 8)} (relative standard uncertainties). "
        "Parameters that the data cannot tell from one another are null, with the reason; intervals are symmetric in the logarithm for "
        "positive parameters."
    )


_SOURCES = {
    "pressure": "inflation pressure",
    "load_gain": "gain of the load cell",
    "belt_radius": "belt radius",
    "outer_radius": "free radius",
    "sensor_length": "length of the sensor",
}


def _film() -> str:
    return (
        "The PVDF was compared with the flex sensor order by order: V_p,n/R2_n = G' e^(i n dtheta) S(n L_p)/S(n Ls) i n Ω tau_p (1 + i n Ω "
        "tau_f)/(1 + i n Ω tau_p), S(n L) = sin y/y with y = n L/(2R). G', tau_p, tau_f and dtheta were fitted to all runs with errors in both signals, and the "
        "voltage predicted from the flex sensor's waveform; the rms of its misfit over that of the voltage is told for each run."
    )
