"""The synthetic therapies and cultures: volumes, temperatures, battery, alarms, samples (rap.md, section 6)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.rigs.rap.circuit.hydraulics import transmembrane
from pipeline.rigs.rap.circuit.tank import height_from_distance, up_vector
from pipeline.rigs.rap.synthetic.rig import synthesize_cytotoxicity, synthesize_therapy
from pipeline.rigs.rap.synthetic.therapy_truth import tank_of, therapy_truth

ML_MIN = 1e-6 / 60.0
MMHG = 133.322


def therapy(run: str, seed: int = 1, **truth: Any) -> Recording:
    (made,) = synthesize_therapy({"runs": [run], **truth}, seed)
    return made


@pytest.fixture(scope="module")
def long_run() -> Recording:
    return therapy("rap_therapy_312")


def test_long_therapy_has_the_rows_of_the_sheet(long_run: Recording) -> None:
    assert long_run.streams["device"].size == pytest.approx(375_000, rel=1e-3)
    assert long_run.streams["device_temperature"].size == 33
    assert long_run.streams["bench_temperature"].size == 33
    assert set(long_run.streams) == {
        "device", "device_status", "device_temperature", "bench", "bench_temperature", "scale", "events",
    }  # fmt: skip


@pytest.mark.thorough
def test_regulated_volume_ends_within_two_per_mille_and_unregulated_three_per_cent_short(long_run: Recording) -> None:
    closed = long_run.values("uf_mass_scale")[-30:].mean() / 1.004
    assert closed == pytest.approx(1.560, rel=2e-3)
    off = [therapy("rap_therapy_312", seed, closed_loop=False, prot=False) for seed in (1, 2, 3)]
    ends = [run.values("uf_mass_scale")[-30:].mean() / 1.004 / 1.560 for run in off]
    assert np.mean(ends) == pytest.approx(0.97, abs=0.012)


def test_first_echo_comes_when_the_blind_bottom_is_filled(long_run: Recording) -> None:
    t, valid = long_run.signal("uf_echo_valid")
    assert 1020.0 < t[np.argmax(valid > 0.0)] < 1090.0
    assert np.all(long_run.values("uf_level_distance")[valid == 0.0] == 0.0)


def test_levels_give_the_volume_of_the_scale_by_eq_8(long_run: Recording) -> None:
    truth = therapy_truth({})
    t, D = long_run.signal("uf_level_distance")
    up = up_vector(np.stack([long_run.values(f"tank_accel_{axis}") for axis in "xyz"], axis=1))
    up = np.tile(up_vector(up.mean(axis=0)), (t.size, 1))
    air_t, air = long_run.signal("temperature_air_bench")
    h = height_from_distance(tank_of(truth), D, up, np.interp(t + 3.37, air_t, air))
    scale_t, mass = long_run.signal("uf_mass_scale")
    volume = np.interp(t + 3.37 - 1.6, scale_t, mass) / 1004.0
    used = long_run.values("uf_echo_valid") > 0.0
    error = (tank_of(truth).area * h - volume)[used]
    close = np.abs(error) < 60e-6
    assert 1.0 - close.mean() == pytest.approx(0.02, abs=0.008)
    assert np.median(error[close]) == pytest.approx(0.0, abs=0.5e-6)
    assert error[close].std() == pytest.approx(8.5e-6, rel=0.2)


def test_membrane_pressure_rises_as_the_membrane_fouls(long_run: Recording) -> None:
    t = long_run.streams["bench"].time
    tmp = transmembrane(*(long_run.values(f"pressure_{tap}_bench") for tap in ("prefilter", "return", "uf")))
    command_t, command = long_run.signal("uf_pump_command")
    resistance = []
    for first, last in ((2000.0, 3000.0), (17000.0, 18000.0)):
        rate = 0.97 * command[(command_t > first) & (command_t < last)].mean()
        resistance.append(tmp[(t > first) & (t < last)].mean() / rate)
        grown = 1.0 + 0.25 * (0.5 * (first + last) - 20.0) / 18000.0
        # The gain of the pump wanders by 1 %.
        assert resistance[-1] * 2.0835e-11 == pytest.approx(grown, rel=0.03)
    assert resistance[1] > 1.15 * resistance[0]


def test_flow_falls_as_the_tube_wears(long_run: Recording) -> None:
    t, flow = long_run.signal("blood_flow_bench")
    early, late = flow[(t > 100.0) & (t < 700.0)].mean(), flow[(t > 18000.0) & (t < 18600.0)].mean()
    # Of the volume of a stroke, 0.9 mL is worn by 3 % and a ninth of the loss comes back with the lower back pressure.
    assert late / early - 1.0 == pytest.approx(-0.034, abs=0.004)


def test_temperatures_follow_eq_7_with_the_offset_of_the_device(long_run: Recording) -> None:
    t, bench = long_run.signal("temperature_air_bench")
    expected = 303.15 - 5.0 * np.exp(-t / 1200.0)
    assert np.std(bench - expected) == pytest.approx(0.058, abs=0.03)
    _, device = long_run.signal("temperature_air_rap")
    assert np.mean(device - expected) == pytest.approx(0.8, abs=0.15)


def test_battery_gives_the_mean_power_of_the_paper(long_run: Recording) -> None:
    power = long_run.values("battery_voltage") * long_run.values("battery_current")
    assert power.mean() == pytest.approx(13.9, rel=2e-3)
    left = long_run.values("battery_level")[-1]
    assert left == pytest.approx(1.0 - 13.9 * 18750.0 / (0.97 * 75.5 * 3600.0), abs=0.011)


def test_tank_in_motion_tilts_and_walks() -> None:
    run = therapy("rap_tank_motion")
    t = run.streams["device_status"].time
    assert t.size == pytest.approx(7200, abs=5)
    x, z = run.values("tank_accel_x"), run.values("tank_accel_z")
    walking = np.mod(t + 3.37, 600.0) >= 540.0
    assert np.std(z[walking]) == pytest.approx(1.5, rel=0.1)
    pitch = np.degrees(np.arctan2(x, z))[~walking]
    assert np.hypot(5.0 / np.sqrt(2.0), 3.0) == pytest.approx(pitch.std(), rel=0.1)
    assert "pressure_uf_rap" not in run
    assert run.values("uf_mass_scale")[:20].mean() == pytest.approx(0.3012, abs=0.004)


RATIOS = {
    (205.0, 228.0): "access high", (335.0, 358.0): "filter high", (465.0, 488.0): "return high", (595.0, 618.0): "return low",
    (725.0, 748.0): "access low", (860.0, 898.0): "membrane high",
}  # fmt: skip


def test_faults_show_in_the_ratio_that_is_theirs_and_in_no_other() -> None:
    run = therapy("rap_faults")
    t = run.streams["bench"].time
    p = {tap: run.values(f"pressure_{tap}_bench") for tap in ("access", "prefilter", "return", "uf")}
    flow = run.values("blood_flow_bench") / 1.004

    def ratios(first: float, last: float) -> dict[str, float]:
        on = (t > first) & (t < last)
        a, pre, ret, uf, Q = (v[on].mean() for v in (*p.values(), flow))
        Q_uf = 0.97 * 5.0 * ML_MIN
        return {
            "access": -a / (Q * 1.4e9), "filter": (pre - ret) / ((Q - 0.5 * Q_uf) * 1.2e9),
            "return": ret / ((Q - Q_uf) * 1.4e9), "membrane": transmembrane(pre, ret, uf) * 2.0835e-11 / Q_uf,
        }  # fmt: skip

    for (first, last), what in RATIOS.items():
        name, side = what.split()
        found = ratios(first, last)
        assert (found[name] > 1.6) if side == "high" else (found[name] < 0.5)
        assert all(0.5 < value < 1.6 for other, value in found.items() if other != name), what


def test_pauses_stop_the_pumps_and_the_long_one_becomes_an_alarm() -> None:
    run = therapy("rap_faults")
    t, flow = run.signal("blood_flow_bench")
    for first, last in ((1003.0, 1099.0), (1203.0, 1344.0)):
        assert abs(flow[(t > first) & (t < last)].mean()) < 5e-9
    events = run.streams["events"]
    codes, states = (events.channels[name].values for name in ("alarm_code", "therapy_state"))
    stagnation = events.time[list(codes).index("PROLONGED_STAGNATION")] + 3.37
    assert stagnation == pytest.approx(1320.05, abs=0.1)
    words = [word for word in states if word is not None]
    assert words == ["OFF", "SETUP", "PRIMING", "READY", "THERAPY", "PAUSE", "THERAPY", "PAUSE", "ALARM", "THERAPY"]


def test_an_alarm_that_acts_stops_the_pumps() -> None:
    truth = {"injections": [("AIR", 1360.0, 1370.0)], "episodes": [], "pauses": [], "fault_mismatches": []}
    run = therapy("rap_faults", **truth)
    t, flow = run.signal("blood_flow_bench")
    assert abs(flow[(t > 1364.0) & (t < 1374.0)].mean()) < 2e-8
    assert flow[(t > 1385.0) & (t < 1400.0)].mean() > 1e-6
    assert run.values("air_detected").sum() == pytest.approx(200, abs=2)


def test_cultures_have_the_samples_of_the_sheet() -> None:
    (run,) = synthesize_cytotoxicity({}, 1)
    cells = run.streams["cells"]
    assert cells.size == 24
    assert np.all(np.diff(cells.time) > 0.0)
    total = sum(run.values(name) for name in ("viability", "necrosis", "apoptosis"))
    assert np.allclose(total, 1.0)
    (many,) = synthesize_cytotoxicity({"replicates": 400, "control": "each", "loss": 0.1}, 1)
    treated = many.values("group") == "treated"
    late = many.streams["cells"].time > 21000.0
    drop = many.values("viability")[~treated & late].mean() - many.values("viability")[treated & late].mean()
    assert drop == pytest.approx(0.1, abs=0.008)
    (bare,) = synthesize_cytotoxicity({"control": "none"}, 1)
    assert set(bare.values("group")) == {"treated"}


def test_a_run_or_an_alarm_that_is_unknown_is_refused() -> None:
    with pytest.raises(InputError, match="no run 'rap_fault'"):
        therapy("rap_fault")
    with pytest.raises(InputError, match="Did you mean 'ACCESS_OCCLUDED'"):
        therapy("rap_faults", episodes=[("ACCESS_OCLUDED", 1.0, 2.0)])
