"""The saturating law and the holds of a current, against closed forms."""

from __future__ import annotations

import doctest

import numpy as np
import pytest

from pipeline.rigs.mre import current_levels
from pipeline.rigs.mre.current_levels import finest_holds_of, holds_of, level_name
from pipeline.rigs.mre.hold import blank, law, repeats
from pipeline.rigs.mre.hold.law import hinge, local_slope, saturating, saturation, tanh_law
from pipeline.rigs.mre.step import lags

STAIRS = np.r_[np.arange(0, 8.1, 0.5), np.arange(7.5, -0.1, -0.5)]


def staircase(duration: float, rate: float, noise: float, levels: np.ndarray = STAIRS) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(round(levels.size * duration * rate)) / rate
    current = levels[np.minimum((time / duration).astype(int), levels.size - 1)]
    return time, current + noise * np.random.default_rng(5).standard_normal(time.size)


@pytest.mark.parametrize("module", [law, current_levels, repeats, blank, lags], ids=lambda m: m.__name__)
def test_examples_in_docstrings(module: object) -> None:
    assert doctest.testmod(module).failed == 0


def test_p_1_is_froehlich_kennelly_and_large_p_a_hinge() -> None:
    z = np.linspace(0, 4, 81)
    assert np.allclose(saturation(z, 1.0), z / (1 + z))
    assert np.allclose(saturation(z, 2.0), z / np.sqrt(1 + z**2))
    assert np.abs(saturation(z, 200.0) - np.minimum(z, 1)).max() < 4e-3
    assert np.isfinite(saturation(np.array([1e6, 1e-300]), 200.0)).all()


@pytest.mark.parametrize("u", [0.005, 1 / 12, 0.5, 1.0, 2.0])
def test_derivatives_of_the_law_are_those_of_differences(u: float) -> None:
    current, step = np.linspace(0, 8, 33), 1e-6
    _, by_log, by_u = saturating(current, 5.7, u)
    log_difference = saturating(current, 5.7 * np.exp(step), u)[0] - saturating(current, 5.7 * np.exp(-step), u)[0]
    assert np.allclose(by_log, log_difference / (2 * step), atol=1e-7)
    if u > 0.01:
        assert np.allclose(
            by_u,
            (saturating(current, 5.7, u + step)[0] - saturating(current, 5.7, u - step)[0]) / (2 * step),
            atol=1e-6,
        )
    z, p = np.array([0.3, 0.9, 1.1, 1.4]), 1 / u
    difference = (saturation(z + 1e-6, p) - saturation(z - 1e-6, p)) / 2e-6
    assert np.allclose(local_slope(z, p), difference, rtol=1e-4, atol=1e-8)


def test_all_laws_begin_with_slope_one() -> None:
    small = np.array([1e-4])
    for shape in (saturating, tanh_law, hinge, law.froehlich_kennelly, law.straight):
        assert shape(small, 5.0, 0.25)[0] == pytest.approx(small, rel=1e-4)


@pytest.mark.parametrize(
    ("duration", "rate", "noise"),
    [
        (10.0, 10.0, 0.01),
        (2.0, 10.0, 0.01),
        (4.0, 1000.0, 0.01),
        (10.0, 1.0, 0.01),
        (10.0, 10.0, 0.1),
        (10.0, 10.0, 0.0),
    ],
)
def test_every_hold_of_a_staircase_is_found(duration: float, rate: float, noise: float) -> None:
    found = finest_holds_of(*staircase(duration, rate, noise))
    assert len(found.holds) == STAIRS.size
    assert np.abs([hold.level for hold in found.holds] - STAIRS).max() < max(6 * noise / np.sqrt(duration * rate), 1e-6)
    assert found.is_set_point is (noise == 0)


def test_steps_of_a_twentieth_of_an_ampere_are_told_apart() -> None:
    levels = np.arange(0, 1.0, 0.05)
    found = finest_holds_of(*staircase(8.0, 10.0, 0.01, levels))
    assert len(found.holds) == levels.size


def test_ramps_are_no_holds_and_spikes_do_not_part_one() -> None:
    time = np.arange(0, 60, 0.1)
    current = np.interp(time, [0, 10, 15, 25, 30, 40, 50, 60], [0, 0, 1, 1, 3, 3, 0, 0])
    current += 0.01 * np.random.default_rng(1).standard_normal(time.size)
    current[[50, 200, 350]] += 4.0
    found = holds_of(time, current)
    assert [round(hold.level, 1) for hold in found.holds] == [0.0, 1.0, 3.0, 0.0]
    assert all(hold.duration > 9 for hold in found.holds)


def test_the_name_of_a_level_is_round_only_where_the_measurement_allows() -> None:
    assert [level_name(v, 0.001) for v in (6.0011, 1.9989, 0.749, 3.333, 0.0004)] == [6.0, 2.0, 0.75, 3.33, 0.0]
