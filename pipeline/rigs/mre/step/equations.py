"""The equations of `mre.step` as its page and report show them (mre.md 3.4)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"F(t) = F_0 + g\, y(t - L) - c \log_{10} (1 + t)",
        "Force after a step of the coil current: the lagged current, late by a dead time, and creep.",
        "not in the paper",
    ),
    Equation(
        r"\tau_1 \dot y_1 + y_1 = I(t), \qquad \tau_2 \dot y + y = y_1, \qquad \tau_1 \ge \tau_2",
        "One or two lags of the measured current, each exact for a current that is straight between its samples.",
        "not in the paper",
    ),
    Equation(
        r"\frac{y(t_{63} - L) - y(0)}{y(\infty) - y(0)} = 1 - e^{-1}, \qquad \frac{y(t_{90} - L) - y(0)}{y(\infty) - y(0)} = 0.9",
        "Times from the onset of the current to 63.2 % and 90 % of the change of the force.",
        "not in the paper",
    ),
    Equation(
        r"\Delta F = g \left( y(\infty) - y(0) \right)",
        "Change of the force by the step, creep taken out.",
        "not in the paper",
    ),
)
