"""The equations of `tpjb.baseline` as its page and report show them (tpjb.md, T0)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"\frac{F(\omega)}{a(\omega)} = m_s - \frac{k_s}{\omega^2}",
        "Force over acceleration of the stator that hangs free on its stabilisers, tone by tone; its real part is fitted.",
        "not in the paper",
    ),
)
