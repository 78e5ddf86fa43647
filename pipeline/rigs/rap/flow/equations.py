"""The equations of `rap.flow` as its page and report show them (rap.md, 3.4 and 3.5)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"Q_{out} = f \left[ V_g - V_d h(\varphi) \right], \qquad Q = f (V_g - V_d)",
        "Peristaltic pump: each roller passage delivers a volume and sucks a part back when the roller lifts off.",
        "own eq. (5)",
    ),
    Equation(
        r"\hat Q = V_g f - A_1 \left[ y_0 + y_1 (f - f_0) \right], \qquad f_0 = 2\, \mathrm{Hz}",
        "Estimator E2: frequency of the passages, and amplitude of the pressure before the filter at that frequency.",
        "own eq. (6)",
    ),
    Equation(
        r"\hat Q = f \left[ V_0 - C_p (P_{pre} - P_a) \right]",
        "Estimator E3: frequency and mean pressures. E0 and E1 are a constant volume times f.",
        "own, E3",
    ),
    Equation(
        r"e = \frac{\hat Q - Q_{meter}}{Q_{meter}}, \qquad \max|e|, \qquad e_{rms} = \sqrt{ \overline{e^2} }",
        "Relative errors of the windows against the flow meter.",
        "not in the paper",
    ),
)
