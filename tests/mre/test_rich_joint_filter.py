"""The joint filter: its compiled step is filterpy's, its state moves as the model does, R is annealed."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.rigs.mre.model.bouc_wen import along, path_through
from pipeline.rigs.mre.model.linear_solid import maxwell_along
from pipeline.rigs.mre.rich.joint_filter import JointFilter, Start
from pipeline.rigs.mre.rich.joint_state import SHEET, carry, force, from_logs, to_logs

PARAMETERS = {"k1": 6e4, "tau": 0.02, "k2": 2.6e5, "alpha_bw": 40.0, "rho": 4000.0, "c_bw": 0.8, "n_bw": 1.4}
DT = 1e-3


def motion(count: int) -> tuple[np.ndarray, np.ndarray]:
    t = DT * np.arange(count)
    x = 4e-4 * np.sin(2 * np.pi * (5 + t) * t) * (1 + 0.5 * np.sin(2 * np.pi * 0.4 * t))
    return t, x


def start(viscous: float | None) -> Start:
    off = {name: value * 1.3 for name, value in PARAMETERS.items()}
    return Start(to_logs(off), 6e-4, 200.0, 0.0, 20.0, 5e-5, viscous)


def test_logarithms_of_the_parameters_go_back_and_forth() -> None:
    found = from_logs(to_logs(PARAMETERS))
    assert {name: float(value) for name, value in found.items()} == pytest.approx(PARAMETERS)


def test_memory_is_carried_as_the_model_integrates_it() -> None:
    t, x = motion(3000)
    state, out = np.zeros((1, SHEET)), np.zeros((1, SHEET))
    state[0, 2:] = to_logs(PARAMETERS)
    w, u = np.zeros(t.size), np.zeros(t.size)
    for i in range(1, t.size):
        carry(state, x[i - 1 : i + 1], DT, out)
        state[:] = out
        w[i], u[i] = out[0, :2]
    exact = along(path_through(x), 4000.0, 0.8, 1.4, sensitivities=False)[:, 0]
    assert np.abs(w - exact).max() < 5e-3  # turning points lie between the samples
    assert np.std(w - exact) < 1e-3
    assert u == pytest.approx(maxwell_along(t, x, 0.02)[:, 0], abs=1e-12)


def test_force_is_the_models_and_late_by_the_lag_to_first_order() -> None:
    state = np.r_[0.3, 1e-4, to_logs(PARAMETERS), 5.0, 0.0, 100.0]
    x, v = 2e-4, 0.03
    still = 6e4 * 1e-4 + 2.6e5 * x + 40 * 0.3
    assert force(state, x, v) == pytest.approx(still + 5.0 + 100 * v)
    assert force(state[:SHEET], x, v) == pytest.approx(still)
    state[10] = lag = 1e-5
    slope = 6e4 * (v - 1e-4 / 0.02) + 2.6e5 * v + 40 * 4000 * (1 - 0.3**1.4) * v
    assert force(state, x, v) == pytest.approx(still - lag * slope + 5.0 + 100 * v)


@pytest.mark.parametrize("viscous", [None, 500.0])
def test_compiled_steps_are_those_of_filterpy(viscous: float | None) -> None:
    t, x = motion(800)
    rng = np.random.default_rng(3)
    measured = 3e5 * x + 30 * np.sign(np.gradient(x)) + rng.standard_normal(t.size)
    measured[200:210] = np.nan  # not measured: carried on
    measured[500] += 1e5  # a wild sample: passed over
    path = np.column_stack([x[:-1], x[1:]])
    tracks = []
    for compiled in (True, False):
        made = JointFilter(start(viscous), 1.0, compiled=compiled)
        tracks.append(made.advance(path, DT, np.gradient(x, t)[1:], measured[1:]))
        assert made.time == pytest.approx(DT * (t.size - 1))
    fast, slow = tracks
    assert np.isnan(fast.innovation[499])
    assert fast.innovation == pytest.approx(slow.innovation, rel=1e-7, abs=1e-9, nan_ok=True)
    scale = np.abs(slow.states).max(axis=0)
    assert np.abs((fast.states - slow.states) / scale).max() < 1e-8
    assert fast.variances == pytest.approx(slow.variances, rel=1e-6)


def test_noise_is_annealed_from_the_misfit_of_a_wrong_start_to_four_times_the_variance() -> None:
    made = JointFilter(start(None), 0.5)
    first, last = made.noise(np.array([0.0, 300.0]))
    assert first == pytest.approx(4 * 0.25 + (0.15 * 200) ** 2)
    assert last == pytest.approx(4 * 0.25)
    quiet = JointFilter(start(None), 0.5, annealed=False)
    assert quiet.noise(np.zeros(1)) == pytest.approx(1.0)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_covariance_that_breaks_down_ends_the_track(compiled: bool) -> None:
    t, x = motion(50)
    made = JointFilter(start(None), 1.0, compiled=compiled)
    made.P[4, 4] = -1.0
    track = made.advance(np.column_stack([x[:-1], x[1:]]), DT, np.gradient(x, t)[1:], 3e5 * x[1:])
    assert track.innovation.size == 0


def test_forgetting_leaves_the_parameters_and_takes_the_memory_for_unknown() -> None:
    made = JointFilter(start(None), 1.0)
    made.x[0] = 0.9
    before = made.P[2:, 2:].copy()
    made.forget()
    assert made.x[0] == 0.0
    assert made.P[0, 0] == 0.25
    assert (made.P[2:, 2:] == before).all()
