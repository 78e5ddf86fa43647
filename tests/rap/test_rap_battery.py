"""Energy and runtime: the paper's arithmetic, what the level alone tells, and what is refused."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.battery_account import PAPER_ENERGY, account

T = np.arange(18721.0)


def signal(name, values, time=T):
    return Signal(f"battery_{name}", time, np.broadcast_to(values, time.shape).astype(float).copy())


def logged(power=13.9, seed=0, time=T):
    rng = np.random.default_rng(seed)
    return (
        signal("voltage", 14.8 * (1 + 0.01 * rng.standard_normal(time.size)), time),
        signal("current", power / 14.8 * (1 + 0.01 * rng.standard_normal(time.size)), time),
    )


def test_the_papers_numbers():
    found = account(signal("voltage", 14.8), signal("current", 13.9 / 14.8), None, energy=75.5 * 3600.0, efficiency=1.0)
    assert found.used.value / 3600.0 == pytest.approx(72.28, abs=0.005)
    assert found.runtime.value / 3600.0 == pytest.approx(5.432, abs=0.001)
    assert found.required_efficiency == pytest.approx(0.921, abs=0.001)
    assert found.lasts
    assert found.time_left == pytest.approx(found.runtime.value - 18720.0, rel=1e-6)
    assert account(signal("voltage", 14.8), signal("current", 13.9 / 14.8), None, efficiency=0.9).runtime.value / 3600.0 == pytest.approx(4.89, abs=0.005)  # fmt: skip


def test_the_energy_is_covered():
    covered = []
    for seed in range(60):
        found = account(*logged(seed=seed), None, energy=PAPER_ENERGY, efficiency=0.97)
        covered.append(found.used.ci95[0] < 13.9 * 18720.0 < found.used.ci95[1])
    assert np.mean(covered) >= 0.88


def test_a_battery_that_does_not_last_is_told_by_the_number():
    found = account(*logged(20.0), None, energy=PAPER_ENERGY, efficiency=1.0)
    assert found.lasts is False
    assert "more than" in found.problems[-1].message
    assert found.time_left == 0.0


def test_energy_and_efficiency_that_are_not_stated_are_told():
    found = account(*logged(), None)
    assert "75.5 W h" in found.problems[0].message
    assert "without losses" in found.runtime.reason


def test_the_level_alone_is_as_good_as_its_gauge():
    level = signal("level", np.round(1.0 - 13.9 * T / PAPER_ENERGY, 2))
    found = account(None, None, level, energy=PAPER_ENERGY)
    assert found.source == "level"
    assert found.used.ci95[0] < 13.9 * 18720.0 < found.used.ci95[1]
    assert found.used.std_error > 100.0


def test_a_swapped_battery_is_taken_out_of_the_level():
    share = 1.0 - 13.9 * T / PAPER_ENERGY
    found = account(None, None, signal("level", np.where(T > 9000.0, share + 0.45, share)), energy=PAPER_ENERGY)
    assert found.used.value == pytest.approx(13.9 * 18720.0, rel=0.01)
    assert any("changed or charged" in p.message for p in found.problems)


def test_a_current_with_the_other_sign_is_understood_and_told():
    voltage, current = logged()
    found = account(voltage, Signal("battery_current", T, -current.values), None)
    assert found.used.value == pytest.approx(13.9 * 18720.0, rel=0.01)
    assert any("other sign" in p.message for p in found.problems)


def test_a_gap_is_bridged_and_told():
    keep = (T < 5000.0) | (T > 6000.0)
    voltage, current = (Signal(s.name, s.time[keep], s.values[keep]) for s in logged())
    found = account(voltage, current, None)
    assert found.used.value == pytest.approx(13.9 * 18720.0, rel=0.002)
    assert any("missing" in p.message for p in found.problems)


def test_nothing_or_half_is_refused_in_words():
    with pytest.raises(InputError, match="nothing is logged"):
        account(None, None, None)
    with pytest.raises(InputError, match="only battery_voltage"):
        account(signal("voltage", 14.8), None, None)


def test_no_power_projects_nothing():
    found = account(signal("voltage", 14.8), signal("current", 0.0), None)
    assert found.runtime.value is None


def test_a_battery_changed_within_the_run_is_told_beside_voltage_and_current():
    level = signal("level", np.where(T < 9000.0, 0.5 - T / 2e4, 1.0))
    found = account(*logged(), level, energy=PAPER_ENERGY, efficiency=0.97)
    assert any("changed or charged" in p.message for p in found.problems)
    assert found.source == "voltage and current"
