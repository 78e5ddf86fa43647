"""The methods paragraphs of `mre.shear_rich`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.rigs.mre.rich.joint_filter import R_END, R_FADES, R_START, R_START_SHARE


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    paragraphs = [_selection(findings), _batch(findings)]
    if "online" in findings.arrays:
        paragraphs.append(_online(findings))
    if "agreement" in findings.arrays:
        paragraphs.append(
            "That k1, tau, a_BW, rho, C and n do not depend on the current was tested, not assumed: records were fitted each on its own, "
            "and the weighted sum of squares of their differences, with the covariance matrices of the fits, was held against chi2."
        )
    return paragraphs


def _selection(findings: Findings) -> str:
    left = [run.run for run in findings.runs if not run.used]
    told = f" Left out: {listing(left, 8)}, each for the reason given." if left else ""
    return (
        "Each record was taken by itself. Still stretches at the ends, lone wild samples, samples in which a sensor hung and flat tops of a clipped channel "
        f"do not enter.{told}"
    )


def _batch(findings: Findings) -> str:
    records = findings.arrays["records"]
    low, high = float(records["cutoff"].min()), float(records["cutoff"].max())
    cutoff = f"{low:.3g} Hz" if high < 1.01 * low else f"{low:.3g} to {high:.3g} Hz"
    lag = findings.settings.get("force_lag", "fit")
    told = "was fitted along" if lag == "fit" else f"was held at {1e6 * float(lag):.3g} us"
    return (
        "Batch fit: the dynamic model of Brancati et al. (2019, eqs 10 to 12, the dashpot of eq. 11 to ground; the Bouc-Wen model is surveyed by "
        "Ismail et al. 2009) was integrated along the displacement, low-passed without phase shift at "
        f"{cutoff} (three times the highest motion), over the path and not over time. The force is linear in all but tau, rho, C, n and "
        "the lag, so that variable projection (Golub and Pereyra 1973, Kaufman 1975) with analytic derivatives was used, from "
        f"{findings.settings.get('starts', 2)} starts on the liveliest part. With a field, k2 stands for k2 + k_MR and a viscous column gives s_MR. "
        f"A constant lag of the force {told}. Offset, mains lines and, where the data ask for it, a slow drift are fitted along. Standard errors allow for residuals "
        "that are correlated in time (Newey and West 1987), over two and a half periods of the low-pass, and are no smaller than sixty stretches of the record scatter. What a cubic of a sensor or of the pad, a gain that changes, or viscous damping without a field would find in the residual is held against the scatter of sixty stretches; what is seen is told, and widens the intervals by what it would shift. The fit of the first half predicts the second, as a test. "
        "Intervals hold 95 %."
    )


def _online(findings: Findings) -> str:
    records = findings.arrays["records"]
    known = records[records["online_delay"].notna()] if "online_delay" in records else records.head(0)
    delay = f"{1e3 * float(known['online_delay'].max()):.0f} ms" if len(known) else "half its length"
    step = f"{1e3 * float(known['online_step'].median()):.2g} ms" if len(known) else "about 1 ms"
    cutoff = float(findings.settings.get("online_cutoff", 60.0))
    return (
        "Online filter: a joint unscented Kalman filter (Julier and Uhlmann 2004; Wan and van der Merwe 2000; scaled sigma points with α = 0.5, β = 2, κ = 0; filterpy) with "
        "the state w, u, ln k1, ln tau, ln k2, ln a_BW, ln rho, ln(C - 1/2), ln(n - 1), and beside these offset, lag and, with a field, s_MR. "
        f"Displacement goes through a symmetric low-pass of {cutoff:g} Hz that looks ahead: steps of {step} follow {delay} behind the log, without phase "
        "shift; a causal low-pass on the displacement alone would distort the loop. It starts from a coarse grid of shapes on the first three seconds. "
        f"The variance of the measurement is annealed, R = {R_END:g} σ^2 + R_0 exp(-t/{R_FADES:g} s), R_0 the larger of {R_START:g} σ^2 and the square of {100 * R_START_SHARE:g} % of the "
        "force's amplitude, σ the noise of the force from its third differences. The filter counts as converged where its innovations stay below 1.5 times the noise, "
        "no parameter moves by more than 5 % in the last quarter, and it ends within 5 % of the batch fit."
    )
