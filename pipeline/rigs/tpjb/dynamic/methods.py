"""The methods paragraphs of `tpjb.dynamic`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    paragraphs = [_blocks(findings), _impedance(findings)]
    if "synchronous" in findings.arrays:
        paragraphs.append(_laws())
    paragraphs.append(_errors())
    return paragraphs


def _blocks(findings: Findings) -> str:
    orders = findings.settings.get("shaft_orders", 4)
    lengths = sorted({float(x) for x in findings.arrays["blocks"]["length"]}) if "blocks" in findings.arrays else []
    told = f" ({', '.join(f'{x:.4g}' for x in lengths)} s)" if lengths else ""
    return (
        f"Each log was cut into blocks of whole cycles of all tones{told}. In each block offset, drift, the tones at their exact "
        f"frequencies and shaft orders 1 to {orders}, with the integral of the measured speed as phase, were fitted to every channel by least "
        "squares at the recorded stamps. Which excitation a block belongs to was told by its forces; blocks across a change of it, and "
        "blocks with a jump, a spike or a stuck channel, were left out. Gaps were mapped to the displacement of the stator against the shaft in "
        "the middle plane; inverted, dead and contradicting probes were told by the tones and left out."
    )


def _impedance(findings: Findings) -> str:
    lag = findings.settings.get("displacement_lag")
    late = f" The displacement was moved by its calibrated lag of {1e6 * float(lag):.3g} us." if lag else ""
    return (
        "The force on the film is F - (m_s - k_s/w^2) a with the measured absolute acceleration a of the stator (floating-stator "
        "principle, Childs and Hale 1994); the displacement does not serve for it, since the shaft moves as well. The impedance is the ratio of "
        "coherent means over the blocks of the two excitations, H = [F_f F_a][D_f D_a]^-1 (Ciulli and Forte 2019, eq. 2), the "
        "maximum-likelihood estimate for periodic signals with noise on both sides (Pintelon and Schoukens 2012); K = Re H and C = Im H/w. Records "
        f"need no common origin of time.{late} Tones that stand on a shaft order, are not driven, or do not tell both directions "
        "were dropped and are listed."
    )


def _laws() -> str:
    return (
        "Over frequency each coefficient was fitted by polynomials of degree 0, 1 and 2 in f/f_shaft - 1; the lowest degree whose "
        "chi-square stays below its 99 % point was taken. The synchronous coefficient is the law's value at the shaft's frequency. "
        "Where any coefficient goes with frequency, all are read from a degree more: a trend too small for chi-square would bias the lower degree. "
        "Where none does, a degree more was taken only where its coefficient exceeds two standard errors, and by how much the next degree would move "
        "the value is added to the error (in squares; three quarters of its chance spread at least). Weights come from "
        "standard errors smoothed over the tones, the covariance from the errors themselves. Where even the parabola is rejected, at 1 % for all coefficients of the campaign together (Bonferroni), errors are "
        "widened to the scatter about it."
    )


def _errors() -> str:
    return (
        "Type A: with e = F - H D of each block, the covariance of its mean under excitation m, G_m, and row m of D^-1, "
        "w_m, the covariance of H is the sum of G_m (x) w_m w_m^H, real and imaginary part having half each. Intervals are Student's with the blocks "
        "less one as degrees of freedom of each excitation (Satterthwaite for their sum). The stated gain errors of probes and load cells, which scale all "
        "coefficients alike, and the error of the stator's mass and stiffness, which acts through a/D, are added in squares as type B. A displacement "
        "that is late by dt raises C by K dt and lowers K by w^2 C dt; that is in no interval."
    )
