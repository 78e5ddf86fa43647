"""Levels do not change when a still liquid's tank is tilted or the air warms, and are dropped where eq. 8 does not hold."""

from dataclasses import replace

import numpy as np
import pytest
from tank_runs import TANK, tank_run

from pipeline.errors import InputError
from pipeline.rigs.rap.circuit.tank import Tank
from pipeline.rigs.rap.synthetic.rig import synthesize_therapy
from pipeline.rigs.rap.tables import Signal, signal
from pipeline.rigs.rap.therapy.channel_faults import channel_faults
from pipeline.rigs.rap.therapy.levels import BLIND, CUT, FROZEN, NO_ECHO, TILTED, level_course, tank_of

CONDITIONS = {"tank_lx": 0.12, "tank_ly": 0.0705, "tank_height": 0.26, "level_sensor_z": 0.285, "level_sensor_dx": 0.035,
              "level_sensor_dy": 0.0, "tank_blind_level": 0.01, "echo_reference_temperature": 293.15, "echo_model": "axis"}  # fmt: skip


@pytest.mark.parametrize("echo", ["axis", "specular"])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (8.0, 0.0), (-5.0, 6.0)])
def test_tilt_and_temperature_are_taken_out_exactly(echo, tilt):
    run = tank_run(V0=0.8e-3, minutes=10, noise=0.0, wild=0.0, tilt=tilt, tank=replace(TANK, echo=echo))
    levels = run.levels()
    assert np.allclose(levels.level * TANK.area, run.V, atol=1e-9)


def test_the_wrong_echo_model_at_ten_degrees_is_off_by_one_and_a_half_per_cent_of_the_distance():
    run = tank_run(V0=0.8e-3, minutes=5, noise=0.0, wild=0.0, tilt=(10.0, 0.0), tank=replace(TANK, echo="specular"))
    run.tank = TANK
    off = run.levels().level - run.V / TANK.area
    D = TANK.z - run.V / TANK.area + 0.035 * np.tan(np.radians(10.0))
    assert np.allclose(off / D, 0.0152, atol=2e-4)


def test_without_corrections_a_tilt_of_one_and_a_half_degrees_is_worth_eight_millilitres():
    run = tank_run(V0=0.8e-3, minutes=5, noise=0.0, wild=0.0)
    upright = run.levels(accelerations=(None, None, None))
    assert np.mean(upright.level - run.levels().level) * TANK.area == pytest.approx(-7.75e-6, rel=0.02)
    assert "8 mL" in upright.problems[0].message
    assert upright.common_sd[0] * TANK.area > 7.75e-6 / 2


def test_a_missing_air_temperature_is_told_and_counted():
    run = tank_run(V0=0.3e-3, minutes=5, noise=0.0, wild=0.0)
    levels = run.levels(temperature=None)
    off = np.abs(levels.level - run.V / TANK.area)
    assert np.all(off < 2.0 * levels.common_sd)
    assert any("air temperature" in p.message for p in levels.problems)


def test_levels_are_dropped_beyond_twelve_degrees_and_where_the_surface_cuts_the_floor():
    steep = tank_run(V0=0.8e-3, minutes=5, tilt=(13.0, 0.0)).levels()
    assert np.all(steep.why[steep.why != NO_ECHO] == TILTED) or np.mean(steep.why == TILTED) > 0.9
    shallow = tank_run(V0=0.1e-3, minutes=5, start=300.0, noise=0.0, wild=0.0, tilt=(11.5, 0.0)).levels()
    assert np.all(shallow.why == CUT)  # 11.8 mm at the centroid, 12.2 mm are needed
    assert shallow.first is None
    assert any("no usable level" in p.message for p in shallow.problems)


def test_without_the_valid_flag_the_blind_level_is_kept_and_chooses_no_high_ones():
    run = tank_run(V0=0.02e-3, minutes=40, wild=0.0)
    shown = TANK.z - np.maximum(run.V / TANK.area, 0.004) + 1e-3 * np.random.default_rng(0).standard_normal(run.t.size)
    run.signals["distance"] = Signal("uf_level_distance", run.t, shown)
    levels = run.levels(valid=None, accelerations=(None, None, None), temperature=replace(run.air, values=np.full(run.t.size, 293.15)))  # fmt: skip
    first = levels.usable & (run.t < levels.first + 120.0)
    assert (levels.why == BLIND).sum() > 300
    assert np.mean(levels.level[first] - run.V[first] / TANK.area) == pytest.approx(0.0, abs=4e-4)


def test_a_distance_that_repeats_itself_is_frozen_and_told():
    run = tank_run(minutes=20)
    D = run.signals["distance"]
    D.values[600:900] = D.values[600]
    levels = run.levels()
    assert np.all(levels.why[605:895] == FROZEN)
    assert any("frozen" in p.message for p in levels.problems)


def test_an_accelerometer_that_reads_downwards_or_in_g_is_understood_and_told():
    run = tank_run(minutes=10, noise=0.0, wild=0.0)
    a = run.signals["acceleration"]
    down = tuple(Signal(s.name, s.time, -s.values) for s in a)
    in_g = tuple(Signal(s.name, s.time, s.values / 9.81) for s in a)
    for other, word in ((down, "other sign"), (in_g, "9.81")):
        levels = run.levels(accelerations=other)
        assert np.allclose(levels.level, run.levels().level, atol=1e-6)
        assert any(word in p.message for p in levels.problems)


def test_walking_makes_levels_less_certain():
    run = tank_run(minutes=10)
    a = run.signals["acceleration"]
    for axis, shaken in zip(a, 1.5 * np.random.default_rng(2).standard_normal((3, 60)), strict=True):
        axis.values[200:260] += shaken
    levels = run.levels()
    assert np.mean(levels.moving[200:260]) > 0.9
    assert not levels.moving[:190].any()
    assert np.sqrt(levels.variance[230]) == pytest.approx(7.3e-3, rel=0.01)


def test_faster_logs_are_reduced_to_the_median_of_a_second():
    slow = tank_run(minutes=5, noise=0.0, wild=0.0)
    D, t = slow.signals["distance"].values, slow.t
    fast_t = np.arange(0.0, 300.0, 0.05)
    fast = Signal("uf_level_distance", fast_t, np.interp(fast_t, t, D))
    fast.values[::7] = 0.05
    slow.signals["distance"] = fast
    levels = slow.levels(valid=None)
    assert levels.time.size == 300
    assert np.allclose(levels.level * TANK.area, np.interp(levels.time, t, slow.V), atol=1e-6)


def test_conditions_that_are_missing_are_asked_for_or_told():
    tank, remarks = tank_of(CONDITIONS)
    assert tank == Tank()
    assert remarks == ()
    with pytest.raises(InputError, match="tank_lx, level_sensor_z"):
        tank_of({"tank_ly": 0.07})
    _, remarks = tank_of({k: CONDITIONS[k] for k in ("tank_lx", "tank_ly", "level_sensor_z")})
    assert len(remarks) == 6
    with pytest.raises(InputError, match="axis and specular"):
        tank_of(CONDITIONS | {"echo_model": "cone"})


def test_a_tank_that_pitches_by_fourteen_degrees_is_no_wrong_unit():
    truth = {"runs": ["rap_tank_motion"], "motion_pitch": np.radians(14.0), "motion_duration": 3600.0}
    (run,) = synthesize_therapy(truth, 3)
    assert channel_faults(run) == []


@pytest.mark.parametrize("turned", ["tank_accel_x", "level_sensor_dx", None])
def test_a_wrong_sign_of_the_tilt_is_named_and_its_level_not_used(turned):
    (run,) = synthesize_therapy({"runs": ["rap_tank_motion"], "motion_duration": 1500.0}, 4)
    axes = [signal(run, f"tank_accel_{axis}") for axis in "xyz"]
    if turned == "tank_accel_x":
        axes[0] = replace(axes[0], values=-axes[0].values)
    tank = replace(TANK, dx=-TANK.dx) if turned == "level_sensor_dx" else TANK
    distance = signal(run, "uf_level_distance")
    if turned is None:
        assert level_course(distance, tank, accelerations=axes).share_valid > 0.9
        return
    with pytest.raises(InputError, match="tank_accel_x or level_sensor_dx has the wrong sign"):
        level_course(distance, tank, accelerations=axes)


def test_a_flag_that_denies_every_echo_of_a_working_sensor_is_doubted():
    run = tank_run(minutes=20)
    dead = Signal("uf_echo_valid", run.t, np.zeros(run.t.size))
    levels = run.levels(valid=dead)
    assert not levels.usable.any()
    assert any("dead, or inverted" in problem.message for problem in levels.problems)
