"""The equations of `rap.pressures` as its page and report show them (rap.md, sections 3 and 5)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"t = t_d + \Delta + \rho (t - t_{ref})",
        "Bench time t of a stamp of the device: lag at mid-run, and the rate of its clock.",
        "not in the paper",
    ),
    Equation(
        r"H(\omega, t) = g \frac{1 + i \omega \tau_b}{1 + i \omega \tau_d} e^{i \omega [\Delta + \rho (t - t_{ref})]}",
        "Device over bench at the lines of the pump, each through its own pole.",
        "own eq. (2)",
    ),
    Equation(
        r"\gamma^2 = \frac{|S_{db}|^2}{S_{dd} S_{bb}}",
        "Coherence of both at such a line.",
        "not in the paper",
    ),
    Equation(
        r"P_{device} = g P_{bench} + o",
        "Gain and offset: a line with errors in both (Deming), through means of windows.",
        "own eq. (10)",
    ),
    Equation(
        r"\bar d = \overline{P_{device} - P_{bench}}, \qquad \bar d - 1.96 s_d, \qquad \bar d + 1.96 s_d",
        "Bias and limits of agreement of the aligned samples (Bland and Altman).",
        "not in the paper",
    ),
    Equation(
        r"\mathrm{TMP} = \frac{P_{pre} + P_{ret}}{2} - P_{uf}, \qquad Q_m = K_{uf} \mathrm{TMP}",
        "Pressure across the membrane, and what it drives through it.",
        "own eq. (1)",
    ),
    Equation(
        r"P_a = - R_a Q, \qquad P_{pre} - P_{ret} = R_f \left( Q - \frac{Q_{uf}}{2} \right), \qquad P_{ret} = R_r (Q - Q_{uf})",
        "Steady state of the circuit: its three resistances from mean pressures and flows.",
        "own eq. (3)",
    ),
    Equation(
        r"\frac{P_{ret}}{P_{pre}} = \frac{1/R_f - G_m}{s C_2 + 1/R_f + 1/(R_r + s L_r) + G_m}, \qquad "
        r"G_m = \frac{K_{uf}}{2} \left( \frac{1}{2} - \frac{K_{uf}/2}{s C_u + K_{uf}} \right)",
        "Transfer from filter inlet to return at the lines of the pump: compliance and inertance of the return line.",
        "own eq. (4)",
    ),
    Equation(
        r"C_u \dot P_{uf} = Q_m - Q_{uf}",
        "Ultrafiltrate side: its compliance shows in the course after a step of the ultrafiltration.",
        "own eq. (3)",
    ),
)
