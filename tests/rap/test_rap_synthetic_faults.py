"""Each fault of the synthetic rig does to the logs what its name says (rap.md, sections 6 and 8)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.recording import Recording
from pipeline.rigs.rap.synthetic.faults import FAULTS
from pipeline.rigs.rap.synthetic.rig import synthesize_pressures, synthesize_therapy

ML_MIN = 1e-6 / 60.0
SHORT = {"flows": [80.0 * ML_MIN], "duration": 200.0}


def pressures(*faults: Any, **truth: Any) -> Recording:
    (run,) = synthesize_pressures({**SHORT, **truth, "faults": list(faults)}, 1)
    return run


def therapy(*faults: Any) -> Recording:
    (run,) = synthesize_therapy({"runs": ["rap_therapy_312"], "duration": 5400.0, "faults": list(faults)}, 1)
    return run


@pytest.fixture(scope="module")
def sound() -> Recording:
    return pressures()


def test_swapped_channels_change_places(sound: Recording) -> None:
    run = pressures("swapped")
    assert np.array_equal(run.values("pressure_prefilter_rap"), sound.values("pressure_return_rap"))
    assert np.array_equal(run.values("pressure_return_rap"), sound.values("pressure_prefilter_rap"))


@pytest.mark.parametrize(
    ("kind", "channel", "times"),
    [("sign", "pressure_access_rap", -1.0), ("mmhg", "pressure_uf_rap", 1 / 133.322), ("kpa", "pressure_uf_rap", 1e-3)],
)
def test_signs_and_units_scale_the_channel(sound: Recording, kind: str, channel: str, times: float) -> None:
    run = pressures(kind)
    assert np.allclose(run.values(channel), times * sound.values(channel))
    assert np.array_equal(run.values("pressure_uf_bench"), sound.values("pressure_uf_bench"))


def test_stuck_channel_stands_from_its_start(sound: Recording) -> None:
    run = pressures("stuck")
    t, stuck = run.signal("pressure_uf_rap")
    assert np.ptp(stuck[t >= 100.0]) == 0.0
    assert np.array_equal(stuck[t < 100.0], sound.values("pressure_uf_rap")[t < 100.0])


def test_saturated_channel_stays_at_its_rail(sound: Recording) -> None:
    run = pressures("saturated")
    assert run.values("pressure_prefilter_rap").max() == 3500.0
    assert sound.values("pressure_prefilter_rap").max() > 3500.0


def test_zero_not_taken_shows_at_rest() -> None:
    t, values = pressures("zero_not_taken").signal("pressure_uf_rap")
    assert values[t < 10.0].mean() == pytest.approx(270.0, abs=10.0)


@pytest.mark.parametrize(("kind", "change"), [("dropout", -40), ("duplicated", 40), ("truncated", None)])
def test_rows_are_lost_doubled_and_cut(sound: Recording, kind: str, change: int | None) -> None:
    start = 100.0 if kind == "truncated" else 150.0
    run = pressures({"kind": kind, "start": start})
    time = run.streams["device"].time
    assert np.all(np.diff(time) > 0.0)
    if change is None:
        assert max(stream.time[-1] for stream in run.streams.values()) < 100.0
    else:
        assert time.size - sound.streams["device"].size == pytest.approx(change, abs=1)
        assert run.streams["bench"].size == sound.streams["bench"].size


def test_missing_channel_is_not_there() -> None:
    assert "blood_flow_bench" not in pressures("missing")
    assert not any(c.name.endswith("_bench") for c in pressures({"kind": "missing", "channel": "*_bench"}))


def _line(run: Recording, channel: str, f: float, first: float, last: float) -> float:
    t, y = run.signal(channel)
    on = (t > first) & (t < last)
    hann = np.hanning(int(on.sum()))
    return float(2.0 * abs(np.sum(hann * y[on] * np.exp(-2j * np.pi * f * t[on]))) / hann.sum())


def test_air_bubble_softens_the_pulsation_of_the_circuit_and_air_at_the_sensor_that_of_one_channel() -> None:
    f = 1.957713
    quiet: dict[str, Any] = {"speed_scatter": 0.0}
    plain, bubble = (pressures(*kind, **quiet) for kind in ([], ["air_bubble"]))
    dulled = pressures({"kind": "air_at_sensor", "start": 60.0}, **quiet)
    amplitude = [_line(run, "pressure_prefilter_rap", f, 60.0, 100.0) for run in (plain, bubble, dulled)]
    return_line = [_line(run, "pressure_return_rap", f, 60.0, 100.0) for run in (plain, bubble, dulled)]
    assert amplitude[1] < 0.9 * amplitude[0]
    assert return_line[1] < 0.9 * return_line[0]
    assert amplitude[2] < 0.6 * amplitude[0]
    assert return_line[2] == pytest.approx(return_line[0], rel=1e-9)


def test_folded_line_falls_when_the_pump_speeds_up() -> None:
    def peak(flow: float) -> float:
        run = pressures("aliasing", flows=[flow * ML_MIN], speed_scatter=0.0)
        t, y = run.signal("pressure_uf_rap")
        y = y[(t > 30.0) & (t < 100.0)]
        power = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(y.size))) ** 2
        f = np.fft.rfftfreq(y.size, 0.05)
        return float(f[np.argmax(np.where(f > 3.0, power, 0.0))])

    assert peak(80.0) == pytest.approx(20.0 - 8 * 1.9577, abs=0.05)
    assert peak(85.0) < peak(80.0) - 0.8


def test_blood_pump_stands_while_ultrafiltrate_is_taken() -> None:
    run = pressures("uf_without_blood")
    t, flow = run.signal("blood_flow_bench")
    assert abs(flow[(t > 110.0) & (t < 128.0)].mean()) < 1e-8
    t, uf = run.signal("uf_flow_set")
    assert np.all(uf[(t > 110.0) & (t < 125.0)] > 0.0)


def test_mismatch_of_the_units_is_a_step_and_a_drift() -> None:
    run = pressures(mismatches=[("access", 60.0, 80.0, 500.0, 0.0), ("return", 60.0, 160.0, 0.0, 5.0)])
    t = run.streams["device"].time + 3.37
    off = {tap: run.values(f"pressure_{tap}_prot") - run.values(f"pressure_{tap}_rap") for tap in ("access", "return")}
    assert off["access"][(t > 62.0) & (t < 78.0)].mean() == pytest.approx(500.0, abs=10.0)
    assert off["access"][(t > 82.0) & (t < 98.0)].mean() == pytest.approx(0.0, abs=10.0)
    assert off["return"][(t > 150.0) & (t < 158.0)].mean() == pytest.approx(470.0, abs=10.0)


@pytest.mark.parametrize("key", [True, False])
def test_drained_tank_restarts_only_where_the_key_was_pressed(key: bool) -> None:
    run = therapy({"kind": "drain", "key": key})
    t, mass = run.signal("uf_mass_scale")
    assert np.interp(3660.0, t, mass) < 0.02
    assert np.interp(3580.0, t, mass) > 0.28
    t, taken = run.signal("uf_volume_rap")
    assert (np.interp(3650.0, t, taken) < 0.02e-3) == key
    assert ("drain_pressed" in run) == key


def test_echo_is_lost_and_tilt_misleads_the_level() -> None:
    t, valid = therapy("echo_lost").signal("uf_echo_valid")
    assert valid[(t > 3610.0) & (t < 4180.0)].sum() == 0.0
    run = therapy("tilt")
    t, z = run.signal("tank_accel_z")
    x = run.values("tank_accel_x")
    tilt = np.degrees(np.arctan2(x, z))
    assert tilt[(t > 3610.0) & (t < 3880.0)].mean() == pytest.approx(16.5, abs=0.5)


def test_scale_is_touched_and_drifts() -> None:
    sound, touched, drifting = therapy(), therapy("scale_touched"), therapy("scale_drift")
    t, mass = sound.signal("uf_mass_scale")
    off = touched.values("uf_mass_scale") - mass
    assert off[(t >= 3000.0) & (t < 3030.0)] == pytest.approx(0.2)
    assert np.all(off[t > 3031.0] == 0.0)
    assert (drifting.values("uf_mass_scale") - mass)[-1] == pytest.approx(0.02 * t[-1] / 3600.0, rel=1e-3)


def test_every_kind_of_fault_is_tried_here() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    assert [kind for kind in FAULTS if f'"{kind}"' not in text and kind != "unit"] == []
