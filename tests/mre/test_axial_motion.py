"""The motion behind a gauge that comes in steps: constant rate, changing rate, standstill, no law at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.rigs.mre.axial.gauge import marks_of, step_of
from pipeline.rigs.mre.axial.motion import motion_of, rates
from pipeline.rigs.mre.axial.synthetic import axial_truth, duration, motion


def readings(step: float = 1e-5, seed: int = 0, **truth: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    known = axial_truth(truth)
    time = np.arange(0.03, duration(known), 1 / known.rate)
    d, _ = motion(known, time)
    d = d + known.gauge_noise * np.random.default_rng(seed).standard_normal(d.size)
    return time, d, np.round(d / step) * step if step else d


def test_step_of_a_gauge() -> None:
    _, _, x = readings()
    assert step_of(x) == pytest.approx(1e-5)
    assert step_of(readings(2.5e-6)[2]) == pytest.approx(2.5e-6)
    assert step_of(readings(0.0)[2]) == 0.0
    assert step_of(readings(0.0, gauge_noise=1.5e-6)[2]) == 0.0


def test_marks_lie_half_a_step_beyond_the_readings() -> None:
    time = np.arange(0, 5.4, 0.1) + 0.05
    x = np.round(time) * 1e-5
    marks = marks_of(time, x, 1e-5, 1.0)
    assert marks.time == pytest.approx(np.arange(5) + 0.5, abs=1e-9)
    assert marks.d == pytest.approx(1e-5 * (np.arange(5) + 0.5))


@pytest.mark.parametrize("speed", [1e-5, 1.07e-5, 3.33e-5, 2.3e-6])
def test_constant_rate_is_found_as_such(speed: float) -> None:
    time, _, x = readings(speed=speed)
    found = motion_of(time, x)
    assert [stroke.degree for stroke in found.strokes] == [1, 1]
    assert rates(found) == pytest.approx([speed, -speed], rel=3e-3)
    _, turns = found.crossings(found.coefficients, float(time[0]))
    assert turns[1] == pytest.approx(6e-4, abs=speed * 0.1)


@pytest.mark.parametrize("step", [1e-5, 1e-6, 0.0])
def test_changing_rate_is_followed(step: float) -> None:
    time, d, x = readings(step, rate_ripple=0.2)
    found = motion_of(time, x)
    parts = found.split(found.coefficients)
    inner = (time > 3) & (time < 57)
    assert found.strokes[0].degree > 1
    assert found.strokes[0].at(time[inner], parts[0]) == pytest.approx(d[inner], abs=1.5e-6)


def test_noisy_gauge_still_gives_the_rate() -> None:
    time, _, x = readings(gauge_noise=3e-6)
    found = motion_of(time, x)
    assert rates(found) == pytest.approx([1e-5, -1e-5], rel=0.01)


def test_standstill_lies_beyond_what_the_gauge_shows() -> None:
    time, _, x = readings(rest_top=5.0)
    found = motion_of(time, x)
    _, turns = found.crossings(found.coefficients, float(time[0]))
    assert turns[1] > found.highest[1] + 1e-5


def test_stop_and_go_is_no_smooth_motion() -> None:
    rng = np.random.default_rng(1)
    speed = np.repeat(rng.choice([0.0, 1e-5, 2e-5], 60), 20)
    d = np.concatenate([np.cumsum(speed) * 0.1, np.cumsum(speed)[::-1] * 0.1])
    found = motion_of(np.arange(d.size) * 0.1, np.round(d / 1e-5) * 1e-5)
    assert not found.smooth


def test_no_motion_is_refused() -> None:
    with pytest.raises(ValueError, match="does not move"):
        motion_of(np.arange(50.0), np.zeros(50))


def test_force_read_at_the_marks_of_the_gauge_needs_no_law_in_time() -> None:
    from axial_logs import found

    from pipeline.recording import Channel, Recording, Stream
    from pipeline.rigs.mre.axial.loop import along_strokes
    from pipeline.rigs.mre.axial.synthetic import AxialTruth

    rng = np.random.default_rng(3)
    up = np.arange(0, 6e-4 + 1e-9, 5e-5)
    d = np.concatenate([up, up[-2::-1]])
    stroke = np.repeat([0, 1], [up.size, up.size - 1])
    model = AxialTruth().model_at(0.0)
    F = model.force(d, along_strokes(d, stroke, [0, 6e-4, 0], model.rho)) + rng.normal(0, 1, d.size)
    time = np.cumsum(rng.uniform(3, 12, d.size))
    channels = {
        "displacement_axial": Channel("displacement_axial", d, "m"),
        "force_axial": Channel("force_axial", F, "N"),
    }
    campaign = found(Recording("hand", {"": Stream("", time, channels)}, {"coil_current": 0.0}))
    for name, true in (("stiffness_secant", 510.12e3), ("stiffness_slope", 470.8e3), ("alpha", 24.0)):
        p = campaign.one(name, coil_current=0.0)
        assert p.value == pytest.approx(true, rel=0.05)
        assert abs((p.value or 0) - true) < 4 * (p.std_error or 0)
