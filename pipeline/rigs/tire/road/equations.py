"""The equations of `tire.road`: the bench's ring in every revolution, and the tracks over them (tire.md, 3.2 and 5)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation
from pipeline.rigs.tire.bench.equations import RING

EQUATIONS = (
    *RING,
    Equation(
        r"V = V_{IN} \frac{R_2}{R_1 + R_2}, \qquad R_2(\theta) = R_0 + 2\, \mathrm{Re} \sum_{n \ge 1} R_{2,n}(F_z, F_x)\, e^{i n \theta}",
        "Each revolution is fitted in the divider's voltage for load, longitudinal force, angle and resistance at rest, with the ring of the bench.",
        "eq. (4)",
    ),
    Equation(
        r"\Omega_j = \frac{2 \pi}{t_{j+1} - t_j}, \qquad V = R_e \Omega",
        "Rotation from passage to passage, and peripheral speed.",
        "not in the paper",
    ),
    Equation(
        r"z_{j+1} = \begin{pmatrix} 1 & \Delta t \\ 0 & 1 \end{pmatrix} z_j + v_j, \qquad \mathrm{cov}\, v_j = q^2 \begin{pmatrix} \Delta t^3/3 & \Delta t^2/2 \\ \Delta t^2/2 & \Delta t \end{pmatrix}",
        "Tracks: value and slope of load, force and rotation in a Kalman filter, the slope a random walk.",
        "not in the paper",
    ),
    Equation(
        r"\mathrm{rms}(F_z) = \sqrt{ \overline{(F_z - F_{z,ref})^2} }, \qquad \mathrm{rms}(F_x) = \sqrt{ \overline{(F_x - F_{x,ref})^2} }",
        "Filtered tracks against the reference channels.",
        "not in the paper",
    ),
    Equation(
        r"p = \frac{N_{missing}}{N_{sent}}",
        "Share of packets that are missing.",
        "not in the paper",
    ),
)
