"""The equations of `tpjb.rotating` as its page and report show them (tpjb.md, T3)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"f_x = k_{xx} d_x + k_{xy} d_y + k_{xx2} d_x^2 + k_{xy2} d_y^2 + k_{xxy} d_x d_y",
        "Quasi-static law about the static equilibrium, horizontal. The mixed term is not in the paper.",
        "eq. (3)",
    ),
    Equation(
        r"f_y = k_{yx} d_x + k_{yy} d_y + k_{yx2} d_x^2 + k_{yy2} d_y^2 + k_{yxy} d_x d_y",
        "The same, vertical.",
        "eq. (4)",
    ),
    Equation(
        r"J = \begin{pmatrix} k_{xx} + 2 k_{xx2} d_x + k_{xxy} d_y & k_{xy} + 2 k_{xy2} d_y + k_{xxy} d_x \\ "
        r"k_{yx} + 2 k_{yx2} d_x + k_{yxy} d_y & k_{yy} + 2 k_{yy2} d_y + k_{yxy} d_x \end{pmatrix}",
        "Tangent stiffness, by which the displacement under a force is found with Newton's method; where its determinant reaches 0 the law folds.",
        "not in the paper",
    ),
    Equation(
        r"d_x(t) = \mathrm{Re} \sum_n X_n e^{i n \Omega t}, \qquad d_y(t) = \mathrm{Re} \sum_n Y_n e^{i n \Omega t}",
        "Harmonics of the orbit; amplitudes are told by order.",
        "Fig. 8",
    ),
    Equation(
        r"\mathrm{THD} = \sqrt{ \frac{\sum_{n=2}^{6} \left( |Z_n|^2 + |Z_{-n}|^2 \right)}{|Z_1|^2 + |Z_{-1}|^2} }",
        "Distortion: forward and backward harmonics of what the linear bearing and the load's own harmonics do not explain, over the "
        "displacement at the frequency of the load.",
        "not in the paper",
    ),
    Equation(
        r"\mathrm{THD}(\rho^*) = 0.05, \qquad \rho = F / W_0",
        "Up to this ratio of turning to static load the bearing counts as linear.",
        "not in the paper",
    ),
)
