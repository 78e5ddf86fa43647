"""Vibration logs that are not what they should be: hum, dead and clipped channels, wrong units, slow sampling."""

from functools import cache

import numpy as np
import pytest

from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_faults import run_faults
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import gearbox_truth
from pipeline.rigs.gearbox.vibration.mesh import input_speed
from pipeline.rigs.gearbox.vibration.vibration_numbers import vibration_of


@cache
def logged(run, rate=2500.0):
    return synthesize({"runs": [run], "vibration_rate": rate}, 1)[0]


def changed(recording, change):
    """Return the recording with `change(name, time, values)` on every vibration channel."""
    log = recording.streams["vibration"]
    channels = {
        name: Channel(name, change(name, log.time, np.array(channel.values)), "m/s^2")
        for name, channel in log.channels.items()
    }
    streams = {**recording.streams, "vibration": Stream("vibration", log.time, channels)}
    return Recording(recording.run, streams, recording.conditions)


def told(recording):
    """Return the numbers of a run, those of its vibration, and the warnings by channel."""
    numbers = numbers_of(record_of(recording))
    vibration = vibration_of(numbers)
    found = [q for q in run_faults(numbers, vibration) if q.level != "note"]
    return numbers, vibration, {q.channel: q.message for q in found}


def true_speed(run):
    truth, _ = next(iter(known_runs(gearbox_truth({"runs": [run]}), 1)))
    held = (truth.motion.time > 13) & (truth.motion.time < 18)
    return truth.motion.w1[held].mean()


def test_a_sound_log_has_no_warning():
    _, vibration, warnings = told(logged("g3"))
    assert warnings == {}
    assert vibration.channel == "acc_in_radial"


@pytest.mark.parametrize("run", ["g3", "g5"])
@pytest.mark.parametrize("hum", [0.05, 0.5])
@pytest.mark.thorough
def test_mains_hum_and_its_harmonics_are_neither_slip_nor_the_input_speed(run, hum):
    """At 150 rpm the lines of a drive without droop would lie at 100, 200, 350 and 700 Hz: all of them hum."""
    waves = changed(
        logged(run), lambda _, t, x: x + hum * sum(np.sin(100 * np.pi * k * t + k) / k for k in range(1, 15))
    )
    numbers, vibration, warnings = told(waves)
    assert vibration.partial is None
    assert warnings == {}
    assert numbers.speed_in.value == pytest.approx(true_speed(run), rel=2e-5)


def test_a_single_strong_line_is_no_comb():
    _, vibration, warnings = told(changed(logged("g5"), lambda _, t, x: x + 2.0 * np.sin(2 * np.pi * 133.3 * t)))
    assert vibration.partial is None
    assert warnings == {}


def test_hum_alone_is_no_input_speed():
    t = np.arange(0, 14, 1 / 2500)
    noise = np.random.default_rng(0).normal(size=t.size)
    channels = {"acc_in_radial": noise + sum(np.sin(100 * np.pi * k * t) / k for k in range(1, 15))}
    nominal = 150 * 2 * np.pi / 60
    assert input_speed(t, channels, (4.0, 14.0), nominal) is not None, (
        "without a standstill nothing tells it from a comb"
    )
    assert input_speed(t, channels, (4.0, 14.0), nominal, rest=(0.0, 2.0)) is None


def test_a_dead_channel_is_told_and_left_out():
    numbers, vibration, warnings = told(changed(logged("g3"), lambda n, _, x: 0 * x if n == "acc_in_radial" else x))
    assert "dead" in warnings["acc_in_radial"]
    assert set(warnings) == {"acc_in_radial"}
    assert vibration.channel == "acc_in_axial"
    assert set(vibration.spectra) == {"fos", "sos"}
    assert numbers.speed_in.value == pytest.approx(true_speed("g3"), rel=2e-5)


def test_dead_channels_alone_leave_the_input_speed_assumed():
    numbers, vibration, warnings = told(changed(logged("g3"), lambda _, t, x: 0 * x))
    assert numbers.speed_in.source == "nominal"
    assert vibration.channel == ""
    assert len(warnings) == 5
    assert all(level.estimate.value is None for level in vibration.levels)


def test_a_clipped_channel_is_told_and_the_speed_stands():
    cut = changed(logged("g3"), lambda n, _, x: np.clip(x, -1.5, 1.5) if n == "acc_in_radial" else x)
    numbers, _, warnings = told(cut)
    assert set(warnings) == {"acc_in_radial"}
    assert "end stop" in warnings["acc_in_radial"]
    assert "1.5 m/s^2" in warnings["acc_in_radial"]
    assert numbers.speed_in.value == pytest.approx(true_speed("g3"), rel=2e-5)


@pytest.mark.parametrize("channel", ["acc_in_axial", "acc_out_radial", "acc_load_radial"])
def test_a_channel_in_g_declared_as_metres_per_second_squared_is_noticed(channel):
    _, _, warnings = told(changed(logged("g3"), lambda n, _, x: x / 9.81 if n == channel else x))
    assert set(warnings) == {channel}
    assert "perhaps in g" in warnings[channel]


def test_a_slow_log_at_210_rpm_names_the_folded_lines_and_finds_the_speed_by_the_others():
    numbers, vibration, warnings = told(logged("g7", 800.0))
    speed = true_speed("g7")
    assert [order for order, _ in vibration.aliased] == [140.0, 280.0]
    for order, frequency in vibration.aliased:
        line = order * speed / (2 * np.pi)
        assert frequency == pytest.approx(abs(line - 800 * round(line / 800)), abs=1.0)
    assert "aliased" in warnings["acc_in_radial"]
    assert "40, 80" in numbers.speed_in.told
    assert numbers.speed_in.value == pytest.approx(speed, rel=1e-4)
