"""An emptied tank, with the key or without, closes a segment; what was removed is the sum of the segments."""

import numpy as np
import pytest
from tank_runs import tank_run

from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.drains import drain_times, emptied
from pipeline.rigs.rap.therapy.pump_gain import mean_gain


def removed(run):
    return (run.gain * run.asked)[1:].sum()


@pytest.mark.parametrize("pressed", [[], [1790.0]])
def test_the_sum_of_the_segments_is_what_was_removed(pressed):
    run = tank_run(V0=0.5e-3, minutes=75, drained=1800.0)
    found = run.course(pressed)
    assert len(found.segments) == 2
    assert found.segments[0].end == pytest.approx(1800.0, abs=65.0)
    assert abs(found.total - removed(run)) < 3.0 * found.total_sd
    assert found.total_sd < 4e-6
    assert found.final.value == pytest.approx(run.V[-1], abs=3e-6)
    assert found.segments[0].cause == ("drain key" if pressed else "emptied without the key")


def test_emptying_without_the_key_is_told():
    run = tank_run(V0=0.5e-3, minutes=60, drained=1800.0)
    found, empty, problems = emptied(run.levels(), run.tank, run.command)
    assert [e.announced for e in found] == [False]
    assert found[0].drop > 400e-6
    assert not empty
    assert "without drain_pressed" in problems[0].message


def test_a_tank_that_is_only_partly_emptied_starts_from_the_first_echo():
    run = tank_run(V0=0.9e-3, minutes=60, drained=1800.0, left=0.3e-3)
    found = run.course()
    assert len(found.segments) == 2
    assert found.segments[1].volume_begin == pytest.approx(0.3e-3, abs=3e-6)
    assert abs(found.total - removed(run)) < 3.0 * found.total_sd


def test_a_key_before_the_first_drop_says_that_the_tank_is_empty():
    run = tank_run(V0=0.0, minutes=40)
    found, empty, problems = emptied(run.levels(), run.tank, run.command, [5.0])
    assert found == ()
    assert empty
    assert problems == ()


def test_a_key_pressed_on_a_tank_that_keeps_some_is_not_believed():
    run = tank_run(V0=0.9e-3, minutes=60, drained=1800.0, left=0.1e-3)
    found = run.course([1790.0])
    assert "shows 100 mL" in found.problems[0].message
    assert not found.segments[1].known_empty
    assert abs(found.total - removed(run)) < 3.0 * found.total_sd
    told = mean_gain(found, run.command)
    assert told.gain.value == pytest.approx(0.97, abs=0.03)
    assert told.problems == ()


def test_a_small_drain_that_takes_a_while_is_seen_without_the_key():
    run = tank_run(V0=0.5e-3, minutes=60, wild=0.05)
    slowly = 80e-6 * np.clip((run.t - 1790.0) / 15.0, 0.0, 1.0) / run.tank.area
    heard = run.signals["distance"].values > 0.0
    run.signals["distance"] = Signal("uf_level_distance", run.t, run.signals["distance"].values + heard * slowly)
    found = run.course()
    assert [s.cause for s in found.segments] == ["emptied without the key", "end of the run"]
    assert mean_gain(found, run.command).gain.value == pytest.approx(0.97, abs=0.03)


def test_foam_is_no_work_of_the_pump():
    run = tank_run(V0=0.5e-3, minutes=80)
    jump = np.where(run.t > 2000.0, 15e-3, 0.0)
    run.signals["distance"] = Signal("uf_level_distance", run.t, run.signals["distance"].values - jump)
    found = run.course()
    assert "taken up anew" in found.problems[0].message
    assert abs(found.total - removed(run)) < 3.0 * found.total_sd
    told = mean_gain(found, run.command)
    assert abs(told.gain.value - 0.97) < 2.5 * told.gain.std_error
    assert told.problems == ()


def test_ordinary_runs_and_wild_echoes_show_no_emptying():
    for seed in range(20):
        run = tank_run(seed, minutes=40, wild=0.1)
        assert emptied(run.levels(), run.tank, run.command)[0] == ()


def test_presses_are_edges_and_rows_of_events_once():
    t = np.arange(100.0)
    key = Signal("drain_pressed", t, ((t >= 20.0) & (t < 23.0)) * 1.0)
    assert drain_times(key, [21.0, 60.0]) == [20.0, 60.0]
    listed = Signal("drain_pressed", np.array([1795.0, 3795.0]), np.ones(2))
    assert drain_times(listed) == [1795.0, 3795.0]
    assert drain_times(None) == []
