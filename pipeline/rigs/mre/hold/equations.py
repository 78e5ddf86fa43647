"""The equations of `mre.hold` as its page and report show them (mre.md 3.3)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"F(I, t) = F_0 \left( 1 + a\, S(I/I_s; p) \right) \left( 1 - r \log_{10} \frac{t}{t_0} \right), \qquad t_0 = 10\, \mathrm{s}",
        "Force at a fixed gap against coil current, with relaxation since the gap was closed.",
        "not in the paper",
    ),
    Equation(
        r"S(z; p) = \frac{z}{(1 + |z|^p)^{1/p}}",
        "Saturation: p = 1 is the law of Froehlich and Kennelly, p of 2 to 3 is much like a hyperbolic tangent, a large p straight and then flat.",
        "p = 1: eq. (7)",
    ),
    Equation(
        r"\Delta F/F_0 = a\, S(I/I_s; p)",
        "Increment of the force at a current, relaxation taken out.",
        "not in the paper",
    ),
    Equation(
        r"B(I) = \frac{s_0 I}{\left( 1 + |s_0 I / B_s|^p \right)^{1/p}} + b",
        "Flux density with the same law; the remanence b is one constant for each direction of the sweep.",
        "not in the paper",
    ),
)
