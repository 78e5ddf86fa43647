"""The methods paragraphs of `rap.pressures`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.rigs.rap.pressures.declaration import MMHG


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    if "runs" not in findings.arrays or findings.arrays["runs"].empty:
        return []
    paragraphs = [_data(findings)]
    if not findings.arrays["clock"].empty:
        paragraphs.append(_clock(findings))
    if not findings.arrays["agreement"].empty:
        paragraphs.append(_agreement(findings))
    if not findings.arrays["levels"].empty:
        paragraphs.append(_hydraulics())
    return paragraphs


def _data(findings: Findings) -> str:
    runs = findings.arrays["runs"]
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    return (
        f"{counted(len(runs), 'run')} of a wearable ultrafiltration device (RAP 2019) on its bench: access, pre-filter, return and ultrafiltrate pressures of device and bench, each "
        "with the stamps of its own clock. Before any number, units, signs and the order of the taps were judged by what a running pump does to each tap; frozen and "
        f"saturated samples were taken out, and windows with a gap were not used.{told}"
    )


def _clock(findings: Findings) -> str:
    clock = findings.arrays["clock"].iloc[0]
    return (
        "The clocks were aligned before anything was compared. Coarse: what steps (starts, stops, changes of speed) was cross-correlated within ±30 s after the pulsation was filtered "
        "off; the lag counts as unambiguous where the second peak stays below 0.9 of the first. Fine: complex amplitudes of the pump's harmonics in both records, window by window, at "
        "the stamps as they are (in the spirit of Knapp and Carter 1976); their ratio was fitted with eq. (2): gains, poles of the device's channels, lag at mid-run and rate of the "
        f"clock, robustly and weighted by the lines' errors; the bench's pole was {1e3 * float(clock['bench_pole']):g} ms"
        f"{' as stated' if bool(clock['bench_pole_stated']) else ', assumed with as much uncertainty'}. One pole stands for all taps where they agree. Errors come from groups of windows, "
        "not from single ones."
    )


def _agreement(findings: Findings) -> str:
    settings = findings.settings
    ratios = findings.arrays["gains"]["noise_ratio"].dropna()
    ratio = f"{ratios.min():.2g} to {ratios.max():.2g}" if len(ratios) else "nothing"
    thresholds = findings.arrays["coherence"]
    level = float(thresholds["threshold"].median()) if len(thresholds) else float("nan")
    coherence = (
        f" Coherence (Carter, Knapp and Nuttall 1973) was read at the pump's lines only, with a 95 % threshold of {level:.2f}."
        if np.isfinite(level)
        else ""
    )
    return (
        "For the agreement the bench was read at the device's samples by a spline on its Fourier series and went through the device's pole instead of its own. Bias and limits of agreement "
        "(Bland and Altman 1986, 1999) were taken of samples, of 5 s means and of stroke amplitudes, with intervals from blocks of 20 s. Gain and offset are Deming's regression of 5 s means, "
        f"with a ratio of the noise variances of {ratio} as the floors of the spectra give it, standstill included; its errors are those that the scatter of all means gives, those that hang together counted by their effective number. Tolerances: gain "
        f"{100 * float(settings.get('gain_tolerance', 0.02)):g} %, offset {float(settings.get('offset_tolerance', MMHG)) / MMHG:.3g} mmHg, the whole interval within.{coherence}"
    )


def _hydraulics() -> str:
    return (
        "Resistances are lines through the origin of mean pressures over the flow that passes (Q, Q - Q_uf/2, Q - Q_uf), whole strokes, zero at the pump stop taken off. C_2 and L_r were "
        "fitted to the complex ratio of return to pre-filter pulsation (eq. 4), harmonics 1 to 3 at all speeds, with R_f, R_r and K_uf as found; K_uf from UF rate over TMP = (P_pre + P_ret)/2 - P_uf, C_u "
        "from how the ultrafiltrate pressure follows when ultrafiltration is switched. Errors of the flow's gain go into all of them. The compliance before the filter and what lies "
        "before the access sensor cannot be told from such a log."
    )
