"""The scale's clock, touches, drift, and the errors of volume and rate against it."""

import numpy as np
import pytest
from tank_runs import RATE, tank_run

from pipeline.errors import InputError
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.regulation import regulate
from pipeline.rigs.rap.therapy.scale_clock import scale_lag
from pipeline.rigs.rap.therapy.scale_record import weighed
from pipeline.rigs.rap.therapy.volume_against_scale import against_scale


def compared(run, scale=None, **settings):
    course = run.course()
    by_scale = weighed(scale or run.signals["scale"], 1004.0, 0.0)
    lag = scale_lag(by_scale, course)
    return against_scale(course.time, course.volume, course.volume_sd, by_scale, lag, first_echo=course.first_echo, **settings), lag, by_scale  # fmt: skip


def test_the_clock_of_the_scale_is_found_from_start_and_pause():
    z = []
    for seed in range(12):
        run = tank_run(seed, minutes=60, start=400.0, pause=(1800.0, 2000.0), scale_lag=-17.0)
        _, lag, _ = compared(run)
        assert lag.determined
        z.append((lag.value + 17.0) / lag.sd)
    assert np.sqrt(np.mean(np.square(z))) < 1.6
    assert np.all(np.abs(z) < 3.5)


def test_a_steady_rise_tells_no_clock_and_says_so():
    found, lag, _ = compared(tank_run(minutes=60, start=0.0))
    assert lag.lag.value is None
    assert "steadily" in lag.lag.reason
    assert "+-30 s" in lag.problems[0].message
    assert found.bias.std_error > 1e-6


def test_volume_and_rate_agree_with_the_scale():
    found, _, _ = compared(tank_run(minutes=90, start=400.0), set_rate=RATE)
    assert found.rms.value < 0.8e-6
    assert abs(found.final.value) < 2e-6
    assert abs(found.final_percent) < 0.5
    assert found.rate_ratio.value == pytest.approx(0.97, abs=0.02)
    assert found.problems == ()


def test_a_sensor_two_millimetres_off_is_seen_by_the_scale_alone():
    run = tank_run(minutes=60, start=400.0, offset=2e-3)
    assert run.course().consistency.passed
    found, _, _ = compared(run)
    assert found.bias.value == pytest.approx(-17e-6, abs=1.5e-6)
    assert "calibrate the geometry" in found.problems[0].message


def test_touches_and_lasting_jumps_of_the_scale_are_taken_out_and_told():
    run = tank_run(minutes=90, start=400.0)
    mass = run.signals["scale"].values
    mass[2000:2030] += 0.2
    mass[3500:] += 0.15
    found, _, by_scale = compared(run)
    assert found.rms.value < 0.8e-6
    assert any("not used" in p.message for p in by_scale.problems)
    assert any("+149 mL" in p.message or "+150 mL" in p.message for p in found.problems)


def test_a_drifting_scale_is_told():
    run = tank_run(minutes=90, start=400.0)
    drifting = Signal("uf_mass_scale", run.t, run.signals["scale"].values + 0.02 * run.t / 3600.0)
    found, _, _ = compared(run, drifting)
    assert any("drift apart" in p.message for p in found.problems)


def test_a_pump_eight_per_cent_off_is_told_with_its_gain():
    found, _, _ = compared(tank_run(minutes=60, start=400.0, mean=0.9), set_rate=RATE)
    assert any("UF pump gain 0.89" in p.message for p in found.problems)


def test_a_frozen_or_missing_scale_is_refused():
    t = np.arange(600.0)
    with pytest.raises(InputError, match="frozen"):
        weighed(Signal("uf_mass_scale", t, np.full(600, 0.3)), 1004.0, 0.0)
    with pytest.raises(InputError, match="10 readings"):
        weighed(Signal("uf_mass_scale", t[:10], t[:10]), 1004.0, 0.0)


def test_without_a_tare_the_first_readings_count_and_that_is_told():
    found = weighed(tank_run(V0=0.0, minutes=10).signals["scale"], 1004.0)
    assert not found.tare_known
    assert "mass_tare" in found.problems[0].message


def test_an_open_loop_delivers_what_the_pump_gives():
    run = tank_run(minutes=60, start=60.0)
    found = regulate(run.command, run.signals["set"], run.course())
    assert found.closed is False
    assert found.error_share == pytest.approx((run.V[-1] - run.V[0]) / run.asked.sum() - 1.0, abs=0.01)
    assert found.open_loop == pytest.approx(found.delivered, rel=0.01)
    assert found.correction_time.value is None


def test_the_time_of_the_loop_is_read_from_the_command():
    run = tank_run(minutes=60, start=0.0)
    wanted = np.cumsum(np.full(run.t.size, RATE)) - RATE
    own = wanted - 3e-6 * np.sin(run.t / 500.0)
    run.signals["command"] = Signal("uf_pump_command", run.t, RATE * (1.0 + (wanted - own) / (RATE * 600.0)))
    found = regulate(run.command, Signal("uf_flow_set", run.t, np.full(run.t.size, RATE)), run.course(), device_volume=Signal("uf_volume_rap", run.t, own))  # fmt: skip
    assert found.closed is True
    assert found.correction_time.value == pytest.approx(600.0, rel=0.01)
