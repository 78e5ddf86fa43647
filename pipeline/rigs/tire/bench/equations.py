"""The equations of `tire.bench` as its page and report show them (tire.md, section 3)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

RING = (
    Equation(
        r"w_n = \frac{q_{w,n} - \frac{i}{n} q_{v,n}}{K_n}, \qquad k_n = \frac{(1 - n^2)\, w_n}{R^2}",
        "Belt as an inextensible ring that rolls steadily: radial displacement and curvature by order n of the revolution.",
        "not in the paper",
    ),
    Equation(
        r"K_n = \frac{EI}{R^4} (n^2 - 1)^2 + \frac{p_0 b}{R} (n^2 - 1) + k_w (1 + i \eta\, \mathrm{sgn}\, n) + \frac{k_v (1 + i \eta\, \mathrm{sgn}\, n)}{n^2}",
        "Stiffness of order n: bending, inflation pressure on the belt's width, radial and tangential foundation with their loss.",
        "not in the paper",
    ),
    Equation(
        r"p = k_t \max (0, g), \qquad F_z = R \int p\, d\theta",
        "Contact with a flat road through the tread, g being the penetration; pressure and load follow together. "
        "L_c is the length on which p is positive.",
        "not in the paper",
    ),
    Equation(
        r"R_{2,n} = c\, k_n \frac{\sin y}{y} \frac{1}{1 + i n \Omega \tau_f}, \qquad y = \frac{n L_s}{2 R}, \qquad R_{2,0} = R_0",
        "Flex sensor: mean of the curvature over its length, lagged; its resistance at rest is the mean of a revolution.",
        "eq. (3)",
    ),
)
EQUATIONS = (
    *RING,
    Equation(
        r"V = V_{IN} \frac{R_2}{R_1 + R_2}, \qquad dV/dF_z = \frac{V_{IN} R_1}{(R_1 + R_2)^2} (a_1 + 2 a_2 F_z)",
        "Voltage divider, and the sensitivity to load that it leaves at mid-range.",
        "eq. (4)",
    ),
    Equation(
        r"\Delta R_{2,peak} = a_0 + a_1 F_z + a_2 F_z^2",
        "Calibration: peak of the sensor over the load. The dips beside it, \u0394R_2,lead and \u0394R_2,trail, count from the same mean.",
        "not in the paper",
    ),
    Equation(
        r"V = R_e \Omega",
        "Rolling radius: surface speed of the drum over the rotation of the wheel.",
        "Fig. 9b",
    ),
    Equation(
        r"L_d = R (\theta_{trail} - \theta_{lead}), \qquad L_c < L_d",
        "Deformation length, between the dips. L_slope, between the steepest slopes, and L_zero, between the zero crossings, are no contact "
        "lengths either.",
        "not in the paper",
    ),
    Equation(
        r"\frac{V_{p,n}}{R_{2,n}} = G' e^{i n \Delta\theta} \frac{S(n L_p)}{S(n L_s)} \frac{i n \Omega \tau_p (1 + i n \Omega \tau_f)}{1 + i n \Omega \tau_p}",
        "PVDF film over flex sensor, order by order, S being the mean over the length of each.",
        "not in the paper",
    ),
    Equation(
        r"NRMSE = \sqrt{ \frac{\sum (V_p - \hat V_p)^2}{\sum V_p^2} }, \qquad p = \frac{N_{missing}}{N_{sent}}",
        "Misfit of the film's prediction, over its own size, and share of packets that are missing.",
        "not in the paper",
    ),
)
