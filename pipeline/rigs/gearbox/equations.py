"""The equations of `gearbox.load_exchange` as its page and report show them (gearbox.md, section 3)."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"u_n = - \frac{N_{R,n}}{N_{S,n}} = \frac{\omega_S - \omega_{Cn}}{\omega_R - \omega_{Cn}}, \qquad n = 1, 2",
        "Kinematics of both planetary trains (Willis): N are teeth of ring and sun, S, R and C stand for sun, ring and carrier.",
        "eqs (1), (2)",
    ),
    Equation(
        r"\omega_R = \frac{(u_1 - 1)\, \omega_{C1} - (u_2 - 1)\, \omega_{C2}}{u_1 - u_2}, \qquad \omega_S = (\omega_R - \omega_{C1})\, u_1 + \omega_{C1}",
        "Speeds of ring and sun from those of input and output carrier. FOS: all turn together; SOS: the output stands.",
        "eqs (3), (4)",
    ),
    Equation(
        r"T_{out} = J_L \dot \omega_{C2} + d_0\, \mathrm{sgn}\, \omega_{C2} + d_1 \omega_{C2} + T_b(t)",
        "Torque balance of what turns behind the output sensor, with the brake's torque T_b.",
        "not in the paper",
    ),
    Equation(
        r"T_{out} = a (T_{in} - T_{00})",
        "Transfer of torque while locked at constant speed, and in each phase.",
        "not in the paper",
    ),
    Equation(
        r"T_0(\omega) = c_0 + c_S e^{-(\omega/\omega_S)^2} + b_0 \omega",
        "Drag to ground of the locked gearbox, seen at the input: constant, Stribeck and viscous part.",
        "not in the paper",
    ),
    Equation(
        r"M_{slip} = \frac{T_{out}}{a} = M_c + M_v s, \qquad s = \omega_{C1} - \omega_{C2}, \qquad M_{lock} = \max (T_{in} - T_0)",
        "Torque of the slipping gears with the output held, over the slip speed, and the torque at which the lock breaks.",
        "not in the paper",
    ),
    Equation(
        r"\eta = \frac{T_{out} \omega_{C2}}{T_{in} \omega_{C1}}, \qquad P_{diss} = T_{in} \omega_{C1}, \qquad T_{out}/T_{in}",
        "Efficiency while locked. With the output standing no power leaves: all of the input becomes heat, and the ratio of torques is one of "
        "reactions.",
        "eqs (7), (8)",
    ),
    Equation(
        r"q_{in} = \frac{T_{in,SOS}}{\hat T_{in}}, \quad r_{in} = 1 - q_{in}, \qquad q_{out} = \frac{T_{out,SOS}}{\hat T_{out}}, \quad r_{out} = 1 - q_{out}",
        "What is left of the brake's peak once the output stands, and what is relieved.",
        "sections 4, 5",
    ),
    Equation(
        r"\Delta T_{s,in} = \hat T_{in,start} - T_{in,FOS}, \qquad \Delta T_{s,out} = \hat T_{out,start} - T_{out,FOS}",
        "Excess of the start-up's peak over the steady torque.",
        "sections 4, 5",
    ),
    Equation(
        r"\Delta T_{drop} = \hat T_{in} - T_{in,SOS}, \qquad \Delta T_{rise} = \hat T_{in} - T_{in,FOS}",
        "How far the input torque falls when the lock breaks, and how far it rose before.",
        "sections 4, 5",
    ),
    Equation(
        r"a_{rms} = \sqrt{ \overline{a(t)^2} }",
        "Level of the acceleration above 2 Hz in a steady stage.",
        "not in the paper",
    ),
)
