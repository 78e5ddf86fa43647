"""The equations of `mre.shear` as its page and report show them (mre.md 3.5 and 3.6)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

DYNAMIC_MODEL = (
    Equation(
        r"F = k_1 (x - y) + k_2 x + k_{MR}(I)\, x + s_{MR}(I)\, \dot x + a_{BW} w + m \ddot x",
        "Force on the platelet: Maxwell branch, static stiffness, what the field adds, hysteresis, and the moving mass where it is "
        "not tared. k_MR and s_MR are zero without current.",
        "eq. (10)",
    ),
    Equation(
        r"k_1 (x - y) = s_1 \dot y, \qquad \tau = s_1 / k_1",
        "Maxwell branch: a spring in series with a dashpot to ground. The print has the velocity of x - y on the right, which is unstable.",
        "eq. (11), corrected",
    ),
    Equation(
        r"\dot w = \rho \left( \dot x - C |\dot x|\, |w|^{n-1} w + (C - 1)\, \dot x |w|^n \right)",
        "Hysteretic variable, between -1 and 1; independent of the rate, so it is integrated over x.",
        "eq. (12)",
    ),
    Equation(
        r"F_{logged}(t) = F(t - \delta)",
        "The force is logged late by a lag that is fitted, or known from calibration.",
        "not in the paper",
    ),
)
EQUATIONS = (
    *DYNAMIC_MODEL,
    Equation(
        r"k_1+k_2, \qquad k_2+a_{BW}\rho",
        "Sums that are told in place of their members where only they are known: the stiffness of fast large loops, and of slow small ones.",
    ),
    Equation(
        r"F_r \to (1 + g_r) F_r, \qquad g_r \sim N(0, s_g^2)",
        "Each run r may have a small gain error of its own; its scatter is estimated and widens the intervals.",
        "not in the paper",
    ),
    Equation(
        r"K' = \mathrm{Re} \frac{F_1}{X_1}, \qquad K'' = \mathrm{Im} \frac{F_1}{X_1}, \qquad \eta = \frac{K''}{K'}",
        "First harmonics of a run's loop: storage and loss stiffness, loss factor.",
        "not in the paper",
    ),
    Equation(
        r"\sigma = \frac{\oint F\, dx}{\pi \omega X^2}, \qquad F_{max}/x_{max}",
        "Equivalent viscous damping and secant stiffness of the fitted loop, from half its height over half its width.",
        "section 5.2",
    ),
    Equation(
        r"G' = \frac{K' h}{2A}, \qquad G'' = \frac{K'' h}{2A}, \qquad G = \frac{h}{2A} \frac{\Delta F}{\Delta x}",
        "Moduli of two pads of height h and area A; G from the half cycle between the turns.",
        "not in the paper",
    ),
    Equation(
        r"W = W_l - W_u, \qquad W_l = \int_{loading} F\, dx, \qquad W/W_l",
        "Work lost in a half cycle: that of loading less what unloading gives back. Their ratio is the share lost.",
        "not in the paper",
    ),
    Equation(
        r"\Delta K/K = \frac{K(I) - K(0)}{K(0)}",
        "Effect of the field: increment of the secant stiffness, once at equal force and once at equal amplitude.",
        "equal force: Fig. 17",
    ),
)
