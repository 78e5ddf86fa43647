import numpy as np
import pytest
from gearbox_known import wander

from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.stages.breaks import find_break, ramp
from pipeline.rigs.gearbox.stages.lagged_breaks import delayed_ramp, delayed_step, find_lagged_break
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import gearbox_truth

TORQUE_EVENTS = ("startup", "brake_onset", "unlock", "relock", "rundown")


def bend(time, t0, lag):
    return delayed_ramp(time - t0, lag)[:, None]


@pytest.mark.parametrize("lag", [0.005, 0.015, 0.03])
def test_a_ramp_that_comes_through_a_lag_is_found_where_it_began(lag):
    t = np.arange(0.0, 2.0, 0.005)
    y = 1.0 + 16.0 * delayed_ramp(t - 1.903, lag)
    found, (without, left) = find_lagged_break(t, y, [np.ones_like(t)], bend, (1.8, 1.99))
    assert found.time == pytest.approx(1.903, abs=5e-4)
    assert found.lag == pytest.approx(lag, rel=0.1)
    assert left < 1e-4 * without
    straight, _ = find_break(t, y, [np.ones_like(t)], [ramp], (1.8, 1.99))
    assert straight.time - 1.903 > 0.5 * lag


def test_a_response_obeys_the_differential_equation_of_a_first_order_lag():
    t, lag = np.linspace(0.0, 0.2, 4001), 0.02
    y = delayed_ramp(t, lag)
    assert np.allclose((lag * np.gradient(y, t) + y)[1:-1], t[1:-1], atol=1e-5)
    assert np.allclose(np.gradient(y, t)[1:-1], delayed_step(t, lag)[1:-1], atol=1e-3)


def test_the_error_of_a_break_covers_drifting_noise():
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 3.0, 0.005)
    z = []
    for _ in range(120):
        noise = wander(rng, t.size, 0.005, 0.012) + 0.006 * rng.standard_normal(t.size)
        found, _ = find_lagged_break(
            t, 16.0 * delayed_ramp(t - 2.92, 0.015) + noise, [np.ones_like(t)], bend, (2.85, 2.98)
        )
        z.append((found.time - 2.92) / found.sd)
    assert 0.88 < np.mean(np.abs(z) < 1.96) < 0.995
    assert abs(np.mean(z)) < 0.35


# Twice the droop is twice the lag; a brake three times as slow.
@pytest.mark.parametrize(
    "rig", [{}, {"k_d": 0.8}, pytest.param({"k_d": 0.1}, marks=pytest.mark.thorough), {"brake_rise": 0.45}]
)
def test_events_of_rigs_with_other_lags_lie_within_their_errors(rig):
    options = {**rig, "runs": ["g3", "g7"], "vibration": False}
    for seed in (0, 1):
        truths = {run.name: run.events for run, _ in known_runs(gearbox_truth(options), seed)}
        for recording in synthesize(options, seed):
            found = segment(record_of(recording)).events
            for name in TORQUE_EVENTS:
                error = found[name].time - truths[recording.run][name]
                assert abs(error) < 4.0 * found[name].sd, (name, error, found[name].sd)
                assert found[name].sd < 0.03
