from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.rigs.mre.model.bouc_wen import (
    along,
    closed_paths,
    is_admissible,
    loss_limit_of_large_loops,
    loss_of_small_loops,
    path_through,
    steady_states,
    turning_value,
)

RHO, C, N = 4000.0, 0.8, 1.4
# rho X -> w at the turning points, memory of one cycle (mre.md 3.6 and 2, design rule 5).
TURNING = {0.4: 0.38598037, 0.8: 0.69454701, 1.6: 0.95578263, 2.0: 0.98510373, 2.4: 0.99508694}
MEMORY = {0.2: 0.71, 0.4: 0.40, 0.8: 0.086, 1.6: 0.0015}


def cycle(amplitude: float, points: int = 256, phase: float = 0.37) -> np.ndarray:
    a = 2 * np.pi * np.arange(points) / points + phase
    return amplitude * (np.sin(a) + 0.01 * np.sin(2 * a + 0.7) + 0.015 * np.sin(3 * a + 0.3))


def sine(amplitude: float, points: int = 256, phase: float = 0.37) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * np.arange(points) / points + phase)


def exact_step(w: float, dx: float, rho: float, c: float, n: int) -> float:
    """w after a monotonic dx for n = 1 and n = 2, crossing w = 0 where it has to."""
    s = math.copysign(1.0, dx)
    b, left = 2 * c - 1, abs(dx)
    if s * w < 0:  # back to zero first
        a = abs(w)
        needed = math.log1p(b * a) / (b * rho) if n == 1 else math.atan(math.sqrt(b) * a) / (math.sqrt(b) * rho)
        if needed >= left:
            if n == 1:
                return -s * ((1 + b * a) * math.exp(-b * rho * left) - 1) / b
            return -s * math.tan(math.atan(math.sqrt(b) * a) - math.sqrt(b) * rho * left) / math.sqrt(b)
        left, w = left - needed, 0.0
    if n == 1:
        return s * (1 - (1 - abs(w)) * math.exp(-rho * left))
    return s * math.tanh(math.atanh(min(abs(w), 1 - 1e-16)) + rho * left)


@pytest.mark.parametrize(("rho_x", "expected"), TURNING.items())
def test_turning_value_is_that_of_the_hypergeometric_equation(rho_x: float, expected: float) -> None:
    assert turning_value(rho_x, C, N) == pytest.approx(expected, abs=2e-8)


@pytest.mark.parametrize(("rho_x", "expected"), TURNING.items())
def test_steady_loop_turns_where_it_should(rho_x: float, expected: float) -> None:
    x = sine(rho_x / RHO, phase=np.pi / 2)  # turning points on the grid
    w = steady_states(closed_paths(x[None]), RHO, C, N)[0, :, 0]
    assert w.max() == pytest.approx(expected, abs=3e-6)
    assert w.min() == pytest.approx(-expected, abs=3e-6)


@pytest.mark.parametrize(("rho_x", "expected"), MEMORY.items())
def test_memory_of_one_cycle(rho_x: float, expected: float) -> None:
    memory = steady_states(closed_paths(sine(rho_x / RHO)[None]), RHO, C, N)[0, 0, 4]
    assert memory == pytest.approx(expected, rel=0.03)


# Noise asks for 2.5e-4; n = 1 has a kink at w = 0 and is the worst case.
@pytest.mark.parametrize(("n", "tolerance"), [(1, 2e-5), (2, 1e-7)])
@pytest.mark.parametrize("c", [0.8, 1.7])
def test_runge_kutta_agrees_with_the_exact_steps(n: int, tolerance: float, c: float) -> None:
    a = np.linspace(0, 6 * np.pi, 3 * 1000)
    x = (4e-4 + 2e-4 * np.sin(0.3 * a)) * np.sin(a)
    path = path_through(x)
    expected, w = np.zeros(x.size), 0.3
    expected[0] = w
    for i in range(1, path.x.size):
        w = exact_step(w, path.x[i] - path.x[i - 1], RHO, c, n)
        if path.on_grid[i] >= 0:
            expected[path.on_grid[i]] = w
    assert along(path, RHO, c, float(n), 0.3)[:, 0] == pytest.approx(expected, abs=tolerance)


def test_signs_are_those_of_the_differential_equation() -> None:
    from scipy.integrate import solve_ivp

    for c in (0.6, 1.0, 2.5):
        t = np.linspace(0, 2, 2001)
        x, v = 4e-4 * np.sin(2 * np.pi * t), 4e-4 * 2 * np.pi

        def slope(time: float, w: np.ndarray, c: float = c, v: float = v) -> np.ndarray:
            d = v * math.cos(2 * np.pi * time)
            return RHO * (d - c * abs(d) * np.abs(w) ** (N - 1) * w + (c - 1) * d * np.abs(w) ** N)

        expected = solve_ivp(slope, (0, 2), [-0.2], t_eval=t, rtol=1e-10, atol=1e-12, max_step=2e-3).y[0]
        assert along(path_through(x), RHO, c, N, -0.2)[:, 0] == pytest.approx(expected, abs=2e-6)


def test_turning_points_between_the_samples_cost_less_than_the_noise() -> None:
    # 40 N against a harmonic's standard deviation of 0.01 N: 2.5e-4 of w; a tenth of that at most.
    fine = steady_states(closed_paths(cycle(6e-4, 256 * 32)[None]), RHO, C, N)[0, ::32, 0]
    coarse = steady_states(closed_paths(cycle(6e-4)[None]), RHO, C, N)[0, :, 0]
    assert np.abs(coarse - fine).max() < 2e-5


@pytest.mark.parametrize(("index", "step"), [(1, 0.04), (2, 1e-5), (3, 1e-5)])
def test_periodic_sensitivities_agree_with_differences(index: int, step: float) -> None:
    paths = closed_paths(np.array([cycle(2e-4), cycle(6e-4)]))
    point = [RHO, C, N]
    up, down = point.copy(), point.copy()
    up[index - 1] += step
    down[index - 1] -= step
    slope = (steady_states(paths, *up)[..., 0] - steady_states(paths, *down)[..., 0]) / (2 * step)
    given = steady_states(paths, *point)[..., index]
    assert np.abs(given - slope).max() < 1e-6 * np.abs(slope).max()


def test_start_value_sensitivity_agrees_with_differences() -> None:
    path = path_through(cycle(3e-4))
    slope = (along(path, RHO, C, N, 0.1 + 1e-6)[:, 0] - along(path, RHO, C, N, 0.1 - 1e-6)[:, 0]) / 2e-6
    assert np.abs(along(path, RHO, C, N, 0.1)[:, 4] - slope).max() < 1e-6


def test_steady_state_is_where_many_cycles_end() -> None:
    x = cycle(1e-4)
    repeated = along(path_through(np.tile(x, 80)), RHO, C, N)[-x.size :, 0]
    assert steady_states(closed_paths(x[None]), RHO, C, N)[0, :, 0] == pytest.approx(repeated, abs=1e-6)


def loss(alpha: float, amplitude: float, rho: float, c: float, n: float) -> float:
    """Work per cycle of alpha w against x, by the trapezoid over a fine closed path."""
    x = sine(amplitude, 8192, np.pi / 2)
    w = steady_states(closed_paths(x[None]), rho, c, n)[0, :, 0]
    return float(alpha * np.sum(0.5 * (np.r_[w[1:], w[0]] + w) * (np.r_[x[1:], x[0]] - x)))


def test_loss_of_small_loops() -> None:
    amplitude = 0.01 / RHO
    assert loss(40.0, amplitude, RHO, C, N) == pytest.approx(loss_of_small_loops(40.0, RHO, C, N, amplitude), rel=0.01)


def test_loss_of_large_loops() -> None:
    amplitude = 200 / RHO
    assert loss(40.0, amplitude, RHO, C, N) == pytest.approx(loss_limit_of_large_loops(40.0, amplitude), rel=0.01)


@pytest.mark.parametrize("c", [0.5, 0.8, 1.0, 3.0])
@pytest.mark.parametrize("n", [1.0, 1.4, 3.0])
def test_admissible_loops_stay_bounded_and_dissipate(c: float, n: float) -> None:
    assert is_admissible(RHO, c, n)
    rng = np.random.default_rng(3)
    w = along(path_through(np.cumsum(rng.normal(0, 1e-4, 3000))), RHO, c, n, sensitivities=False)[:, 0]
    assert np.abs(w).max() <= 1 + 1e-9
    assert loss(40.0, 4e-4, RHO, c, n) > 0


def test_parameters_that_may_create_energy_are_not_admissible() -> None:
    assert not is_admissible(RHO, 0.4, 1.4)
    assert not is_admissible(RHO, 0.8, 0.9)
    assert not is_admissible(-1.0, 0.8, 1.4)


def test_stiff_parameters_neither_overflow_nor_oscillate() -> None:
    w = steady_states(closed_paths(cycle(6e-4)[None]), 1.6e5, 4.0, 6.0)
    assert np.all(np.isfinite(w))
    assert np.abs(w[..., 0]).max() <= 1 + 1e-6
