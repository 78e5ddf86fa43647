"""What lies in a hole of the log is withheld and named: no straight line put in is read as a peak, and no constant as a level."""

from functools import cache

import numpy as np
import pytest

from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.gearbox.campaign_numbers import campaign_of
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.outcome.parameters import parameters_of
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_faults import run_faults
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.torques.lost_samples import standing_still
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers

# A box without load-proportional drag: its slope is 1.
BOX = {"runs": ["g3"], "vibration": False, "a": 1.0, "brake_capacity": 2.4, "c0": 0.2, "c_s": 0.1}


@cache
def sound():
    return synthesize(BOX, 3)[0]


def with_torques(change, kept=None):
    """Return the run with `change(name, time, values)` on its torques, rows outside `kept(time)` left out."""
    log = sound().streams["torque"]
    rows = np.ones(log.time.size, dtype=bool) if kept is None else kept(log.time)
    channels = {
        name: Channel(name, change(name, log.time, np.array(channel.values))[rows], channel.unit)
        for name, channel in log.channels.items()
    }
    return Recording(
        "g3", {**sound().streams, "torque": Stream("torque", log.time[rows], channels)}, sound().conditions
    )


def found(recording):
    """Return the parameters of the run by (name, stage or event or phase), and the numbers."""
    numbers = numbers_of(record_of(recording))
    listed = parameters_of(campaign_of([numbers]), [], LoadExchangeSettings())
    by = {(p.name, str(p.at.get("stage") or p.at.get("event") or p.at.get("phase") or "")): p for p in listed}
    return by, numbers


def lost(start, end, *names):
    def change(name, time, values):
        return np.where((time > start) & (time < end) & (not names or name in names), np.nan, values)

    return change


PEAKS = (("torque_in_peak", "brake"), ("torque_out_peak", "brake"), ("lock_torque", ""), ("torque_relief_in", ""))


def test_numbers_lost_at_the_brakes_peak_are_withheld_with_channel_and_time():
    by, _ = found(with_torques(lost(10.05, 10.2)))
    for key in (*PEAKS, ("event_time", "unlock"), ("torque_transfer_slope", "")):
        assert by[key].value is None, key
        assert "10.2 s" in by[key].description
    assert by["torque_in_nominal", "sos"].value is not None
    assert by["torque_in_peak", "startup"].value is not None


def test_rows_that_are_missing_at_the_peak_withhold_it_too():
    by, _ = found(with_torques(lambda _n, _t, x: x, lambda t: (t < 10.03) | (t > 10.15)))
    for key in PEAKS:
        assert by[key].value is None, key


def test_a_hole_of_one_sensor_leaves_what_the_other_tells():
    by, _ = found(with_torques(lost(10.07, 10.2, "torque_out")))
    assert by["torque_out_peak", "brake"].value is None
    assert by["torque_transfer_slope", ""].value is None
    assert "torque_out" in by["torque_transfer_slope", ""].description
    assert by["torque_in_peak", "brake"].value is not None
    assert by["event_time", "unlock"].value is not None


def test_a_sound_run_and_one_with_single_lost_samples_lack_nothing():
    for recording in (sound(), with_torques(lambda _n, t, x: np.where(np.arange(t.size) % 997 == 0, np.nan, x))):
        by, numbers = found(recording)
        assert not numbers.torques.withheld
        assert all(by[key].value is not None for key in PEAKS)


def test_a_hole_at_the_start_ups_peak_withholds_it():
    time = found(sound())[1].peaks["torque_out", "startup"].time
    by, _ = found(with_torques(lost(time - 0.05, time + 0.05)))
    assert by["torque_out_peak", "startup"].value is None
    assert by["startup_excess_out", ""].value is None


def test_an_encoder_lost_as_the_lock_breaks_withholds_slope_and_lock():
    recording = synthesize({**BOX, "dropout_start": 9.9, "dropout_time": 0.5, "dropout_lost": True}, 3)[0]
    by, _ = found(recording)
    for key in (("torque_transfer_slope", ""), ("lock_torque", "")):
        assert by[key].value is None
        assert "encoder" in by[key].description


def test_a_reading_that_stands_still_is_told_and_its_levels_are_withheld():
    def frozen(name, time, values):
        start = np.searchsorted(time, 11.0)
        stands = (name == "torque_out") & (time >= 11.0) & (time < 24.0)
        return np.where(stands, values[start], values)

    by, numbers = found(with_torques(frozen))
    for key in (("torque_out_nominal", "sos"), ("torque_ratio_sos", ""), ("slip_torque", "")):
        assert by[key].value is None
        assert "torque_out tells nothing from 11 to 24 s" in by[key].description
    told = [q for q in run_faults(numbers, VibrationNumbers()) if q.level == "warning"]
    assert [q.channel for q in told] == ["torque_out"]
    assert "stands still from 11 to 24 s" in told[0].message


@pytest.mark.parametrize("bits", [8, 14])
def test_a_quiet_or_coarse_torque_does_not_stand_still(bits):
    rng = np.random.default_rng(bits)
    t = np.arange(0, 20, 1 / 2000)
    torque = np.where(t < 5, 0.0, 1.0) + 0.004 * rng.standard_normal(t.size)
    step = 20.0 / 2**bits
    assert standing_still(t, step * np.round(torque / step)) == []
