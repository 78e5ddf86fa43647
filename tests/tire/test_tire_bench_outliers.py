"""The run at fault is found among runs of known laws, and never a good one in its place (tire.md, 8)."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.tire.bench.outliers import Marks, odd_runs

RUNS = (
    ("a", 1000, 8.8),
    ("b", 1500, 8.8),
    ("c", 2000, 8.8),
    ("d", 2500, 8.8),
    ("e", 3000, 8.8),
    ("slow", 2000, 4.4),
    ("fast", 2000, 17.5),
)


def marks(noise=0.0, seed=0):
    """Return runs of a tire: powers of load that bend, a film that grows with speed, a lag that lowers the peak."""
    rng = np.random.default_rng(seed)
    found = []
    for run, load, rotation in RUNS:
        x = np.log(load / 2000.0)
        scatter = np.exp(noise * rng.standard_normal(3))
        peak = 7000.0 * np.exp(0.9 * x - 0.06 * x**2) * (1.0 - 0.006 * (rotation / 8.8) ** 2)
        film = 0.61 * np.exp(0.72 * x - 0.13 * x**2) * rotation / 8.8 / np.hypot(1.0, 0.4 * rotation / 8.8)
        bent = 0.204 * np.exp(0.035 * x)
        found.append(Marks(run, float(load), rotation, *(float(v) for v in np.array([peak, film, bent]) * scatter)))
    return found


def spoilt(run, **factors):
    return [
        replace(m, **{name: getattr(m, name) * factor for name, factor in factors.items()}) if m.run == run else m for m in marks()
    ]  # fmt: skip


def told(found):
    return [(odd.run, odd.cause) for odd in odd_runs(found)]


@pytest.mark.parametrize("seed", range(10))
def test_sound_runs_are_not_accused(seed):
    assert told(marks(2e-3, seed)) == []


@pytest.mark.parametrize("run", ["a", "b", "c", "d", "e"])
@pytest.mark.parametrize("gain", [0.55, 0.9])
def test_a_debonded_run_is_found_wherever_it_stands_among_the_loads(run, gain):
    assert told(spoilt(run, peak=gain)) == [(run, "sensor")]


@pytest.mark.parametrize("run", ["a", "c", "e"])
def test_few_runs_tell_a_debonded_one_as_well(run):
    kept = [m for m in spoilt(run, peak=0.55) if m.run in ("a", "c", "e")]
    assert told(kept) == [(run, "sensor")]


def test_two_debonded_runs_are_found_together():
    two = [replace(m, peak=0.55 * m.peak) if m.run in ("b", "d") else m for m in marks()]
    assert sorted(told(two)) == [("b", "sensor"), ("d", "sensor")]


def test_a_debonded_film_leaves_the_flex_sensor_in():
    assert told(spoilt("d", film=0.6)) == [("d", "film")]


@pytest.mark.parametrize("run", ["a", "c", "e"])
def test_a_wrong_load_is_no_fault_of_a_sensor(run):
    assert told(spoilt(run, load=1.1)) == [(run, "load")]


def test_less_pressure_is_told_by_the_deformation_length():
    # tire.md, 3.5: 15 % less pressure raises peak (and film) by 9 to 10 % and, by section 8, Ld by about 2 %.
    low = spoilt("c", peak=1.10, film=1.06, bent=1.024)
    (odd,) = odd_runs(low)
    assert (odd.run, odd.cause) == ("c", "pressure")
    assert "about -15 %" in odd.text


def test_a_run_with_a_speed_of_its_own_may_lag():
    assert told(spoilt("fast", peak=0.93)) == []
    assert told(spoilt("fast", peak=0.55)) == [("fast", "unknown")]


def test_without_loads_the_ratio_of_the_sensors_tells():
    assert told([replace(m, load=float("nan")) for m in spoilt("d", peak=0.55)]) == [("d", "sensor")]


def test_without_a_film_sensor_and_load_are_not_told_apart():
    assert told([replace(m, film=float("nan")) for m in spoilt("d", peak=0.55)]) == [("d", "unknown")]
