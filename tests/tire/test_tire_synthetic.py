"""The synthetic tire does what it says: physics, clocks, packets, faults (tire.md, sections 6 and 8)."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.pvdf import film_over_flex, high_pass
from pipeline.rigs.tire.ring.sensor import Sensor, averaging, divider_resistance, divider_voltage, flex_shape, lagging
from pipeline.rigs.tire.synthetic.electronics import high_passed, lagged
from pipeline.rigs.tire.synthetic.library import library
from pipeline.rigs.tire.synthetic.motion import bench_motion, road_motion
from pipeline.rigs.tire.synthetic.packets import lost_packets
from pipeline.rigs.tire.synthetic.rig import synthesize_bench, synthesize_road
from pipeline.rigs.tire.synthetic.runs import RUNS, VARIANTS
from pipeline.rigs.tire.synthetic.truth import bench_truth, ring_of, road_truth

STEADY = {
    "noise": 0.0, "loss": 0.0, "load_wave": 0.0, "speed_wander": (0.0, 0.0), "resistance_drift": 0.0,
    "device_ppm": 0.0, "adc_bits": 24, "as_voltage": True,
}  # fmt: skip


def one(overrides, seed=1):
    (recording,) = synthesize_bench(overrides, seed)
    return recording


def volts(recording, name="flex"):
    return recording.values(f"{name}_code") * 3.3 / 4096


def orders(values, speed, rate, n):
    """Return the harmonics 1..n of the passages in `values`, fitted to whole turns."""
    t = np.arange(values.size) / rate
    wave = np.exp(1j * speed * t[:, None] * np.arange(1, n + 1))
    A = np.hstack([np.ones((t.size, 1)), 2 * wave.real, -2 * wave.imag])
    found = np.linalg.lstsq(A, values, rcond=None)[0]
    return found[1 : n + 1] + 1j * found[n + 1 :]


def test_noise_free_run_is_the_ring_seen_by_the_sensor():
    speed, rate = 10 / 3.6 / 0.3171, 12e3
    run = one({**STEADY, "runs": ["load_2000"], "duration": 4.0, "rate": rate})
    R2 = divider_resistance(run.values("flex_voltage"), 3.3, 1e4)
    found = orders(R2[: int(4 * rate)][1200:], speed, rate, 40)
    truth = bench_truth({})
    shape = pressed(compliance(ring_of(truth)), truth.kt, truth.Ro, 2000.0).shape
    n = np.arange(1, 41)
    expected = 5000.0 * shape.harmonics[1:41] * averaging(n, 0.05, 0.3171) * lagging(n, speed, 1e-3)
    start = np.angle(found[1] / expected[1]) / 2
    turned = expected * np.exp(1j * n * start)
    error = min(np.abs(found - turned).max(), np.abs(found - turned * np.exp(1j * n * np.pi)).max())
    assert error < 1e-4 * 1.41 * 5000.0


def test_a_noisy_run_averaged_over_its_turns_is_the_ring_within_its_noise():
    truth = bench_truth({})
    load, speed, duration, number, _ = RUNS["load_2000"]
    motion = bench_motion(truth, load, speed, duration, np.random.default_rng((1, number)))
    run = one({"runs": ["load_2000"]})
    R2 = divider_resistance(volts(run), 3.3, 1e4)
    turned = motion.angle[run.values("sample_index").astype(int)] + np.pi
    turn, angle = np.floor(turned / (2 * np.pi)).astype(int), turned % (2 * np.pi)
    shape = pressed(compliance(ring_of(truth)), truth.kt, truth.Ro, load).shape
    sensor = Sensor(truth.c, truth.R0, truth.flex_length, truth.flex_lag)
    rest = R2 - flex_shape(shape, sensor, truth.R, speed / truth.R).cut(120).at(angle - np.pi)
    turn -= turn[0]
    rest -= (np.bincount(turn, rest) / np.bincount(turn))[turn]
    whole = (turn > 0) & (turn < turn.max())
    place, M = (angle[whole] * (512 / (2 * np.pi))).astype(int), 512
    n = np.bincount(place, minlength=M)
    mean = np.bincount(place, rest[whole], M) / n
    variance = np.bincount(place, rest[whole] ** 2, M) / n - mean**2
    assert np.mean(mean**2 * n / variance) == pytest.approx(1.0, abs=0.2)


def test_film_over_flex_of_a_run_is_the_sheets_transfer():
    speed, rate = 20 / 3.6 / 0.3171, 12e3
    run = one({**STEADY, "runs": ["speed_20"], "duration": 2.0})
    R2 = divider_resistance(run.values("flex_voltage"), 3.3, 1e4)
    flex, film = (orders(v[2400:], speed, rate, 30) for v in (R2, run.values("pvdf_voltage")))
    n = np.arange(2, 31)
    expected = film_over_flex(
        n, speed, gain=2.4e-4, time_constant=2e-3, offset_angle=0.02, film_length=0.03, flex_length=0.05,
        flex_lag=1e-3, R=0.3171,
    )  # fmt: skip
    assert (film / flex)[1:] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(
    ("run", "km_h", "height"), [("speed_05", 5, 0.31), ("load_2000", 10, 0.60), ("speed_20", 20, 1.07)]
)
def test_the_film_grows_with_speed_as_the_sheet_says(run, km_h, height):
    values = volts(one({**STEADY, "as_voltage": False, "adc_bits": 12, "runs": [run], "duration": 3.0}), "pvdf")
    truth = bench_truth({})
    shape = pressed(compliance(ring_of(truth)), truth.kt, truth.Ro, 2000.0).shape
    seen = averaging(shape.orders, 0.03, truth.R) * high_pass(shape.orders, km_h / 3.6 / truth.R, 2e-3)
    _, V = shape.times(200.0 * 0.006 * seen).on_grid(8192)
    assert np.ptp(values) == pytest.approx(np.ptp(V), abs=2e-3)
    # The sheet's heights are 1 to 3 % lower than those of its own equations.
    assert np.ptp(V) == pytest.approx(height, rel=0.03)


def test_lag_and_high_pass_have_no_bias_of_their_time_constant():
    rate, tau = 12e3, 1e-3
    t = np.arange(24000) / rate
    for f in (5.0, 60.0):
        wave = np.exp(2j * np.pi * f * t)
        later = slice(12000, None)
        for filtered, expected in (
            (lagged(wave.real, rate, tau), 1 / (1 + 2j * np.pi * f * tau)),
            (high_passed(wave.real, rate, tau), 2j * np.pi * f * tau / (1 + 2j * np.pi * f * tau)),
        ):
            assert filtered[later] == pytest.approx((expected * wave).real[later], abs=2e-4 * abs(expected))
    assert lagged(np.full(9, 3.0), rate, tau) == pytest.approx(3.0)


def test_library_agrees_with_contacts_between_its_loads():
    truth = bench_truth({})
    ring = ring_of(truth)
    known = library(ring, truth.kt, truth.Ro, 0.05, 3000.0)
    theta = np.linspace(-3.1, 9.0, 900)
    sprung = compliance(ring)
    for Fz in (1130.0, 3370.0):
        shapes = [pressed(sprung, truth.kt, truth.Ro, Fz, Fx).shape for Fx in (0.0, 300.0)]
        k, driven = (s.times(averaging(s.orders, 0.05, ring.R)).at(theta) for s in shapes)
        full = np.full(theta.size, Fz)
        assert known.curvature(theta, full, 0.0 * full) == pytest.approx(k, abs=2e-4 * k.max())
        change = known.curvature(theta, full, 0.0 * full + 300.0) - known.curvature(theta, full, 0.0 * full)
        assert change == pytest.approx(driven - k, abs=0.02 * np.abs(driven - k).max())
    assert known.curvature(theta, 0.0 * theta, 0.0 * theta) == pytest.approx(0.0, abs=1e-9)


def test_the_campaign_holds_the_sheets_runs_with_conditions_and_is_repeatable():
    short = {"duration": 0.5}
    first, again, other = (synthesize_bench(short, seed) for seed in (1, 1, 2))
    assert [r.run for r in first] == list(RUNS)
    for a, b, c in zip(first, again, other, strict=True):
        load, speed, *_ = RUNS[a.run]
        assert a.conditions["nominal_load"] == load
        assert a.conditions["nominal_speed"] == speed
        assert set(a.streams) == {"device", "bench"}
        assert np.array_equal(a.values("flex_code"), b.values("flex_code"))
        assert not np.array_equal(a.values("road_speed"), c.values("road_speed"))


def test_each_table_has_its_own_clock():
    run = one({"runs": ["load_2000"], "loss": 0.0, "device_ppm": 1e4, "reference_ppm": -1e4, "reference_shift": 0.5,
               "duration": 5.0})  # fmt: skip
    device, bench = run.streams["device"], run.streams["bench"]
    assert device.time[-1] == pytest.approx(device.channels["sample_index"].values[-1] / 12e3, abs=1e-12)
    # A clock 1 % fast counts 5 s in 4.95 s; from 0.5 s on, one 1 % slow counts 4.41 s of that.
    assert bench.time[0] == 0.0
    assert bench.time[-1] == pytest.approx((5.0 / 1.01 - 0.5) * 0.99, abs=0.02)


def test_lost_packets_have_the_asked_share_and_length():
    lost = lost_packets(400_000, 0.03, 8.0, np.random.default_rng(5))
    assert lost.mean() == pytest.approx(0.03, rel=0.1)
    starts = np.flatnonzero(np.diff(lost.astype(int), prepend=0) == 1)
    assert lost.sum() / starts.size == pytest.approx(8.0, rel=0.1)
    assert not lost_packets(1000, 0.0, 5.0, np.random.default_rng(5)).any()


def test_counter_wraps_and_agrees_with_the_sample_index():
    run = one({"runs": ["load_2000"], "counter_bits": 10, "loss": 0.1, "duration": 4.0})
    index, counter = run.values("sample_index"), run.values("packet_counter")
    assert counter.max() == 1023.0
    assert (np.diff(counter) < 0).sum() >= 4
    packet = index // 10
    assert ((packet - counter) % 1024 == (packet - counter)[0] % 1024).all()
    assert 0.02 < 1.0 - index.size / 48000 < 0.25
    assert np.array_equal(index % 10, np.tile(np.arange(10.0), index.size // 10))


def test_a_gated_transmitter_sends_the_patch_and_little_else():
    run = one({"runs": ["load_2000"], "gated": True, "loss": 0.0, "duration": 6.0, "noise": 0.0})
    share = run.values("sample_index").size / 72000
    # The sheet: more than 30 mV from rest for 29 % of a turn.
    assert share == pytest.approx(0.29, abs=0.03)
    assert volts(run).max() > 2.07
    counted = one({"runs": ["load_2000"], "gated": True, "gated_counts": False, "loss": 0.0, "duration": 2.0})
    steps = np.diff(counted.values("packet_counter"))
    assert set(np.unique(steps)) <= {0.0, 1.0, -65535.0}


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_makes_a_run_that_differs_from_a_sound_one(name, monkeypatch):
    def told(recording):
        columns = {channel.name: channel.values.tobytes() for channel in recording}
        return {**columns, **recording.conditions}

    faulty = {"runs": [], "variants": [name], "duration": 13.0}
    bad = one(faulty)
    monkeypatch.setitem(VARIANTS, name, {})
    assert bad.run == f"bad_{name}"
    assert np.isfinite(bad.values("flex_code")).all()
    assert told(bad) != told(one(faulty))


def test_faults_show_in_the_log():
    base = {"runs": ["load_2000"], "duration": 3.0, "noise": 0.0, "loss": 0.0}
    rest = float(divider_voltage(np.asarray(1e4), 3.3, 1e4))
    assert volts(one(base)).max() == pytest.approx(2.079, abs=0.005)
    late = volts(one({**base, "debond_time": 1.5}))
    assert late[20000:].max() < 1.96 < late[:17000].max()
    assert volts(one({**base, "broken_time": 1.5}))[-1] > 3.29
    assert rest - volts(one({**base, "polarity": -1})).min() > 0.5
    assert rest - volts(one({**base, "divider_flipped": True})).min() == pytest.approx(2.079 - rest, abs=0.005)
    swapped = one({**base, "swapped": True})
    assert swapped.values("pvdf_code").max() == one(base).values("flex_code").max()
    clipped = one({**base, "film_gain": 1300.0}).values("pvdf_code")
    assert clipped.min() == 0.0
    assert clipped.max() == 4095.0
    assert volts(one({**base, "supply_sag": 0.1}))[-1] < 0.92 * rest
    assert one({**base, "load_scale": 1 / 9.80665}).values("vertical_load").mean() == pytest.approx(204, abs=2)
    assert one({**base, "speed_scale": 3.6}).values("road_speed").mean() == pytest.approx(10, abs=0.1)
    soft = one({**base, "inflation_pressure": 1.87e5, "told": {"inflation_pressure": 2.2e5}})
    assert soft.conditions["inflation_pressure"] == 2.2e5
    assert volts(soft).max() > 2.11
    mute = one({**base, "silence": (1.0, 2.0)}).streams["device"].time
    assert np.diff(mute).max() == pytest.approx(1.0, abs=0.002)
    assert "belt_width" not in one({**base, "told": {"belt_width": None}}).conditions


def test_guides_make_up_and_down_differ_and_the_beam_is_missing():
    runs = synthesize_bench(
        {"runs": ["load_2000", "load_2000_down"], "duration": 3.0, "guide_friction": 60.0, "beam_mass": 20.0}, 1
    )
    up, down = (r.values("vertical_load").mean() for r in runs)
    assert up - down == pytest.approx(120.0, abs=6.0)
    assert (up + down) / 2 == pytest.approx(2000.0 - 20 * 9.80665, abs=6.0)


def test_hub_height_and_rim_pulse_are_there_when_asked():
    run = one({"runs": ["load_2000"], "duration": 3.0, "hub_height": True, "wheel_index": True, "loss": 0.0})
    assert run.values("hub_height").mean() == pytest.approx(0.318311, abs=1e-4)
    turns = 3.0 * 10 / 3.6 / (2 * np.pi * 0.3171)
    assert run.values("wheel_index").sum() == pytest.approx(turns, abs=1.0)


def test_the_drive_has_the_sheets_forces_and_pulses():
    truth = road_truth({})
    motion = road_motion(truth, np.random.default_rng((1, truth.number)))
    assert motion.speed[0] * 3.6 == pytest.approx(30.0)
    assert motion.at("speed", 20.0) * 3.6 == pytest.approx(50.0, abs=0.01)
    assert motion.speed[-1] * 3.6 == pytest.approx(25.0, abs=0.01)
    assert motion.Fx.max() == pytest.approx(1126.0, abs=1.0)
    assert motion.Fx.min() == pytest.approx(-875.0, abs=1.0)
    assert motion.at("Fz", 12.0) - 3500.0 == pytest.approx(-238.0, abs=1.0)
    assert motion.at("Fz", 32.0) - 3500.0 == pytest.approx(264.0, abs=1.5)
    for centre, height in ((18.0, 600.0), (20.0, -500.0), (23.0, 450.0), (26.0, 200.0)):
        assert motion.at("Fz", centre) - 3500.0 == pytest.approx(height, abs=0.5)
    # 1.8 % high driving, 1.5 % low braking.
    speed = np.gradient(motion.angle, motion.time) * truth.R / motion.speed
    assert np.interp(12.0, motion.time, speed) == pytest.approx(1.0188, abs=2e-4)
    assert np.interp(32.0, motion.time, speed) == pytest.approx(0.9854, abs=2e-4)


def test_the_log_of_the_drive_has_both_tables_and_the_motion_that_is_known():
    short = {"duration": 6.0, "pulses": (), "speeds": ((0.0, 8.0), (2.0, 8.0), (4.0, 12.0))}
    (log,) = synthesize_road(short, 3)
    truth = road_truth(short)
    motion = road_motion(truth, np.random.default_rng((3, truth.number)))
    vehicle = log.streams["vehicle"]
    assert set(vehicle.channels) == {
        "vehicle_speed", "longitudinal_acceleration", "vertical_load", "longitudinal_force",
    }  # fmt: skip
    for name, quantity, sd in (("vehicle_speed", "speed", 0.02), ("longitudinal_force", "Fx", 5.0)):
        error = vehicle.channels[name].values - motion.at(quantity, vehicle.time)
        assert np.std(error) == pytest.approx(sd, rel=0.15)
    assert "longitudinal_force" not in synthesize_road({**short, "references": False}, 3)[0]


def test_driving_deepens_the_leading_dip_in_the_log_and_the_trailing_one_when_reversed():
    drive = {"duration": 4.0, "pulses": (), "speeds": ((0.0, 8.0), (0.2, 8.0), (4.0, 16.0)), "noise": 0.0, "loss": 0.0}
    for sign in (1, -1):
        (log,) = synthesize_road({**drive, "force_sign": sign}, 1)
        V = volts(log)[24000:36000]
        top = int(np.argmax(V))
        leading, trailing = V[max(top - 1500, 0) : top].min(), V[top : top + 1500].min()
        assert (trailing - leading > 0) == (sign > 0)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"kww": 1.0}, "no parameter 'kww'.*'kw'"),
        ({"runs": ["load_200"]}, "no run 'load_200'"),
        ({"variants": ["debonded"]}, "no variant 'debonded'.*'debond'"),
        ({"EI": 0.0}, "'EI' of the synthetic tire is 0.0; expected more than 0"),
        ({"loss": 1.5}, "'loss' is 1.5"),
        ({"duration": 1e6}, "up to 600 s"),
        ({"noise": "much"}, "'noise' of the synthetic tire is 'much'; expected a number"),
        ({"gated": 1.0}, "'gated' of the synthetic tire is 1.0; expected true or false"),
        ({"loads": [-5.0]}, "'loads' 0 N or more"),
        ({"silence": [1.0]}, "'silence' needs two numbers"),
    ],
)
def test_a_truth_that_makes_no_rig_is_refused(overrides, message):
    with pytest.raises(InputError, match=message):
        synthesize_bench(overrides, 1)


@pytest.mark.parametrize("overrides", [{"speeds": ((0.0,),)}, {"pulses": ((1.0, 2.0),)}, {"speeds": ((0.0, 0.0),)}])
def test_a_drive_that_makes_no_sense_is_refused(overrides):
    with pytest.raises(InputError, match=r"synthetic tire: .*needs"):
        road_truth(overrides)
