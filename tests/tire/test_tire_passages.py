"""Revolutions found in a log are those that were rolled (tire.md, 5.2-5.5)."""

import numpy as np
import pytest

from pipeline.rigs.tire.passages.device import device_of
from pipeline.rigs.tire.passages.revolutions import joined, revolutions_of
from pipeline.rigs.tire.synthetic.motion import bench_motion
from pipeline.rigs.tire.synthetic.rig import synthesize_bench
from pipeline.rigs.tire.synthetic.runs import RUNS
from pipeline.rigs.tire.synthetic.truth import bench_truth


@pytest.mark.parametrize("name", ["load_1000", "speed_20"])
def test_passages_stand_where_the_sensor_passed_within_their_standard_errors(name):
    (recording,) = synthesize_bench({"runs": [name]}, 1)
    load, speed, duration, number, _ = RUNS[name]
    motion = bench_motion(bench_truth({}), load, speed, duration, np.random.default_rng((1, number)))
    found = joined(revolutions_of(device_of(recording)))
    at = found.times * 12e3
    order = np.arange(motion.angle.size)
    angle = np.interp(at, order, motion.angle)
    off = (angle - 2 * np.pi * np.round(angle / (2 * np.pi))) / np.interp(at, order, np.gradient(motion.angle) * 12e3)
    off -= np.average(off, weights=found.time_se**-2)
    assert len(found) == np.count_nonzero(np.diff(np.round(motion.angle / (2 * np.pi)))) - 1 or len(found) >= 25
    assert np.std(off) < 6e-6
    assert np.mean(np.abs(off) < 1.96 * found.time_se) > 0.85
