"""Mains hum in the torques is taken off and named; what turns with the shafts is not."""

from functools import cache

import numpy as np
import pytest

from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.gearbox.campaign_numbers import campaign_of
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_faults import run_faults
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.torques.hum import hum_at, wave, without_hum
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers


@cache
def numbers(hum, frequency=50.0, drift=0.0):
    """Numbers of a run whose torques hum; the grid's frequency wanders by `drift` Hz over the log."""
    run = synthesize({"runs": ["g3"], "vibration": False}, 3)[0]
    log = run.streams["torque"]
    phase = 2 * np.pi * (frequency * log.time + 0.5 * drift / 30.0 * log.time**2)
    channels = {n: Channel(n, c.values + hum * np.sin(phase + 0.4), c.unit) for n, c in log.channels.items()}
    streams = {**run.streams, "torque": Stream("torque", log.time, channels)}
    return numbers_of(record_of(Recording(run.run, streams, run.conditions)))


@pytest.mark.parametrize(("frequency", "drift"), [(50.0, 0.0), (60.02, 0.0), (49.97, 0.06)])
def test_strong_hum_costs_no_slope_and_no_lock_torque(frequency, drift):
    clean, humming = numbers(0.0), numbers(0.3, frequency, drift)
    slope, true = humming.transfers["brake"], clean.transfers["brake"]
    assert slope.slope == pytest.approx(true.slope, abs=0.02)
    for key, peak in clean.peaks.items():
        assert humming.peaks[key].value == pytest.approx(peak.value, abs=0.015)
    assert campaign_of([humming]).lock["g3"].value == pytest.approx(campaign_of([clean]).lock["g3"].value, abs=0.05)
    told = [q for q in run_faults(humming, VibrationNumbers()) if q.level == "warning"]
    assert {q.channel for q in told} == {"torque_in", "torque_out"}
    assert all("0.3 N m at" in q.message for q in told)


def test_a_log_without_hum_stays_as_it_is():
    record = record_of(synthesize({"runs": ["g8"], "vibration": False}, 3)[0])
    same, found = without_hum(record)
    assert not found
    assert same is record


def test_a_line_of_the_turning_shaft_at_the_frequency_of_the_mains_is_no_hum():
    t = np.arange(0, 30, 1 / 2000)
    turns = (t > 4) & (t < 29)
    noise = 0.02 * np.random.default_rng(0).standard_normal(t.size)
    assert hum_at(t, 0.3 * turns * np.sin(2 * np.pi * 50 * t) + noise, 50.0) is None


def test_the_break_of_the_lock_rings_no_more_than_a_window_of_a_second_lets_it():
    """Of a step A the window's share at w is A/(w T/4), T one second: 1.3 % at 50 Hz."""
    t = np.arange(0, 20, 1 / 2000)
    torque = np.where(t < 10, 1.0, 0.2)
    assert np.abs(wave(t, torque, 50.0)).max() < 1.05 * 0.8 * 4 / (2 * np.pi * 50)
