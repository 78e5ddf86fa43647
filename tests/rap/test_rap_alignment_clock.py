"""The device's clock against the bench's: lag, rate and poles of a synthetic rig whose clocks are known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.ingest.stamps import repair
from pipeline.rigs.rap.alignment.align import align
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.pair import Pair, pairs_of
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.alignment.stamps import evened, jitter
from pipeline.rigs.rap.alignment.unwrap import unwrapped
from pipeline.rigs.rap.synthetic.rig import synthesize_pressures
from pipeline.rigs.rap.tables import Signal, signal

ML_MIN = 1e-6 / 60.0
LAG, PPM, BENCH_POLE, POLE = 3.37, 40.0, 0.005, 0.030
SHORT = (("flows", (60 * ML_MIN, 100 * ML_MIN)), ("duration", 260.0), ("prot", False))


@cache
def pairs(seed: int = 1, *truth: tuple[str, object]) -> tuple[Pair, ...]:
    return pairs_of(synthesize_pressures(dict(SHORT) | dict(truth), seed)[0])


@cache
def usual() -> Alignment:
    return align(pairs(), BENCH_POLE)


def error(found: Alignment, lag: float = LAG, ppm: float = PPM) -> float:
    """Return by how much the clock is off in the middle of the run, s."""
    return found.clock.lag - lag - 1e-6 * ppm * found.clock.reference


def edited(device: Callable[[Signal], Signal], bench: Callable[[Signal], Signal] = lambda s: s) -> list[Pair]:
    return [Pair(p.name, device(p.device), bench(p.bench)) for p in pairs()]


def between(first: float, last: float) -> Callable[[Signal], Signal]:
    def cut(s: Signal) -> Signal:
        inside = (s.time > first) & (s.time < last)
        return Signal(s.name, s.time[inside], s.values[inside])

    return cut


def test_stamps_go_there_and_back():
    clock = Clock(300.0, -12.5, 80e-6)
    t = np.linspace(0.0, 600.0, 7)
    assert np.allclose(clock.to_device(clock.to_bench(t)), t, atol=1e-9)
    # The definition: t = t_d + lag + rate (t - reference).
    bench = clock.to_bench(t)
    assert np.allclose(bench, t + clock.lag + clock.rate * (bench - clock.reference), atol=1e-9)


def test_error_of_the_lag_grows_away_from_the_reference():
    clock = Clock(0.0, 1.0, 0.0, np.diag([1e-8, 1e-12]))
    assert float(clock.lag_sd_at(np.array(0.0))) == pytest.approx(1e-4)
    assert float(clock.lag_sd_at(np.array(300.0))) == pytest.approx(np.hypot(1e-4, 300e-6))
    assert float(clock.moved(300.0).lag_sd_at(np.array(0.0))) == pytest.approx(1e-4)


def test_lag_rate_and_pole_are_recovered_within_a_fraction_of_a_millisecond():
    found = usual()
    assert found.sure
    assert found.method == "harmonics"
    assert found.lag.std_error is not None
    assert found.lag.std_error < 3e-4
    assert abs(error(found)) < 4.0 * found.lag.std_error
    assert found.rate.value == pytest.approx(1e-6 * PPM, abs=4e-6)
    (pole,) = found.poles
    assert pole.at == {}
    assert pole.value == pytest.approx(POLE, abs=6e-4)


@pytest.mark.thorough
def test_errors_are_as_large_as_they_say_over_twenty_runs():
    z = []
    for seed in range(20):
        found = align(pairs(seed), BENCH_POLE)
        (pole,) = found.poles
        assert found.lag.std_error
        assert found.rate.value is not None
        assert found.rate.std_error
        assert pole.value is not None
        assert pole.std_error
        z.append(
            (
                error(found) / found.lag.std_error,
                (found.rate.value - 1e-6 * PPM) / found.rate.std_error,
                (pole.value - POLE) / pole.std_error,
            )
        )
    # Twenty squares of a standard normal sum up to 40 in one case of two hundred.
    assert np.all((np.array(z) ** 2).sum(axis=0) < 45.0)


@pytest.mark.parametrize(
    ("lag", "ppm", "extra"),
    [
        (-25.0, -100.0, ()),
        (28.0, 100.0, ()),
        (0.5, 0.0, (("device_rate", 50.0),)),
        (3.37, 40.0, (("device_rate", 10.0),)),
    ],
)
def test_other_clocks_and_rates_are_found(lag: float, ppm: float, extra: tuple[tuple[str, object], ...]):
    found = align(pairs(2, ("device_lag", lag), ("device_ppm", ppm), *extra), BENCH_POLE)
    assert found.sure
    assert abs(error(found, lag, ppm)) < 1e-3


def test_an_unstated_pole_of_the_bench_widens_lag_and_pole_and_is_told():
    found = align(pairs())
    assert found.lag.std_error is not None
    assert found.lag.std_error > 2e-3
    assert found.poles[0].std_error is not None
    assert found.poles[0].std_error > 1e-3
    assert not found.bench_pole_stated
    assert any("bench_sensor_time_constant" in p.message for p in found.problems)


def test_left_out_poles_would_shift_the_lag_by_their_difference():
    # Low-frequency delay of a pole is its time constant: the coarse lag, which knows no poles, is early by tau_d - tau_b.
    assert usual().coarse.lag - float(usual().clock.lag_at(np.array(usual().coarse.at))) == pytest.approx(
        BENCH_POLE - POLE, abs=5e-3
    )


def test_sensors_with_different_poles_are_told_apart():
    found = align(pairs(3, ("pole_access", 0.05), ("pole_prefilter", 0.09)), BENCH_POLE)
    poles = {p.at["channel"]: p.value for p in found.poles}
    assert poles["access"] == pytest.approx(0.05, abs=2e-3)
    assert poles["prefilter"] == pytest.approx(0.09, abs=2e-3)
    assert poles["return"] == pytest.approx(0.03, abs=2e-3)
    assert abs(error(found)) < 1e-3


def test_one_speed_only_is_ambiguous_by_whole_strokes():
    found = align(edited(between(25.0, 75.0), between(25.0, 80.0)), BENCH_POLE)
    assert not found.sure
    assert found.lag.value is None
    assert "ambiguous by n x stroke (0.7" in found.lag.reason
    assert "pump start" in found.lag.reason


def test_a_pump_start_in_one_speed_is_enough():
    found = align(edited(between(-1.0, 75.0), between(-1.0, 80.0)), BENCH_POLE)
    assert found.sure
    assert abs(error(found)) < 2e-3


def test_clocks_with_different_epochs_are_laid_over_each_other():
    found = align(edited(lambda s: Signal(s.name, s.time - 1.7e9, s.values)), BENCH_POLE)
    assert found.sure
    assert found.coarse.wide
    assert found.clock.lag - 1.7e9 == pytest.approx(LAG + 1e-6 * PPM * found.clock.reference, abs=1e-3)
    assert any("different moments" in p.message for p in found.problems)


def test_dropouts_and_gaps_only_cost_their_samples():
    kept = np.random.default_rng(0).random(pairs()[0].device.time.size) > 0.02
    kept[2000:2100] = False

    def holed(s: Signal) -> Signal:
        return Signal(s.name, s.time[kept], s.values[kept])

    found = align(edited(holed), BENCH_POLE)
    assert found.sure
    assert abs(error(found)) < 1e-3


def test_without_pulsation_steps_tell_the_lag_with_the_delay_of_the_sensors_in_its_error():
    found = align(edited(lambda s: Signal(s.name, s.time[::20], s.values[::20])), BENCH_POLE)
    assert found.method == "steps"
    assert found.sure
    assert found.lag.std_error is not None
    assert found.lag.std_error > 0.015
    assert abs(error(found)) < 3.0 * found.lag.std_error
    assert found.poles[0].value is None


def test_a_pressure_and_the_flow_meter_share_steps():
    run = synthesize_pressures(dict(SHORT), 1)[0]
    device, meter = signal(run, "pressure_access_rap"), signal(run, "blood_flow_bench")
    assert device is not None
    assert meter is not None
    found = align([Pair("access", device, meter, alike=False)])
    assert found.method == "steps"
    assert abs(error(found)) < 3.0 * (found.lag.std_error or 0.0)


def test_records_that_share_nothing_have_no_lag():
    rng = np.random.default_rng(1)
    found = align(edited(lambda s: Signal(s.name, s.time, 500.0 * rng.standard_normal(s.time.size))), BENCH_POLE)
    assert found.method == "none"
    assert not found.sure
    assert found.lag.value is None
    assert "same run" in found.lag.reason


def test_no_usable_pair_is_an_error_that_says_what_to_log():
    with pytest.raises(InputError, match="Log a pressure on both"):
        align([])


def test_a_flipped_channel_is_named_and_left_out():
    pairs_ = [
        Pair(p.name, p.device if p.name != "access" else Signal("a", p.device.time, -p.device.values), p.bench)
        for p in pairs()
    ]
    found = align(pairs_, BENCH_POLE)
    assert found.coarse.flipped == ("access",)
    assert abs(error(found)) < 1e-3
    assert any(p.channel == "access" and "sign" in p.message for p in found.problems)


def test_exchanged_channels_do_not_spoil_the_lag():
    by_name = {p.name: p for p in pairs()}
    pre, ret = by_name["prefilter"], by_name["return"]
    mixed = [
        by_name["access"],
        Pair("prefilter", ret.device, pre.bench),
        Pair("return", pre.device, ret.bench),
        by_name["uf"],
    ]
    found = align(mixed, BENCH_POLE)
    assert abs(error(found)) < 3e-3
    assert {p.channel for p in found.problems if p.level == "warning"} >= {"prefilter", "return"}


def test_taps_can_be_left_out():
    run = synthesize_pressures(dict(SHORT), 1)[0]
    assert [p.name for p in pairs_of(run, without=("uf", "access"))] == ["prefilter", "return"]


def test_jitter_goes_and_drift_stays_when_stamps_are_evened():
    rng = np.random.default_rng(3)
    even = 0.05 * (1.0 + 1e-4) * np.arange(5000)
    even[3000:] += 2.0
    shaken = even + 2e-3 * rng.standard_normal(even.size)
    assert np.std(evened(shaken) - even) < 2e-4
    assert jitter(shaken) == pytest.approx(2e-3, rel=0.05)
    assert np.array_equal(evened(shaken[:5]), shaken[:5])


def test_strokes_are_counted_through_a_drift_of_several_strokes():
    time = np.arange(0.0, 18000.0, 30.0)
    true = 0.1 + 100e-6 * (time - 20.0)
    stroke = np.full(time.size, 0.51)
    seen = (true + 0.255) % 0.51 - 0.255
    found = unwrapped(time, seen, np.full(time.size, 1e-3), stroke, 20.0, 0.1, 0.05)
    assert found.sure
    assert np.allclose(found.delay, true, atol=1e-9)


def test_strokes_behind_hours_without_pump_cannot_be_counted():
    time = np.r_[np.arange(0.0, 60.0, 15.0), np.arange(14400.0, 14460.0, 15.0)]
    found = unwrapped(time, np.zeros(8), np.full(8, 1e-3), np.full(8, 0.5), 0.0, 0.0, 0.05)
    assert not found.sure


def test_a_drift_over_hours_is_followed_from_the_start():
    run = synthesize_pressures(
        {"flows": (80 * ML_MIN,), "duration": 4000.0, "uf_flow": 0.0, "prot": False, "device_ppm": 190.0}, 1
    )[0]
    found = align(pairs_of(run)[:2], BENCH_POLE)
    assert found.sure
    assert found.rate.value == pytest.approx(190e-6, abs=1e-7)
    assert found.track is not None
    assert float(np.ptp(found.track.lag)) > 0.7


def test_stamps_of_whole_seconds_leave_lag_and_rate_open_as_far_as_they_do():
    run = synthesize_pressures(dict(SHORT), 4)[0]
    streams = dict(run.streams)
    mended = repair(np.floor(streams["device"].time), None, "r1.device.csv")
    streams["device"] = replace(streams["device"], time=mended.stamps)
    found = align(pairs_of(replace(run, streams=streams, quality=tuple(mended.findings)))[:2], BENCH_POLE)
    assert found.lag.ci95 is not None
    assert found.rate.ci95 is not None
    assert found.lag.ci95[0] < LAG + 1e-6 * PPM * found.clock.reference < found.lag.ci95[1]
    assert found.rate.ci95[0] < 1e-6 * PPM < found.rate.ci95[1]
    assert "steps of 1 s" in found.lag.reason
    # The samples themselves were even: pole and pulsation stand.
    (pole,) = found.poles
    assert pole.value == pytest.approx(POLE, abs=1e-3)


def test_lost_samples_leave_the_timer_its_grid():
    rng = np.random.default_rng(4)
    even = 0.05 * np.arange(4000)
    kept = rng.random(even.size) > 0.02
    stamps = (even + 2e-3 * rng.standard_normal(even.size))[kept]
    assert np.std(evened(stamps) - even[kept]) < 2e-4


def test_clock_that_is_set_within_the_run_has_no_one_lag():
    def ahead(s: Signal) -> Signal:
        return Signal(s.name, np.where(s.time > 130.0, s.time + 5.0, s.time), s.values)

    found = align(edited(ahead), BENCH_POLE)
    assert found.method == "none"
    assert not found.coarse.wide
    assert "steps by about" in found.lag.reason
