"""The equations of `tpjb.dynamic` as its page and report show them (tpjb.md, T2)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"F_b = F - \left( m_s - \frac{k_s}{\omega^2} \right) a",
        "Force on the oil film, from the measured force and the absolute acceleration of the stator (phasors of each tone).",
        "not in the paper",
    ),
    Equation(
        r"H = \begin{pmatrix} F_{b,f} & F_{b,a} \end{pmatrix} \begin{pmatrix} D_f & D_a \end{pmatrix}^{-1}",
        "Impedance from two excitations, in phase (f) and antiphase (a), with the displacement D of the stator against the shaft.",
        "eq. (2)",
    ),
    Equation(
        r"H(\omega) = \begin{pmatrix} k_{xx} & k_{xy} \\ k_{yx} & k_{yy} \end{pmatrix} "
        r"+ i \omega \begin{pmatrix} c_{xx} & c_{xy} \\ c_{yx} & c_{yy} \end{pmatrix}",
        "Dynamic coefficients: real part and imaginary part over the angular frequency.",
        "eq. (1)",
    ),
)
