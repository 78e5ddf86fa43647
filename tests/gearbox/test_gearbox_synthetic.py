"""The logs of the synthetic gearbox: what its sensors add to the truth, and the faulty rigs (gearbox.md, section 6)."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.gearbox import cycle
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import FIXTURES, RPM, RUNS, gearbox_truth

G0 = 9.81


def log(**truth):
    return synthesize({"runs": ["g3"], **truth}, 5)[0]


def known(**truth):
    return next(known_runs(gearbox_truth({"runs": ["g3"], **truth}), 5))[0]


@pytest.fixture(scope="module")
def plain():
    return log(), known()


def residual(recording, run, channel):
    return recording.values(channel) - getattr(run.motion, channel)[::5]


def test_campaign_holds_the_eight_speeds_and_differs_from_seed_to_seed():
    campaign = synthesize({"vibration": False}, 0)
    assert [recording.run for recording in campaign] == list(RUNS)
    speeds = [recording.condition("speed_nominal") for recording in campaign]
    np.testing.assert_allclose(speeds, np.array([60, 90, 120, 120, 150, 180, 210, 240]) * RPM)
    again, other = synthesize({"runs": ["g1"]}, 0)[0], synthesize({"runs": ["g1"]}, 1)[0]
    torque = campaign[0].values("torque_in")
    np.testing.assert_array_equal(torque, again.values("torque_in"))
    assert not np.array_equal(torque, other.values("torque_in"))
    assert not np.array_equal(campaign[2].values("torque_in"), campaign[3].values("torque_in"))


def test_streams_have_the_rates_of_the_sheet_and_its_conditions(plain):
    recording, _ = plain
    assert {name: round(stream.rate) for name, stream in recording.streams.items()} == {
        "torque": 2000, "encoder": 125, "vibration": 2500,
    }  # fmt: skip
    assert recording.conditions["encoder_ppr"] == 128.0
    assert recording.conditions["inverter_frequency"] == pytest.approx(2.0)
    assert recording.conditions["torque_range_in"] == 10.0
    assert recording.conditions["teeth"] == "60 20 100; 12 44 100"


@pytest.mark.parametrize(("channel", "offset", "drift"), [("torque_in", 0.012, 0.012), ("torque_out", -0.008, 0.008)])
def test_standing_torque_sensor_shows_offset_white_noise_and_drift(channel, offset, drift):
    silent = log(duration=60.0, ramp_start=59.0, rundown_start=60.0)
    still = silent.values(channel)[: 59 * 2000]
    assert still.mean() == pytest.approx(offset, abs=4 * drift * np.sqrt(2 * 0.05 / 59.0))
    assert still.std() == pytest.approx(np.hypot(0.02, drift), rel=0.05)
    lagged = np.mean((still[:-100] - offset) * (still[100:] - offset))
    assert lagged == pytest.approx(drift**2 * np.exp(-1.0), abs=0.25 * drift**2)
    steps = still / (20.0 / 2**14)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


@pytest.mark.parametrize(
    ("channel", "theta", "ripple"), [("torque_in", "theta1", 0.03), ("torque_out", "theta2", 0.015)]
)
def test_ripple_turns_with_its_own_shaft_and_stops_with_it(plain, channel, theta, ripple):
    recording, run = plain
    rest, time = residual(recording, run, channel), recording.streams["torque"].time
    angle = getattr(run.motion, theta)[::5]
    for order, size in ((1, ripple), (2, 0.6 * ripple)):
        fos = (time > 5.0) & (time < 10.0)
        assert 2 * abs(np.mean(rest[fos] * np.exp(-1j * order * angle[fos]))) == pytest.approx(size, abs=0.002)
    still = time < 2.0
    assert rest[still].std() < 0.03


def test_counts_follow_the_output_shaft_within_one_count(plain):
    recording, run = plain
    turned = run.motion.theta2[::80] * 512 / (2 * np.pi)
    lag = recording.values("encoder_count_out") - turned
    assert lag.max() - lag.min() < 1.0 + 1e-9
    assert (np.diff(recording.values("encoder_count_out")) >= 0).all()


@pytest.mark.parametrize(("channel", "size"), [("acc_in_radial", 1.0), ("acc_out_axial", 0.3)])
def test_mesh_lines_stand_at_140_and_40_orders_of_the_input_and_only_while_slipping(plain, channel, size):
    recording, run = plain
    stream = recording.streams["vibration"]
    sos, fos = (stream.time > 11.0) & (stream.time < 19.0), (stream.time > 5.0) & (stream.time < 9.0)
    slip = run.motion.w1[round(15.0 / cycle.STEP)]
    angle = np.interp(stream.time, run.motion.time, run.motion.theta1 - run.motion.theta2)
    values = recording.values(channel)
    for order, part in ((140, 0.12), (280, 0.05), (40, 0.18), (80, 0.08)):
        amplitude = 2 * abs(np.mean(values[sos] * np.exp(-1j * order * angle[sos])))
        assert amplitude == pytest.approx(G0 * size * part * slip / 12.0, rel=0.1)
        locked = np.exp(-1j * order * run.speed * stream.time[fos])
        assert 2 * abs(np.mean(values[fos] * locked)) < 0.02
    at_rest = stream.time < 2.0
    assert values[at_rest].std() == pytest.approx(0.03 * G0, rel=0.05)


def test_lock_torque_scatters_by_one_percent_from_run_to_run():
    truth = gearbox_truth({"runs": ["g3"], "duration": 2.0})
    found = [next(known_runs(truth, seed))[0].lock_torque for seed in range(60)]
    assert np.mean(found) == pytest.approx(1.7835, rel=0.006)
    assert np.std(found) == pytest.approx(0.01 * 1.7835, rel=0.3)


@pytest.mark.parametrize("fixture", sorted(FIXTURES))
def test_every_fixture_makes_logs(fixture):
    recording = log(fixture=fixture)
    assert all(np.isfinite(channel.values).all() for channel in recording)
    assert all((np.diff(stream.time) > 0).all() for stream in recording.streams.values())


def test_x1_decoding_counts_a_quarter_at_16_ms(plain):
    recording = log(fixture="x1_decoding")
    assert recording.streams["encoder"].rate == pytest.approx(62.5)
    assert recording.conditions["encoder_decoding"] == 1.0
    counts = recording.values("encoder_count_out")[-1]
    assert counts == pytest.approx(plain[0].values("encoder_count_out")[-1] / 4, abs=1.0)


def test_swapped_torques_make_power(plain):
    recording = log(fixture="swapped_torques")
    np.testing.assert_array_equal(recording.values("torque_out"), plain[0].values("torque_in"))
    np.testing.assert_array_equal(recording.values("torque_in"), plain[0].values("torque_out"))


def test_gain_error_looks_like_the_sheet_though_the_box_loses_nothing_to_load(plain):
    run = known(fixture="gain_error")
    fos = round(9.9 / cycle.STEP)
    assert run.motion.torque_in[fos] == pytest.approx(plain[1].motion.torque_in[fos], abs=1e-6)
    assert run.motion.torque_out[fos] * 0.5443 == pytest.approx(plain[1].motion.torque_out[fos], abs=1e-6)
    recording = log(fixture="gain_error", noise=0.0, ripple_out=0.0, offset_out=0.0)
    assert recording.values("torque_out")[2000 * 9] == pytest.approx(0.55 * run.motion.torque_out[fos], abs=1e-3)


@pytest.mark.parametrize(("lost", "gap"), [(False, 0), (True, 1)])
def test_encoder_drops_out_for_four_tenths_of_a_second(plain, lost, gap):
    recording = log(fixture="encoder_dropout", dropout_lost=lost)
    time, counts = recording.signal("encoder_count_out")
    whole = plain[0].values("encoder_count_out")
    frozen = (time >= 7.0) & (time < 7.4 - 1e-9)
    assert np.ptp(counts[frozen]) == 0
    np.testing.assert_array_equal(counts[time < 7.0], whole[time < 7.0])
    missing = whole[-1] - counts[-1]
    assert missing == pytest.approx(gap * 0.392 * 2 * 512, abs=2.0)


def test_log_without_standstill_begins_with_a_turning_shaft():
    recording = log(fixture="no_standstill")
    time, counts = recording.signal("encoder_count_out")
    assert (time[0], counts[0]) == (0.0, 0.0)
    assert counts[time < 0.1][-1] > 5
    assert recording.values("torque_in")[:200].mean() > 0.8


def test_board_clocks_are_shifted_and_drift(plain):
    recording, run = log(fixture="board_clocks"), known()
    time, counts = recording.signal("encoder_count_out")
    stop = time[
        np.flatnonzero(np.diff(counts[(time > 9.0) & (time < 15.0)]))[-1] + 1 + np.searchsorted(time, 9.0, "right")
    ]
    assert stop == pytest.approx((run.events["sos_start"] - 0.3) * (1 + 200e-6), abs=0.03)
    lag = counts - np.interp(time / (1 + 200e-6) + 0.3, run.motion.time, run.motion.theta2) * 512 / (2 * np.pi)
    assert np.ptp(lag) < 1.0 + 1e-6
    assert recording.streams["vibration"].time[-1] == pytest.approx(30.0 * (1 - 200e-6), abs=1e-3)


def test_three_times_the_noise_is_three_times_the_scatter(plain):
    recording = log(fixture="three_times_noise")
    for channel in ("torque_in", "torque_out", "acc_in_radial"):
        still = slice(0, 3900)
        ratio = recording.values(channel)[still].std() / plain[0].values(channel)[still].std()
        assert ratio == pytest.approx(3.0, rel=0.03)


def test_logged_speed_is_a_staircase_of_whole_counts():
    recording = log(speed_only=True)
    speed = recording.values("speed_out")
    steps = speed / (2 * np.pi * 125 / 512)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert speed[
        (recording.streams["encoder"].time > 5) & (recording.streams["encoder"].time < 9)
    ].mean() == pytest.approx(120 * RPM, rel=2e-3)


def test_counts_on_a_faster_clock_are_held_until_the_next(plain):
    recording = log(encoder_log_rate=2000.0)
    time, counts = recording.signal("encoder_count_out")
    assert time.size == 60001
    np.testing.assert_array_equal(counts[::16], plain[0].values("encoder_count_out"))
    np.testing.assert_array_equal(counts[15:-1:16], counts[:-16:16])


def test_torque_beyond_the_span_saturates():
    recording = log(torque_span=3.0)
    peak = recording.values("torque_in").max()
    assert peak == pytest.approx(1.5, abs=1e-3)
    assert (recording.values("torque_in") == peak).sum() > 10


def test_offsets_change_and_signs_flip_on_request():
    recording = log(offset_change_in=0.1, gain_out=-1.0, vibration=False, duration=34.0)
    assert recording.values("torque_in")[-4000:].mean() == pytest.approx(0.109, abs=0.012)
    assert recording.values("torque_out")[2000 * 5 : 2000 * 9].mean() == pytest.approx(-0.308, abs=0.01)
    assert "vibration" not in recording.streams


def test_creeping_gears_show_a_mesh_line_while_locked():
    recording = log(creep=0.6)
    time, values = recording.signal("acc_in_radial")
    fos = (time > 5.0) & (time < 9.0)
    wave = np.exp(-1j * 40 * 0.6 * time[fos])
    assert 2 * abs(np.mean(values[fos] * wave)) == pytest.approx(G0 * 0.18 * 0.6 / 12.0, rel=0.3)


@pytest.mark.parametrize(("truth", "words"), [
    ({"enocder_ppr": 1}, "encoder_ppr"),
    ({"fixture": "weak_break"}, "weak_brake"),
    ({"runs": ["g9"]}, "g8"),
    ({"a": 1.2}, "transmit"),
    ({"J_L": 0.0}, "more than 0"),
    ({"J_L": "heavy"}, "a number"),
    ({"noise": -1.0}, "0 or more"),
    ({"encoder_decoding": 3}, "1, 2 or 4"),
    ({"brakes": [[10, 20]]}, "capacity"),
    ({"duration": 1e6}, "300 s"),
    ({"log_start": 40.0}, "after the end"),
    ({"encoder_jitter": 0.1}, "half a period"),
    ({"teeth": "60 20"}, "60 20 100"),
    ({"speeds": [0.0]}, "rad/s"),
])  # fmt: skip
def test_truth_that_makes_no_rig_is_refused_in_plain_words(truth, words):
    with pytest.raises(InputError, match=words):
        synthesize(truth, 0)
