"""The equations of `mre.axial` as its page and report show them (mre.md 3.2)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"F = k d + k_3 d^3 + \alpha w + F_{off}",
        "Force of a pad in slow compression: spring, stiffening, hysteresis, and the zero of the load cell.",
        "not in the paper",
    ),
    Equation(
        r"\dot w = \rho \left( \dot d - |\dot d| w \right), \qquad w(0) = 0",
        "Hysteretic variable: eq. (12) with C = n = 1, which has a closed form on every stroke.",
        "after eq. (12)",
    ),
    Equation(
        r"w_{up} = 1 - e^{-\rho d}, \qquad w_{down} = -1 + (1 + w_m)\, e^{-\rho (d_{max} - d)}, \qquad w_m = 1 - e^{-\rho d_{max}}",
        "The same along the first compression and the release that follows.",
        "not in the paper",
    ),
    Equation(
        r"F(d_{max})/d_{max} = k + k_3 d_{max}^2 + \frac{\alpha w_m}{d_{max}}",
        "Secant stiffness: the force at the turn over the displacement there.",
        "not in the paper",
    ),
    Equation(
        r"dF/dd = \frac{\sum (d_i - \bar d) F_i}{\sum (d_i - \bar d)^2}",
        "Slope stiffness: a straight line regressed on the loading branch over 20 to 80 % of the largest displacement.",
        "not in the paper",
    ),
    Equation(
        r"W/W_l = \frac{\oint F\, dd}{\int_{loading} F\, dd}, \qquad \alpha(1+w_m)",
        "Share of the loading work that is lost, and the force by which the release lies below the loading.",
        "not in the paper",
    ),
    Equation(
        r"\Delta k/k = \frac{k(I) - k(0)}{k(0)}",
        "Stiffening by the field, of the secant and of the slope stiffness.",
        "Fig. 8",
    ),
)
