"""How sure the zero of a torque is: from one standstill of two seconds, and from two."""

from dataclasses import replace

import numpy as np
import pytest
from gearbox_known import wander

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.gearbox.record import Signal, record_of
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.torques.offsets import Level, Offset, zero_offsets


def held(value, sd, dof, true):
    return abs(value - true) <= t_quantile(dof) * sd


@pytest.mark.parametrize("memory", [0.02, 0.05, 0.1])
@pytest.mark.thorough
def test_the_zero_of_a_two_second_standstill_covers_whatever_the_memory_of_its_drift(memory):
    (recording,) = synthesize({"runs": ["g3"], "vibration": False}, 0)
    record = record_of(recording)
    segmentation = segment(record)
    covered, widths, errors = [], [], []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        noise = wander(rng, record.torque.time.size, 5e-4, 0.012, memory) + 0.02 * rng.normal(
            size=record.torque.time.size
        )
        torque = Signal(record.torque.time, {**record.torque.values, "torque_out": noise})
        found = zero_offsets(replace(record, torque=torque), segmentation).torque_out
        covered.append(held(found.value, found.sd, found.dof, 0.0))
        widths.append(t_quantile(found.dof) * found.sd)
        errors.append(found.value)
    assert 0.91 < np.mean(covered) < 0.985
    assert np.median(widths) < 1.4 * 1.96 * np.std(errors), "too wide is as wrong as too narrow"


def test_the_zero_of_two_standstills_is_not_that_of_the_one_which_looks_surer_by_chance():
    """Weights by estimated errors favour the one that came out too small: the intervals were too narrow."""
    rng = np.random.default_rng(1)
    covered = []
    for _ in range(3000):
        levels = []
        for dof in (6.0, 6.0):
            error = 0.0025 * rng.normal()
            levels.append(Level(0.0, 0.012 + error, 0.0025 * np.sqrt(rng.chisquare(dof) / dof), dof))
        both = Offset(*levels)
        covered.append(held(both.value, both.sd, both.dof, 0.012))
    assert 0.94 < np.mean(covered) < 0.975
