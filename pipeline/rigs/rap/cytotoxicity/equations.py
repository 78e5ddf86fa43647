"""The equations of `rap.cytotoxicity` as its page and report show them (rap.md, 3.12)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"d_j = \bar m_j - \bar m_c",
        "Difference of a share of cells to the control at time j: d_via, d_nec and d_apo of viability, necrosis and apoptosis.",
        "not in the paper",
    ),
    Equation(
        r"[d_j - t_{0.95} s_j,\ d_j + t_{0.95} s_j] \subset [-\Delta, \Delta]",
        "Equivalent where the 90 % interval lies within the margins at every time: two one-sided tests at 5 %, with the variance pooled over all groups.",
        "not in the paper",
    ),
)
