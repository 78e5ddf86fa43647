"""The equations that documentation and report show are those that the code computes."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from latex_value import value

from pipeline.report.equations import mathml
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import all_experiments

OURS = {id_: e for id_, e in all_experiments().items() if e.identify.__class__.__name__ == "Later"}
# Names that count or time what no equation tells, or stand in words beside one.
IN_WORDS = {
    "gearbox.load_exchange": {"event_time", "torque_in_nominal", "torque_out_nominal"},
    "tire.bench": {"dip_leading", "dip_trailing", "slope_length", "zero_length", "peak_resistance", "packet_loss"},
    "tire.road": {"event_time"},
    "rap.therapy": {"alarm_count", "alarm_time", "mismatch_time"},
    "rap.cytotoxicity": {"viability_difference", "necrosis_difference", "apoptosis_difference"},
}


def _bare(latex: str) -> str:
    return re.sub(r"[\s{}]|\\(left|right|,)", "", latex)


@pytest.mark.parametrize("experiment", OURS.values(), ids=OURS)
def test_every_parameter_stands_in_an_equation(experiment: Experiment) -> None:
    told = " ".join(_bare(equation.latex) for equation in experiment.equations)
    words = IN_WORDS.get(experiment.id, set())
    missing = [p.name for p in experiment.parameters if _bare(p.symbol) not in told and p.name not in words]
    assert not missing


@pytest.mark.parametrize("experiment", OURS.values(), ids=OURS)
def test_every_equation_becomes_mathml(experiment: Experiment) -> None:
    for equation in experiment.equations:
        made = mathml(equation.latex)
        assert made.startswith("<math")
        assert "\\" not in made, f"not understood: {equation.latex}"
        assert equation.about.endswith(".")


def right_side(id_: str, left: str) -> str:
    """Return the right side of the equation of an experiment that begins with `left`, up to the next statement."""
    for equation in OURS[id_].equations:
        for statement in re.split(r",?\s*\\qquad|,?\s*\\quad", equation.latex):
            sides = statement.split(" = ")
            if sides[0].strip() == left:
                return sides[-1].strip().removesuffix(",")
    raise LookupError(f"{id_} has no equation of {left}")


def test_the_law_of_the_bearing() -> None:
    from pipeline.rigs.tpjb.rotating import law

    p = np.array([1.1, 0.2, 0.3, 1.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
    numbers = {f"k_{{{name[1:]}}}": x for name, x in zip(law.COEFFICIENTS, p, strict=True)} | {"d_x": 0.3, "d_y": -0.7}
    told = [value(right_side("tpjb.rotating", f), numbers) for f in ("f_x", "f_y")]
    assert told == pytest.approx(law.force(p, np.array([0.3, -0.7])).tolist(), rel=1e-12)


def test_the_bouc_wen_law() -> None:
    from pipeline.rigs.mre.model.bouc_wen import along, path_through

    rho, C, n, step = 3.0, 0.8, 1.4, 1e-4
    for w0, direction in ((0.5, 1.0), (0.5, -1.0), (-0.3, 1.0)):
        w = along(path_through(np.array([0.0, direction * step])), rho, C, n, w0)[:, 0]
        told = value(
            right_side("mre.shear", r"\dot w"),
            {r"\rho": rho, "C": C, "n": n, "w": (w[0] + w[1]) / 2, r"\dot x": direction},
        )
        assert told == pytest.approx((w[1] - w[0]) / step, rel=1e-6)


def test_the_loop_of_compression() -> None:
    from pipeline.rigs.mre.axial.loop import LoopModel, loading, secant, unloading

    model, d_max = LoopModel(4.55e5, 4.2e10, 24.0, 2e4), 6e-4
    numbers = {
        "k": model.k,
        "k_3": model.k3,
        r"\alpha": model.alpha,
        r"\rho": model.rho,
        "d_{max}": d_max,
        "F_{off}": 0.0,
    }
    numbers["w_m"] = value(right_side("mre.axial", "w_m"), numbers)
    for branch, drawn in (("w_{up}", loading(model, d_max)), ("w_{down}", unloading(model, d_max))):
        numbers["d"] = float(drawn[0][300])
        w = value(right_side("mre.axial", branch), numbers)
        assert value(right_side("mre.axial", "F"), numbers | {"w": w}) == pytest.approx(float(drawn[1][300]), rel=1e-12)
    told = value(right_side("mre.axial", "F(d_{max})/d_{max}"), numbers)
    assert told == pytest.approx(secant(model, d_max), rel=1e-12)


def test_the_saturating_law_of_held_pads() -> None:
    from pipeline.rigs.mre.hold import law

    numbers = {
        "F_0": 200.0,
        "a": 0.65,
        "r": 0.02,
        "t": 37.0,
        "t_0": 10.0,
        "p": 12.0,
        "z": 4.0 / 5.7,
        "I": 4.0,
        "s_0": 0.158,
        "B_s": 0.95,
        "b": 0.006,
    }
    s = value(right_side("mre.hold", "S(z; p)"), numbers)
    force = right_side("mre.hold", "F(I, t)").replace("S(I/I_s; p)", "z")
    found = law.force(np.array([4.0]), np.array([37.0]), 200.0, 0.65, 5.7, 12.0, 0.02)[0]
    assert value(force, numbers | {"z": s}) == pytest.approx(float(found), rel=1e-12)
    flux = law.saturating(np.array([4.0]), 0.95 / 0.158, 1 / 12.0)[0][0]
    assert value(right_side("mre.hold", "B(I)"), numbers) == pytest.approx(0.158 * float(flux) + 0.006, rel=1e-12)


def test_drag_of_the_locked_gearbox() -> None:
    from pipeline.rigs.gearbox.model.friction import drag_locked

    numbers = {"c_0": 0.1, "c_S": 0.406, r"\omega_S": 17.08, "b_0": 0.004, r"\omega": 12.566}
    told = value(right_side("gearbox.load_exchange", r"T_0(\omega)"), numbers)
    assert told == pytest.approx(drag_locked(12.566, 0.1, 0.406, 17.08, 0.004), rel=1e-12)


def test_the_stiffness_of_the_ring_by_order() -> None:
    from pipeline.rigs.tire.ring.ring import Ring, stiffness

    tire = Ring(R=0.3171, EI=6.0, p0b=46200.0, kw=6e5, kv=2e5, eta=0.08)
    latex = right_side("tire.bench", "K_n").replace(r"\mathrm{sgn}\, n", "o")
    for n in (2, 5, 17):
        numbers = {
            "EI": 6.0,
            "R": 0.3171,
            "p_0": 46200.0,
            "b": 1.0,
            "k_w": 6e5,
            "k_v": 2e5,
            r"\eta": 0.08,
            "n": n,
            "i": 1j,
            "o": 1,
        }
        assert value(latex, numbers) == pytest.approx(complex(stiffness(np.array([n]), tire)[0]), rel=1e-12)


def test_flow_estimators() -> None:
    from pipeline.rigs.rap.flow.estimators import pressure_flow, pulsation_flow

    f, A = np.array([2.3]), np.array([800.0])
    numbers = {
        "f": 2.3,
        "A_1": 800.0,
        "V_g": 6e-7,
        "y_0": 1e-10,
        "y_1": 3e-11,
        "f_0": 2.0,
        "V_0": 5e-7,
        "C_p": 2e-12,
        "P_{pre}": 3000.0,
        "P_a": -2000.0,
    }
    sides = [
        e.latex.split(" = ")[1].split(r",")[0] for e in OURS["rap.flow"].equations if e.latex.startswith(r"\hat Q")
    ]
    assert value(sides[0], numbers) == pytest.approx(float(pulsation_flow(f, A, 6e-7, 1e-10, 3e-11)[0]), rel=1e-12)
    assert value(sides[1], numbers) == pytest.approx(
        float(pressure_flow(f, np.array([5000.0]), 5e-7, 2e-12)[0]), rel=1e-12
    )


def test_device_over_bench_and_the_circuit() -> None:
    from pipeline.rigs.rap.circuit import hydraulics, sensor_pair

    numbers = {
        "g": 1.02,
        "i": 1j,
        r"\omega": 12.0,
        r"\tau_b": 0.005,
        r"\tau_d": 0.02,
        r"\Delta": 0.3,
        r"\rho": 1e-4,
        "t": 50.0,
        "t_{ref}": 20.0,
    }
    told = value(right_side("rap.pressures", r"H(\omega, t)").replace(r"\Delta +", "L +"), numbers | {"L": 0.3})
    found = complex(sensor_pair.device_over_bench(12.0, 1.02, 0.02, 0.005, 0.3, 1e-4, 50.0, 20.0))
    assert told == pytest.approx(found, rel=1e-12)
    c = hydraulics.Circuit()
    s = np.array([2j * math.pi * 2.2])
    numbers = {
        "K_{uf}": c.K_uf,
        "C_u": c.C_u,
        "s": complex(s[0]),
        "R_f": c.R_f,
        "C_2": c.C_2,
        "R_r": c.R_r,
        "L_r": c.L_r,
    }
    numbers["G_m"] = value(right_side("rap.pressures", "G_m"), numbers)
    told = value(right_side("rap.pressures", r"\frac{P_{ret}}{P_{pre}}"), numbers)
    assert told == pytest.approx(complex(hydraulics.filter_transfer(c, s)[0]), rel=1e-10)


def test_membrane_housing_and_speed_of_sound() -> None:
    from pipeline.rigs.rap.circuit import membrane, tank, thermal

    numbers = {
        "K_0": 2e-12,
        "a": 0.2,
        "t": 3600.0,
        "t_{ref}": membrane.T_REF,
        "T_\\infty": 303.0,
        "T_0": 298.0,
        r"\tau": 1200.0,
        "T": 300.0,
    }
    assert value(right_side("rap.therapy", "K_{uf}(t)"), numbers) == pytest.approx(
        float(membrane.coefficient(3600.0, 2e-12, 0.2))
    )
    told = value(right_side("rap.therapy", "T(t)"), numbers)
    assert told == pytest.approx(float(thermal.housing_temperature(3600.0, 298.0, 303.0, 1200.0)))
    assert value(right_side("rap.therapy", "c(T)"), numbers) == pytest.approx(float(tank.sound_speed(300.0)))


def test_the_film_over_the_flex_sensor() -> None:
    from pipeline.rigs.tire.ring.pvdf import film_over_flex
    from pipeline.rigs.tire.ring.sensor import averaging, voltage_slope

    R, Lp, Ls, n = 0.3171, 0.02, 0.05, 7
    latex = right_side("tire.bench", r"\frac{V_{p,n}}{R_{2,n}}").replace("G'", "g")
    latex = latex.replace("S(n L_p)", "P").replace("S(n L_s)", "S")
    numbers = {"g": 1.7, "i": 1j, "n": n, r"\Delta \theta": 0.02, r"\Omega": 30.0, r"\tau_p": 0.1, r"\tau_f": 1e-3}
    numbers |= {"P": float(averaging(n, Lp, R)), "S": float(averaging(n, Ls, R))}
    found = film_over_flex(
        np.array([n]),
        30.0,
        gain=1.7,
        time_constant=0.1,
        offset_angle=0.02,
        film_length=Lp,
        flex_length=Ls,
        flex_lag=1e-3,
        R=R,
    )
    assert value(latex, numbers) == pytest.approx(complex(found[0]), rel=1e-12)
    numbers = {"V_{IN}": 3.3, "R_1": 1e4, "R_2": 1.3e4, "a_1": 0.4, "a_2": -2e-5, "F_z": 3000.0}
    told = value(right_side("tire.bench", "dV/dF_z"), numbers)
    assert told == pytest.approx(float(voltage_slope(np.array(1.3e4), 3.3, 1e4)) * (0.4 - 2 * 2e-5 * 3000.0), rel=1e-12)


def test_the_speeds_of_ring_and_sun() -> None:
    from pipeline.rigs.gearbox.model.kinematics import ring_speed, sun_speed

    numbers = {r"\omega_{C1}": 12.0, r"\omega_{C2}": 5.0, "u_1": -5 / 3, "u_2": -25 / 3}
    ring = value(right_side("gearbox.load_exchange", r"\omega_R"), numbers)
    assert ring == pytest.approx(ring_speed(12.0, 5.0, -5 / 3, -25 / 3), rel=1e-12)
    sun = value(right_side("gearbox.load_exchange", r"\omega_S"), numbers | {r"\omega_R": ring})
    assert sun == pytest.approx(sun_speed(ring, 12.0, -5 / 3), rel=1e-12)


def test_the_maxwell_branch_from_sample_to_sample() -> None:
    from pipeline.rigs.mre.model.linear_solid import maxwell_along

    tau, dt = 0.02, 0.003
    x = np.array([0.0, 1e-4, 3e-4])
    u = maxwell_along(np.arange(3) * dt, x, tau)[:, 0]
    latex = right_side("mre.shear_rich", "u_{i+1}").replace(r"\Delta t", "h").replace("(x_{i+1} - x_i)", "s")
    told = value(latex, {r"\tau": tau, "h": dt, "u_i": float(u[1]), "s": 2e-4})
    assert told == pytest.approx(float(u[2]), rel=1e-12)


def test_the_force_on_the_film() -> None:
    from pipeline.rigs.tpjb.dynamic.impedance import bearing_force

    force, acceleration, tone, mass, stiffness = 900.0 - 40.0j, 3.0 + 1.0j, 21.0, 180.0, 2.4e5
    numbers = {"F": force, "m_s": mass, "k_s": stiffness, r"\omega": 2 * math.pi * tone, "a": acceleration}
    told = value(right_side("tpjb.dynamic", "F_b"), numbers)
    made = bearing_force(np.full((1, 2), force), np.full((1, 2), acceleration), np.array([tone]), mass, stiffness)
    assert made == pytest.approx(np.full((1, 2), told), rel=1e-12)
    free = {**numbers, "F": 0.0, "a": -1.0}  # the stator alone: force over acceleration of the baseline
    assert value(right_side("tpjb.baseline", r"\frac{F(\omega)}{a(\omega)}"), numbers) == pytest.approx(
        value(right_side("tpjb.dynamic", "F_b"), free), rel=1e-12
    )
