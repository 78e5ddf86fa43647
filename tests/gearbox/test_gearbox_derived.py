import math

import numpy as np
import pytest

from pipeline.rigs.gearbox.torques.derived import Torque, difference, power, power_assumed, ratio, share

IN, OUT = 0.012, 0.009
"""Errors of the zero of either sensor, N m: large, so that a correlation forgotten shows."""


def measured(rng, true, own, zero, zero_sd):
    return Torque(true + own * rng.standard_normal() + zero, own, zero_sd, math.inf)


def drawn(seed):
    """Nominal and peak torques of one run, both zeros off by one draw each."""
    rng = np.random.default_rng(seed)
    zero_in, zero_out = IN * rng.standard_normal(), OUT * rng.standard_normal()
    return {
        "peak": measured(rng, 2.18, 0.02, zero_in, IN), "sos": measured(rng, 1.407, 0.003, zero_in, IN),
        "fos": measured(rng, 0.938, 0.003, zero_in, IN), "fos_out": measured(rng, 0.300, 0.002, zero_out, OUT),
        "sos_out": measured(rng, 0.556, 0.002, zero_out, OUT), "peak_out": measured(rng, 0.978, 0.012, zero_out, OUT),
    }  # fmt: skip


CASES = {
    "relief": (lambda t: share("s", t["sos"], t["peak"], "", residual=False), 1 - 1.407 / 2.18),
    "residual": (lambda t: share("s", t["sos"], t["peak"], "", residual=True), 1.407 / 2.18),
    "relief out": (lambda t: share("s", t["sos_out"], t["peak_out"], "", residual=False), 1 - 0.556 / 0.978),
    "drop": (lambda t: difference("d", t["peak"], t["sos"], ""), 2.18 - 1.407),
    "difference of levels": (lambda t: difference("d", t["sos"], t["fos"], ""), 1.407 - 0.938),
    "efficiency": (lambda t: ratio("r", t["fos_out"], t["fos"], ""), 0.300 / 0.938),
    "torque ratio": (lambda t: ratio("r", t["sos_out"], t["sos"], ""), 0.556 / 1.407),
    "power": (lambda t: power("p", t["sos"], 12.38, 0.001, ""), 1.407 * 12.38),
}


@pytest.mark.parametrize("case", CASES)
def test_intervals_of_derived_numbers_cover_with_the_zero_common_to_all_torques_of_a_sensor(case):
    found, true = CASES[case]
    held = [found(drawn(seed)).ci95 for seed in range(1500)]
    assert 0.935 < np.mean([low <= true <= high for low, high in held]) < 0.965


def test_a_difference_does_not_know_the_zero_and_a_share_hardly_does():
    torques = drawn(0)
    assert difference("d", torques["sos"], torques["fos"], "").std_error == pytest.approx(math.hypot(0.003, 0.003))
    both = share("s", torques["sos"], torques["peak"], "", residual=True).std_error
    as_if_apart = math.hypot(math.hypot(0.003, IN) / 2.18, 1.407 / 2.18**2 * math.hypot(0.02, IN))
    assert both < as_if_apart


def test_the_power_at_an_assumed_speed_is_an_upper_limit_with_room_for_the_drives_droop():
    torque = Torque(1.407, 0.003, 0.003, 20.0)
    found = power_assumed("p", torque, 12.566, "")
    assert found.value == pytest.approx(1.407 * 12.566)
    for droop in (0.0, 0.0137, 0.1, 0.3):
        assert found.ci95[0] <= 1.407 * 12.566 * (1 - droop) <= found.ci95[1]
    assert found.ci95[1] - found.value < 0.02 * found.value
    assert power_assumed("p", None, 12.566, "there is no SOS").value is None


def test_what_noise_adds_to_a_peak_shifts_the_interval_and_not_the_number():
    peak, level = Torque(1.42, 0.03, 0.003, math.inf, bias=0.02), Torque(0.94, 0.003, 0.003, math.inf)
    excess = difference("d", peak, level, "")
    assert excess.value == pytest.approx(0.48)
    assert np.mean(excess.ci95) == pytest.approx(0.46)
    residual, relief = (share("s", level, peak, "", residual=each) for each in (True, False))
    assert np.mean(residual.ci95) == pytest.approx(0.94 / 1.40, rel=1e-3)
    assert np.mean(relief.ci95) == pytest.approx(1 - np.mean(residual.ci95))
