"""Intervals of complete campaigns hold the truth: the short form of `benchmarks.coverage_rap`."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.coverage_rap import study


@pytest.mark.parametrize(("experiment", "seeds"), [("pressures", 5), ("flow", 3), ("therapy", 2), ("cytotoxicity", 15)])
def test_intervals_hold_the_truth(experiment: str, seeds: int) -> None:
    found = study(experiment, "short", range(300, 300 + seeds))
    closed = {name: pairs for name, pairs in found.items() if not name.endswith("*")}
    held = [e.ci95[0] <= true <= e.ci95[1] for pairs in closed.values() for e, true in pairs if e.ci95 is not None]
    assert len(held) > 8 * seeds
    assert np.mean(held) >= 0.9
    for name, pairs in closed.items():
        z = [(e.value - true) / e.std_error for e, true in pairs if e.value is not None and e.std_error]
        assert np.all(np.abs(z) < 5.0), name


def test_every_parameter_of_the_pressures_is_studied() -> None:
    found = {name.split()[0] for name in study("pressures", "short", range(300, 301))}
    assert found >= {
        "lag", "clock_rate", "sensor_pole", "gain", "offset", "bias", "limit_lower", "limit_upper", "coherence", "r_access",
        "r_filter", "r_return", "c_return", "l_return", "c_uf", "k_uf",
    }  # fmt: skip
