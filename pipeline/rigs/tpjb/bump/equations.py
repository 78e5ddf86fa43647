"""The equations of `tpjb.bump` as its page and report show them (tpjb.md, T1)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"n_i \cdot (d - d_0) \le c, \qquad n_i = - \begin{pmatrix} \cos (\beta_i + \alpha) \\ \sin (\beta_i + \alpha) \end{pmatrix}, "
        r"\qquad d_0 = \begin{pmatrix} d_{0x} \\ d_{0y} \end{pmatrix}",
        "Clearance polygon: the stator may move until it meets the shaft at pad i, which stands at the angle beta_i. "
        "Each side has a distance c of its own.",
        "Fig. 5",
    ),
    Equation(
        r"d = \mathrm{argmin} \left[ \frac{k_s}{2} |d - s|^2 - F \cdot d + \frac{k_p}{2} \sum_i \max \left( 0, n_i \cdot (d - d_0) - c \right)^2 \right]",
        "Where the stator rests under the force F: pads that give way once they are pressed, and a soft support with its neutral point s.",
        "not in the paper",
    ),
    Equation(
        r"\theta_x = \frac{d_{0x}^{(2)} - d_{0x}^{(1)}}{l}, \qquad \theta_y = \frac{d_{0y}^{(2)} - d_{0y}^{(1)}}{l}",
        "Tilt: the difference of the centres in the two planes of probes over their distance.",
        "not in the paper",
    ),
)
