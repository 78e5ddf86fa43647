"""The equations of `rap.therapy` as its page and report show them (rap.md, 3.6 to 3.11)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"h_c = z_s - D \frac{c(T)}{c_{ref}} + \frac{n_x \Delta x + n_y \Delta y}{n_z}, \qquad V = A h_c, \qquad c(T) = 331.3 \sqrt{ \frac{T}{273.15} }",
        "Ultrafiltrate in a tilted tank from an ultrasonic distance D: level at the centroid, with the up vector n in the tank's frame and the speed "
        "of sound (T in K, c in m/s). V_end is the volume at the end.",
        "own eq. (8)",
    ),
    Equation(
        r"\begin{pmatrix} V \\ s \end{pmatrix}_{k+1} = \begin{pmatrix} 1 & u_k \Delta t \\ 0 & 1 \end{pmatrix} \begin{pmatrix} V \\ s \end{pmatrix}_k + v_k",
        "Kalman filter of volume and pump gain: u is the commanded rate, s what is delivered of it.",
        "own eq. (9)",
    ),
    Equation(
        r"V_{end} = V(t_{end}), \qquad e_{V,rms} = \sqrt{ \overline{(V - V_{weighed})^2} }",
        "Final volume, and its course held against the scale after the first echo.",
        "own eqs (8), (9)",
    ),
    Equation(
        r"K_{uf}(t) = \frac{K_0}{1 + a\, t / t_{ref}}, \qquad t_{ref} = 5\, \mathrm{h}, \qquad K_{uf} = \frac{Q_{uf}}{\mathrm{TMP} - \sigma \Delta \pi}",
        "Membrane: its resistance grows in proportion to time.",
        "not in the paper",
    ),
    Equation(
        r"T(t) = T_\infty + (T_0 - T_\infty)\, e^{-t/\tau}",
        "Warming of the housing by the device's own power.",
        "own eq. (7)",
    ),
    Equation(
        r"|\Delta T|_{max} = \max |T_{device} - T_{bench}|",
        "Largest difference of the device's temperature to the bench's.",
        "not in the paper",
    ),
    Equation(
        r"E = \int P\, dt, \qquad t_{run} = \frac{\eta E_0}{\bar P}",
        "Energy used, and how long the full battery lasts at the mean power.",
        "not in the paper",
    ),
    Equation(
        r"S_k = \max (0, S_{k-1} + \bar r_k - \kappa), \qquad r = y_{prot} - y_{ctrl}",
        "Redundancy: a two-sided sum of the differences of control and protection unit; a mismatch begins where it passes its limit (t_mis). "
        "Alarms, n_alarm of them at t_alarm, follow from the log by the device's own rules.",
        "not in the paper",
    ),
)
