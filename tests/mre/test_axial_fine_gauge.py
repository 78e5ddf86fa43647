"""A fine gauge and a press whose rate varies: the readings are taken as they are, without bias of rho, in seconds."""

from __future__ import annotations

import numpy as np
import pytest
from axial_logs import found, press

from pipeline.findings import Findings
from pipeline.rigs.mre.axial.motion import motion_of, read_finely

TRUTH = {"stiffness": 4.55e5, "alpha": 24.0, "rho": 2e4, "loss_ratio": 0.2613, "stiffness_secant": 510.12e3}


def varying(seed: int, **truth: object) -> Findings:
    return found(*press(seed, **{"currents": [0.0], "cycles": 3, "rate_ripple": 0.45, "gauge_step": 1e-6, **truth}))


def test_numbers_of_several_strokes_at_a_varying_rate_bear_no_bias() -> None:
    seeds = range(8)
    z: dict[str, list[float]] = {name: [] for name in TRUTH}
    for seed in seeds:
        campaign = varying(seed)
        assert campaign.verdict == "ok"
        for name, truth in TRUTH.items():
            p = campaign.one(name, coil_current=0.0)
            assert p.value is not None
            assert p.std_error is not None
            z[name].append((p.value - truth) / p.std_error)
    for name, values in z.items():
        # The mean of eight has a standard error of 0.35.
        assert abs(np.mean(values)) < 1.1, name
        assert np.sqrt(np.mean(np.square(values))) < 1.7, name


def test_the_turn_between_two_samples_is_found() -> None:
    (log,) = press(3, currents=[0.0], gauge_step=1e-7)
    time, x = log.signal("displacement_axial")
    motion = motion_of(time, x)
    read = read_finely(motion, time, x)
    assert read.turn_spread is not None
    assert 0.5 * (read.lowest[1] + read.highest[1]) == pytest.approx(6e-4, abs=4e-7)
    assert np.ptp(x) < 6e-4 + 1e-7


def test_noisy_gauge_keeps_its_smooth_motion() -> None:
    campaign = varying(1, gauge_step=0.0, gauge_noise=4e-6, rate_ripple=0.0, cycles=1)
    assert campaign.arrays["runs"]["motion"].iloc[0] == "constant rate"
    assert varying(1).arrays["runs"]["motion"].iloc[0] == "as read"
