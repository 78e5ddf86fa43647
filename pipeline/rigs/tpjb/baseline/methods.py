"""The methods paragraph of `tpjb.baseline`."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    table = findings.arrays["ratios"]
    return [
        "The stator was excited without contact in the bearing. Each log was cut into blocks of whole cycles of all tones; in "
        "each block offset, drift and the tones were fitted to forces and accelerations by least squares at the recorded stamps. "
        f"From the coherent means over the blocks {len(table)} ratios of force to acceleration were formed, one for each tone, "
        "direction and excitation, with errors from the scatter of force less ratio times acceleration over the blocks.",
        "Mass and stiffness are the weighted least-squares fit of Re(F/a) = m_s - k_s/w^2; the weights pool the errors of one tone, "
        "the covariance uses each error by itself. Where chi-square exceeds its 99 % point the errors are widened to the scatter. "
        "Intervals hold 95 % and contain the stated gain error of the load cells (type B). It scales both numbers and, since the "
        "same cells serve in the dynamic test, cancels there; that of the accelerometers is in no interval.",
    ]
