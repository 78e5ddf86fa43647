"""K_0 and a of the membrane: covered although the errors hang together, doubted on saline, refused where nothing tells them."""

import numpy as np
import pytest
from tank_runs import tank_run

from pipeline.errors import InputError
from pipeline.rigs.rap.circuit.membrane import coefficient, water_viscosity
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.membrane_decline import decline
from pipeline.rigs.rap.therapy.pump_gain import mean_gain
from pipeline.rigs.rap.therapy.transmembrane import transmembrane

K_0 = 2.0835e-11


def pressures(run, a=0.25, offsets=(80.0, 40.0, -30.0), seed=0, start=60.0):
    rng = np.random.default_rng(seed + 900)
    K = coefficient(np.maximum(run.t - start, 0.0), K_0, a)
    tmp = run.gain * run.asked / K
    shares = {"prefilter": 0.5, "return": 0.5, "uf": -0.5}
    return [
        Signal(f"pressure_{tap}_rap", run.t, share * tmp + off + 8.0 * rng.standard_normal(run.t.size))
        for (tap, share), off in zip(shares.items(), offsets, strict=True)
    ]


def membrane(run, a=0.25, seed=0, **settings):
    found = transmembrane(*pressures(run, a, seed=seed), zero_spans=[(0.0, 60.0)], gains={"uf": 1.0})
    return decline(found, mean_gain(run.course(), run.command).posterior, run.command, **settings)


@pytest.mark.thorough
def test_the_intervals_hold_the_truth_over_many_runs():
    covered, values = [], []
    for seed in range(40):
        found = membrane(tank_run(seed, minutes=130), a=0.25, seed=seed)
        ends = [found.initial.ci95, found.decline.ci95]
        covered.append([low < true < high for (low, high), true in zip(ends, (K_0, 0.25), strict=True)])
        values.append([found.initial.value / K_0, found.decline.value])
    assert np.all(np.mean(covered, axis=0) >= 0.88)  # 40 tries of 95 % are 38 +- 1.4
    assert np.mean(values, axis=0) == pytest.approx([1.0, 0.25], abs=0.005)


def test_the_long_run_is_as_good_as_the_sheet_says_and_naive_errors_are_far_too_small():
    found = membrane(tank_run(3, minutes=312, V0=0.1e-3))
    assert found.initial.value == pytest.approx(K_0, rel=0.008)
    assert found.decline.value == pytest.approx(0.25, abs=0.012)
    assert found.decline.std_error < 0.008
    assert found.naive_sd < found.decline.std_error / 2.0
    assert found.excludes_zero
    assert np.nanmean((found.k > found.band[:, 0] * 0.97) & (found.k < found.band[:, 1] * 1.03)) > 0.9


def test_a_decline_on_saline_is_doubted_with_what_would_look_alike():
    found = membrane(tank_run(3, minutes=200))
    text = found.problems[0].message
    assert "cannot foul" in text
    assert "10.0 K cooler" in text or "K cooler" in text
    assert "Pa in 5 h" in text
    on_blood = membrane(tank_run(3, minutes=200), fluid="medium")
    assert on_blood.problems == ()


def test_no_decline_is_no_decline():
    told = [membrane(tank_run(s, minutes=150), a=0.0, seed=s).excludes_zero for s in range(20, 32)]
    assert np.sum(told) <= 2


@pytest.mark.parametrize("a", [0.0, 0.25])
def test_a_short_run_gives_the_start_with_what_the_slope_leaves_open_and_no_decline(a):
    found = membrane(tank_run(2, minutes=60), a=a)
    assert found.decline.value is None
    assert "2 h" in found.decline.reason
    assert found.initial.ci95[0] < K_0 < found.initial.ci95[1]


def test_zeros_are_taken_at_rest_and_told_where_there_is_none():
    run = tank_run(1, minutes=30)
    zeroed = transmembrane(*pressures(run), zero_spans=[(0.0, 60.0)])
    assert zeroed.zeros["prefilter"] == pytest.approx(80.0, abs=3.0)
    assert zeroed.offset_u < 3.0
    raw = transmembrane(*pressures(run))
    assert np.mean(raw.tmp - zeroed.tmp) == pytest.approx(90.0, abs=3.0)
    assert raw.offset_u == pytest.approx(73.5, abs=0.5)
    assert "no rest" in raw.problems[0].message
    assert raw.gain_u == 0.01
    assert transmembrane(*pressures(run), gains={"uf": 1.01}).gain_u == 0.0


def test_an_unknown_zero_widens_the_coefficient():
    run = tank_run(1, minutes=150)
    gain = mean_gain(run.course(), run.command).posterior
    found = decline(transmembrane(*pressures(run)), gain, run.command)
    assert found.initial.ci95[0] < K_0 < found.initial.ci95[1]
    assert found.initial.std_error > 0.015 * K_0
    assert "type B" in found.initial.reason


def test_occlusions_and_pauses_take_no_part():
    run = tank_run(1, minutes=150, pause=(3000.0, 3400.0))
    signals = pressures(run)
    signals[2].values[6000:6300] -= 4000.0
    found = decline(
        transmembrane(*signals, zero_spans=[(0.0, 60.0)], gains={"uf": 1.0}), mean_gain(run.course(), run.command).posterior, run.command
    )  # fmt: skip
    assert found.decline.value == pytest.approx(0.25, abs=0.05)
    assert not found.used[(found.time > 6060.0) & (found.time < 6240.0)].any()
    assert not found.used[(found.time > 3060.0) & (found.time < 3340.0)].any()


def test_a_cooling_fluid_is_taken_out_by_its_viscosity():
    run = tank_run(1, minutes=200)
    T = np.linspace(303.15, 298.15, run.t.size)
    K = 1.0 / water_viscosity(T)
    tmp = run.gain * run.asked / (K * K_0 / K.mean())
    rng = np.random.default_rng(4)
    signals = [Signal(n, run.t, s * tmp + 8.0 * rng.standard_normal(run.t.size)) for n, s in (("a", 0.5), ("b", 0.5), ("c", -0.5))]  # fmt: skip
    found = transmembrane(*signals, zero_spans=[(0.0, 60.0)], gains={"uf": 1.0})
    gain = mean_gain(run.course(), run.command).posterior
    assert decline(found, gain, run.command).decline.value > 0.1
    assert not decline(found, gain, run.command, fluid_temperature=(run.t, T)).excludes_zero


def test_no_ultrafiltration_is_refused():
    run = tank_run(1, minutes=30, start=1e6)
    with pytest.raises(InputError, match="never runs"):
        decline(transmembrane(*pressures(run)), None, run.command)


def test_without_a_level_the_command_is_taken_to_fifteen_per_cent():
    run = tank_run(1, minutes=150)
    found = decline(transmembrane(*pressures(run), zero_spans=[(0.0, 60.0)], gains={"uf": 1.0}), None, run.command)
    assert found.initial.std_error / found.initial.value == pytest.approx(0.15, rel=0.1)


def test_a_rate_that_may_be_off_is_in_the_error_of_k_0_and_one_that_changes_in_that_of_the_decline():
    run = tank_run(3, minutes=200)
    ends = np.array([0.0, 12000.0])
    plain, off, changing = (
        membrane(run, rate_error=error) for error in (None, (ends, np.full(2, 0.1)), (ends, np.array([0.0, 0.1])))
    )
    assert off.initial.std_error == pytest.approx(np.hypot(plain.initial.std_error, 0.1 * K_0), rel=0.02)
    assert off.decline.std_error == pytest.approx(plain.decline.std_error, rel=0.2)
    # 10 % more of a rate within 200 min are a change of about 15 % in 5 h.
    assert changing.decline.std_error > 0.12


@pytest.mark.parametrize("rest_shows_it", [True, False])
def test_the_proteins_of_blood_are_taken_off_once(rest_shows_it):
    run = tank_run(3, minutes=140)
    prefilter, back, uf = pressures(run, 0.0)
    drawn = 3333.0 * np.ones(run.t.size) if rest_shows_it else 3333.0 * (run.t >= 60.0)
    uf = Signal(uf.name, uf.time, uf.values - drawn)
    pressure = transmembrane(prefilter, back, uf, zero_spans=[(0.0, 60.0)], gains={"uf": 1.0})
    found = decline(pressure, mean_gain(run.course(), run.command).posterior, run.command, fluid="blood")
    assert found.initial.ci95[0] < K_0 < found.initial.ci95[1]
    assert found.initial.value == pytest.approx(K_0, rel=0.03)
    assert (found.initial.std_error > 0.05 * K_0) != rest_shows_it
