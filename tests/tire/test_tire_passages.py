"""Revolutions found in a log are those that were rolled, within their standard errors (tire.md, 5.2-5.5)."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.recording import Recording
from pipeline.rigs.tire.passages.device import device_of
from pipeline.rigs.tire.passages.features import features, revolution_features
from pipeline.rigs.tire.passages.order_tracking import monotone
from pipeline.rigs.tire.passages.revolutions import BINS, joined, revolutions_of
from pipeline.rigs.tire.passages.waveform import averaged
from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.sensor import Sensor, flex_shape, highest_order
from pipeline.rigs.tire.ring.shape_lengths import lengths
from pipeline.rigs.tire.synthetic import rig
from pipeline.rigs.tire.synthetic.motion import Motion, bench_motion, road_motion
from pipeline.rigs.tire.synthetic.rig import synthesize_bench, synthesize_road
from pipeline.rigs.tire.synthetic.runs import RUNS
from pipeline.rigs.tire.synthetic.truth import bench_truth, ring_of, road_truth

R = 0.3171
CUT = highest_order(0.05, R)


@cache
def bench(name, seed, **truth):
    """Return a bench run's revolutions and how the wheel truly turned."""
    load, speed, duration, number, _ = RUNS[name]
    (recording,) = synthesize_bench({"runs": [name], **truth}, seed)
    motion = bench_motion(
        bench_truth(truth), load, speed, truth.get("duration", duration), np.random.default_rng((seed, number))
    )
    return joined(revolutions_of(device_of(recording))), motion


def late(found, motion, rate=12e3):
    """Return by how much the moments are late, s, less their weighted mean: the absolute angle is free."""
    order = np.arange(motion.angle.size)
    angle = np.interp(found.times * rate, order, motion.angle)
    turning = np.interp(found.times * rate, order, np.gradient(motion.angle) * rate)
    off = (angle - 2 * np.pi * np.round(angle / (2 * np.pi))) / turning
    there = ~found.repaired
    return (off - np.average(off[there], weights=found.time_se[there] ** -2))[there], found.time_se[there]


def expected(found, motion, waveform):
    """Return the true shape of R2 under the mean load of the revolutions, its peak at angle 0."""
    truth = bench_truth({})
    between = (motion.time > found.times[0]) & (motion.time < found.times[-1])
    k = pressed(compliance(ring_of(truth)), truth.kt, truth.Ro, float(motion.Fz[between].mean())).shape
    shape = flex_shape(k, Sensor(truth.c, truth.R0, 0.05, truth.flex_lag), R, waveform.speed)
    return shape.times(np.exp(1j * shape.orders * lengths(shape, R).peak_angle))


def test_moments_of_the_bench_stand_at_the_noise_bound_and_their_errors_cover():
    off, se = (
        np.concatenate(part)
        for part in zip(*(late(*bench("load_2000", s, duration=12.0, load_wave=0.0)) for s in range(4)), strict=True)
    )
    slope = np.gradient(_volts_by_angle(), 2 * np.pi / 4096)
    per_turn = 12e3 * 2 * np.pi * R / (10 / 3.6)
    bound = np.hypot(1.5e-3, 3.3 / 4096 / np.sqrt(12)) / np.sqrt(np.sum(slope**2) * per_turn / 4096) * R / (10 / 3.6)
    assert np.std(off) == pytest.approx(bound, rel=0.2)
    assert np.mean(np.abs(off) < 1.96 * se) > 0.9
    assert np.sqrt(np.mean(se**2)) == pytest.approx(bound, rel=0.2)


def test_a_load_that_waves_once_a_drum_turn_is_in_the_errors_of_the_moments():
    off, se = (
        np.concatenate(part)
        for part in zip(*(late(*bench("load_3000", s, duration=12.0)) for s in range(5)), strict=True)
    )
    assert np.sqrt(np.mean((off / se) ** 2)) == pytest.approx(1.0, abs=0.15)


def _volts_by_angle():
    truth = bench_truth({})
    k = pressed(compliance(ring_of(truth)), truth.kt, truth.Ro, 2000.0).shape
    shape = flex_shape(k, Sensor(truth.c, truth.R0, 0.05, truth.flex_lag), R, 10 / 3.6 / R).cut(CUT)
    R2 = 1e4 + shape.on_grid(4096)[1]
    return 3.3 * R2 / (1e4 + R2)


def test_moments_on_the_road_are_as_good_as_coloured_noise_lets_them_be():
    steady = {"speeds": ((0, 13.9),), "pulses": (), "duration": 12.0}
    parts = []
    for seed in range(4):
        motion = road_motion(road_truth(steady), np.random.default_rng((seed, 21)))
        parts.append(late(joined(revolutions_of(device_of(synthesize_road(steady, seed)[0]))), motion))
    off, se = (np.concatenate(part) for part in zip(*parts, strict=True))
    assert np.std(off) < 25e-6
    assert 0.9 < np.mean(np.abs(off) < 1.96 * se) < 0.99


@pytest.mark.parametrize("name", ["load_1000", "load_2500", "speed_20"])
def test_the_mean_waveform_is_the_ring_seen_by_the_sensor_within_its_standard_errors(name):
    found, motion = bench(name, 1)
    waveform = averaged(found)
    truth = expected(found, motion, waveform).on_grid(BINS)[1]
    columns = np.column_stack([np.gradient(truth, 2 * np.pi / BINS), np.ones(BINS)]) / waveform.std_error[:, None]
    off = (waveform.change - truth) / waveform.std_error
    off -= columns @ np.linalg.lstsq(columns, off, rcond=None)[0]
    assert np.mean(off**2) == pytest.approx(1.0, abs=0.15)
    # The two invariants of a closed ring: its mean change is zero, and so is its first harmonic.
    assert waveform.level == pytest.approx(1e4, abs=15.0)
    assert waveform.first_harmonic < 1.0


def test_marks_of_the_mean_waveform_agree_with_those_of_the_true_shape():
    z = []
    for name in RUNS:
        found, motion = bench(name, 1)
        waveform = averaged(found)
        told = features(waveform, R, CUT)
        truth = lengths(expected(found, motion, waveform), R)
        for mark in ("peak", "dip_leading", "dip_trailing", "deformation", "slope", "zero"):
            z.append((getattr(told.value, mark) - getattr(truth, mark)) / getattr(told.error, mark))
        assert told.value.deformation == pytest.approx(truth.deformation, abs=1.5e-3)
        assert told.value.slope == pytest.approx(truth.slope, abs=0.6e-3)
        assert told.value.peak == pytest.approx(truth.peak, rel=1e-3)
    assert np.sqrt(np.mean(np.square(z))) < 1.4


def test_marks_of_single_revolutions_follow_the_load_and_scatter_by_their_errors():
    found, motion = bench("load_2500", 1)
    waveform = averaged(found)
    marks = revolution_features(found, waveform, R, CUT)
    load = np.interp(found.times, motion.time, motion.Fz)
    left = marks.peak - np.polyval(np.polyfit(load, marks.peak, 1), load)
    assert np.std(left) < 1.6 * np.sqrt(np.mean(marks.peak_se**2))
    assert np.polyfit(load, marks.peak, 1)[0] == pytest.approx(2.86, rel=0.1)
    assert np.nanmedian(marks.asymmetry) == pytest.approx(92.0, abs=5.0)


@pytest.mark.parametrize(
    ("radius", "rate", "kmh", "load"),
    [
        (0.3171, 12e3, 130, 3000),
        (0.2, 1e3, 130, 1000),
        (0.2, 12e3, 1, 500),
        (0.6, 2e3, 1, 6000),
        (0.6, 50e3, 130, 6000),
    ],
)
def test_wheels_of_any_size_speed_and_rate_are_followed(radius, rate, kmh, load):
    speed = kmh / 3.6
    turns = 7.5 if kmh == 1 else 40.5
    truth = {
        "loads": [load], "speed": speed, "duration": turns * 2 * np.pi * radius / speed, "rate": rate, "R": radius,
        "Ro": radius + 0.01, "film_gain": 20.0,
    }  # fmt: skip
    (recording,) = synthesize_bench(truth, 3)
    motion = bench_motion(bench_truth(truth), load, speed, truth["duration"], np.random.default_rng((3, 101)))
    found = joined(revolutions_of(device_of(recording)))
    assert turns - 3.6 < len(found) < turns
    assert np.median(found.speed) == pytest.approx(speed / radius, rel=2e-3)
    assert np.std(late(found, motion, rate)[0]) < 1e-4 * 2 * np.pi * radius / speed + 0.02 / rate


def driven(corners, seed=1, **truth):
    """Return the log of a drive with the given corners of the speed, which may be 0, and its motion."""
    known = road_truth({"pulses": (), "duration": float(corners[-1][0]), **truth})
    time = np.arange(int(known.duration * known.rate)) / known.rate
    speed = np.interp(time, *np.transpose(corners))
    angle = 1.0 + np.cumsum(speed) / known.rate / known.R
    motion = Motion(time, speed, angle, np.full(time.size, 3500.0), np.zeros(time.size))
    device = rig._device(known, motion, np.random.default_rng(seed))
    return Recording("drive", {"device": device}, rig._conditions(known, {"bench_or_road": "road"})), motion


def test_stops_and_starts_are_no_missed_passages():
    recording, motion = driven(
        [(0, 0), (5, 0), (12, 10), (20, 10), (26, 0), (44, 0), (49, 8), (60, 8), (62, 0), (66, 0), (71, 12), (80, 12)]
    )
    found = joined(revolutions_of(device_of(recording)))
    true = np.interp(found.times, motion.time, motion.speed) / R
    turns = (motion.angle[-1] - motion.angle[0]) / (2 * np.pi)
    assert turns - 16 < len(found) < turns
    assert np.abs(found.speed / true - 1.0).max() < 0.1
    assert len(found.stops) == 2
    for (begin, end), (rest, start) in zip(found.stops, ((26.0, 44.0), (62.0, 66.0)), strict=True):
        assert rest - 2.0 < begin < rest + 0.1
        assert start - 0.1 < end < start + 2.5
    assert not np.any((found.times > 26.0) & (found.times < 44.0))


def test_neighbouring_pieces_give_each_revolution_once():
    truth = {"runs": ["load_2000"], "duration": 150.0, "rate": 2e3}
    (recording,) = synthesize_bench(truth, 2)
    blocks = list(revolutions_of(device_of(recording)))
    found = joined(blocks)
    assert len([block for block in blocks if len(block)]) == 3
    motion = bench_motion(bench_truth(truth), 2000.0, 10 / 3.6, 150.0, np.random.default_rng((2, 13)))
    turns = (motion.angle[-1] - motion.angle[0]) / (2 * np.pi)
    assert turns - 4 < len(found) < turns
    assert np.std(np.diff(found.times)) < 5e-3
    assert np.std(late(found, motion, 2e3)[0]) < 3e-5


def test_an_hour_of_silence_is_left_out_and_nothing_is_counted_across_it():
    recording, _ = driven([(0, 8), (30, 8)])
    device = recording.streams["device"]
    later = device.time + np.where(device.time > 15.0, 3600.0, 0.0)
    index = recording.values("sample_index") + np.where(device.time > 15.0, 3600.0 * 12e3, 0.0)
    channels = {**device.channels, "sample_index": replace(device.channels["sample_index"], values=index)}
    found = joined(
        revolutions_of(
            device_of(replace(recording, streams={"device": replace(device, time=later, channels=channels)}))
        )
    )
    assert len(found) > 100
    assert found.speed == pytest.approx(8 / R, rel=2e-3)


def test_the_monotone_cubic_is_that_of_scipy():
    from scipy.interpolate import PchipInterpolator

    x = np.cumsum(0.2 + np.random.default_rng(1).random(12))
    y = np.arange(12.0)
    at = np.linspace(x[0], x[-1], 100)
    assert np.allclose(monotone(x, y, at), PchipInterpolator(x, y)(at), atol=1e-12)
