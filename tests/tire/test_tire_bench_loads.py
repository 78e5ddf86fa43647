"""The load of a bench run is the one that the waveform sees: the load cell's mean about the passages."""

import numpy as np
import pytest

from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.tire.bench.reference import LOAD, SPEED, reference_of

TURN = 0.7


def _recording(load, noise=0.0):
    time = np.arange(0.0, 14.0, 0.01)
    rng = np.random.default_rng(4)
    channels = {
        LOAD: Channel(LOAD, load(time) + noise * rng.standard_normal(time.size), "N"),
        SPEED: Channel(SPEED, 2.8 + 0.02 * rng.standard_normal(time.size), "m/s"),
    }
    return Recording("run", {"bench": Stream("bench", time, channels)}, {})


def _turns(count=18):
    begin = 0.1 + TURN * np.arange(count)
    return begin, begin + TURN


def test_a_wave_in_step_with_the_wheel_counts_as_the_passages_see_it():
    # Highest half a turn after each begin, where the sensor is in the patch.
    found = reference_of(
        _recording(lambda t: 2000.0 - 20.0 * np.cos(2 * np.pi * (t - 0.1) / TURN), noise=0.5), *_turns(), (0.0, 14.0)
    )
    within = 0.125  # of a turn, before and behind: the mean of the wave there
    assert found.value(LOAD) == pytest.approx(2000.0 + 20.0 * np.sinc(2.0 * within), abs=0.5)


def test_the_error_of_the_mean_is_the_noise_of_the_samples_seen():
    found = reference_of(_recording(lambda t: np.full(t.size, 2000.0), noise=5.0), *_turns(), (0.0, 14.0))
    samples = found.means[LOAD].samples
    assert samples == pytest.approx(18 * 0.25 * TURN / 0.01, rel=0.05)
    assert found.std_error(LOAD) == pytest.approx(5.0 / np.sqrt(samples), rel=0.1)
    assert found.means[SPEED].samples > 3 * samples
