from __future__ import annotations

import numpy as np
import pytest

from pipeline.rigs.mre.model.linear_solid import maxwell_along, maxwell_harmonics


def test_step_of_constant_rate_is_the_closed_form() -> None:
    t = np.array([0.0, 0.003, 0.01, 0.05, 0.2])  # any spacing
    u = maxwell_along(t, 2.0 * t, 0.02)[:, 0]
    assert u == pytest.approx(2.0 * 0.02 * (1 - np.exp(-t / 0.02)), rel=1e-12)


def test_time_and_frequency_domain_agree() -> None:
    t = np.arange(0, 1, 1e-5)
    f = 15.0
    u = maxwell_along(t, np.cos(2 * np.pi * f * t), 0.02)[:, 0]
    U, _ = maxwell_harmonics(np.array([1.0 + 0j]), np.array([2 * np.pi * f]), 0.02)
    late = t > 0.5
    assert u[late] == pytest.approx((U[0] * np.exp(2j * np.pi * f * t[late])).real, abs=1e-6)


def test_limits_are_the_spring_and_nothing() -> None:
    slow, _ = maxwell_harmonics(np.array([1.0 + 0j]), np.array([1e-6]), 0.02)
    fast, _ = maxwell_harmonics(np.array([1.0 + 0j]), np.array([1e9]), 0.02)
    assert abs(slow[0]) < 1e-7
    assert fast[0] == pytest.approx(1.0)


@pytest.mark.parametrize("tau", [5e-4, 0.02, 0.5])
def test_sensitivities_agree_with_differences(tau: float) -> None:
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 400))
    x = np.cumsum(rng.normal(size=400))
    up, down = tau * np.exp(1e-5), tau * np.exp(-1e-5)
    slope = (maxwell_along(t, x, up)[:, 0] - maxwell_along(t, x, down)[:, 0]) / 2e-5
    assert maxwell_along(t, x, tau)[:, 1] == pytest.approx(slope, abs=1e-7 * np.abs(slope).max() + 1e-9)
    X, angular = np.array([1.0 + 0.3j, 0.2j]), np.array([30.0, 60.0])
    slope_h = (maxwell_harmonics(X, angular, up)[0] - maxwell_harmonics(X, angular, down)[0]) / 2e-5
    assert maxwell_harmonics(X, angular, tau)[1] == pytest.approx(slope_h, rel=1e-7)
