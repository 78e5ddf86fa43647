"""Displacement and force with clocks and rates of their own: the loop is that of one clock."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.recording import Channel, QualityFinding, Recording, Stream
from pipeline.rigs.mre.shear.samples import Series, samples_of

X, K, S, FREQUENCY = 1e-3, 1e5, 300.0, 5.0  # m, N/m, N s/m, Hz
OMEGA = 2 * np.pi * FREQUENCY


def run_of(rate: float, force_rate: float, late: float = 0.0003) -> Recording:
    """A spring and a dashpot in a sine, no noise; the clock of the force begins a little later."""
    t, t_f = np.arange(0, 4, 1 / rate), late + np.arange(0, 4, 1 / force_rate)
    force = K * X * np.sin(OMEGA * t_f) + S * X * OMEGA * np.cos(OMEGA * t_f)
    streams = {
        "a": Stream("a", t, {"displacement": Channel("displacement", X * np.sin(OMEGA * t), "m")}),
        "b": Stream("b", t_f, {"force": Channel("force", force, "N")}),
    }
    return Recording("r", streams)


def stiffness_and_damping(series: Series) -> tuple[float, float]:
    columns = np.column_stack([series.x, np.cos(OMEGA * series.time) * X * OMEGA])
    (k, s), *_ = np.linalg.lstsq(columns, series.F, rcond=None)
    return float(k), float(s)


@pytest.mark.parametrize("rates", [(1000.0, 100.0), (100.0, 1000.0), (100.0, 100.0), (1000.0, 99.0)])
def test_interpolation_takes_nothing_off_an_oscillation_of_20_samples_a_cycle(rates: tuple[float, float]) -> None:
    said: list[QualityFinding] = []
    series = samples_of(run_of(*rates), said.append)
    k, s = stiffness_and_damping(series.between(0.2, 3.8))
    assert k == pytest.approx(K, rel=3e-4)
    assert s == pytest.approx(S, rel=3e-3)
    assert np.median(np.diff(series.time)) == pytest.approx(1 / min(rates))
    assert "have clocks of their own" in said[0].message


def test_a_clipped_force_stays_flat_on_the_other_clock() -> None:
    run = run_of(400.0, 1000.0)
    t, force = run.signal("force")
    clipped = np.clip(force, -60.0, 60.0)
    streams = {**run.streams, "b": Stream("b", t, {"force": Channel("force", clipped, "N")})}
    series = samples_of(Recording("r", streams), lambda _finding: None)
    assert np.mean(series.F == 60.0) == pytest.approx(np.mean(clipped == 60.0), abs=0.01)
