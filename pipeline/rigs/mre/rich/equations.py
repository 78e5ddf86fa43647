"""The equations of `mre.shear_rich`: the model of `mre.shear` at one current, and its Kalman filter."""

from __future__ import annotations

from pipeline.rigs.experiment import Equation

EQUATIONS = (
    Equation(
        r"F = k_1 (x - y) + k_2 x + s_{MR} \dot x + a_{BW} w + m \ddot x",
        "The dynamic model at one current: with a field, k_2 holds the stiffness that the field adds.",
        "eq. (10)",
    ),
    Equation(
        r"k_1 (x - y) = s_1 \dot y, \qquad \tau = s_1 / k_1",
        "Maxwell branch: a spring in series with a dashpot to ground.",
        "eq. (11), corrected",
    ),
    Equation(
        r"\dot w = \rho \left( \dot x - C |\dot x| |w|^{n-1} w + (C - 1)\, \dot x |w|^n \right)",
        "Hysteretic variable, between -1 and 1.",
        "eq. (12)",
    ),
    Equation(
        r"F_{logged}(t) = F(t - \delta)",
        "The force is logged late by a lag that is fitted, or known from calibration.",
        "not in the paper",
    ),
    Equation(
        r"u_{i+1} = e^{-\Delta t/\tau} u_i + \frac{\tau}{\Delta t} \left( 1 - e^{-\Delta t/\tau} \right) (x_{i+1} - x_i), \qquad u = x - y",
        "The Maxwell branch from sample to sample, exact for a displacement that is straight between them.",
        "not in the paper",
    ),
    Equation(
        r"z = \left( w, u, \ln k_1, \ln \tau, \ln k_2, \ln a_{BW}, \ln \rho, \ln (C - \tfrac{1}{2}), \ln (n - 1) \right)",
        "State of the unscented Kalman filter that follows the record, with the parameters in it.",
        "not in the paper",
    ),
    Equation(
        r"k_1+k_2, \qquad k_2+a_{BW}\rho",
        "Sums that are told in place of their members where only they are known.",
    ),
    Equation(
        r"F = K x + C \dot x",
        "Where a device is linear, the branches of the model cannot be told apart, and spring and damper are told instead.",
    ),
)
