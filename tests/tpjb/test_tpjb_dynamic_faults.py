"""Faults of section 8 in dynamic logs: named, dealt with, and never a number outside its interval."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from dynamic_logs import changed, conditions, found_in, logs, messages, without, worst_z

from pipeline.errors import InputError
from pipeline.recording import Recording

ACC = ("acc_ua", "acc_ub", "acc_va", "acc_vb")
GAP = tuple(f"gap_{axis}{side}{plane}" for plane in "12" for axis in "uv" for side in "pm")


def scaled(runs: list[Recording], names: tuple[str, ...], factor: float) -> list[Recording]:
    for name in names:
        runs = [changed(r, name, lambda _, v: factor * v) for r in runs]
    return runs


def stuck(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    values[(time > 12) & (time < 19)] = values[0]
    return values


def spike(_: np.ndarray, values: np.ndarray) -> np.ndarray:
    values[12_345] += 5e-4
    return values


def cut(share: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return lambda _, values: np.minimum(values, np.quantile(values, share))


def cut_once(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    first = time < 3.0  # the first block, further off than the others
    values[first] += 2e-4
    return np.minimum(values, np.quantile(values[first], 0.95))


def silenced(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    turning = np.exp(2j * np.pi * 13 * time)
    return values - (2 * np.mean(values * turning.conj()) * turning).real


def mended(runs: list[Recording], name: str, change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> list[Recording]:
    return [changed(r, name, change) for r in runs]


DEALT_WITH = {
    "rows lost": (lambda: logs(1, missing=1e-3), "ok", ""),
    "jitter": (lambda: logs(1, jitter=1e-5), "ok", ""),
    "no speed": (lambda: [without(r, "speed") for r in logs(1)], "ok", "no 'speed' channel"),
    "a nominal speed that is 0.4 % off": (
        lambda: [conditions(without(r, "speed"), shaft_speed_nominal=105.1) for r in logs(1)],
        "ok",
        "followed by the phase of its own line",
    ),
    "no speed, no nominal": (
        lambda: [conditions(without(r, "speed"), shaft_speed_nominal=None) for r in logs(1)],
        "warning",
        "Give the shaft speed",
    ),
    "one accelerometer an axis": (
        lambda: [without(r, "acc_ub", "acc_vb") for r in logs(1)],
        "ok",
        "only accelerometer",
    ),
    "one accelerometer in g": (lambda: scaled(logs(1), ("acc_ua",), 1 / 9.80665), "warning", "in g but read as m/s"),
    "empty probe": (lambda: mended(logs(1), "gap_up1", lambda _, v: v * np.nan), "warning", "no number"),
    "a tone that was never sent": (
        lambda: [conditions(r, excitation_tones="7 9 11 13 19 23 29 37 43 Hz") for r in logs(1)],
        "warning",
        "9 Hz: force below",
    ),
    "spike": (lambda: [changed(logs(1)[0], "gap_up1", spike), logs(1)[1]], "warning", "a spike"),
    "probe clipped once": (
        lambda: [changed(logs(1)[0], "gap_up1", cut_once), logs(1)[1]],
        "warning",
        "is clipped in 1 of",
    ),
    "accelerometer clipped": (lambda: mended(logs(1), "acc_va", cut(0.98)), "warning", "acc_vb alone serves"),
    "modes exchanged": (
        lambda: [conditions(r, mode=m) for r, m in zip(logs(1), ("antiphase", "in-phase"), strict=True)],
        "warning",
        "the forces are believed",
    ),
    "an unknown mode": (
        lambda: [conditions(logs(1)[0], mode="in_phase2"), logs(1)[1]],
        "warning",
        "mode 'in_phase2' is not known. Did you mean 'in_phase'?",
    ),
    "no stabiliser stiffness": (
        lambda: [conditions(r, stabilizer_stiffness=0.0) for r in logs(1, bench={"stabilizer_stiffness": 0.0})],
        "ok",
        "",
    ),
    "stator mass 25 % low": (lambda: [conditions(r, stator_mass=675.0) for r in logs(1)], "warning", "heavier than"),
    "stator mass not taken off": (lambda: [conditions(r, stator_mass=0.0) for r in logs(1)], "warning", "heavier than"),
}
NOT_TOLD = {
    "in-phase only": (lambda: logs(1)[:1], "in-phase (10 blocks)"),
    "acceleration inverted": (lambda: scaled(logs(1), ACC, -1.0), "wrong sign"),
    "one force in kN": (lambda: scaled(logs(1), ("force_u",), 1e-3), "its force in another unit"),
    "pair clipped": (lambda: mended(mended(logs(1), "gap_up1", cut(0.97)), "gap_um1", cut(0.97)), "clipped, too"),
    "no stator mass": (lambda: [conditions(r, stator_mass=None) for r in logs(1)], "'stator_mass' is not given"),
}


@pytest.mark.parametrize("fault", DEALT_WITH)
def test_faults_that_are_dealt_with_leave_numbers_within_their_intervals(fault: str) -> None:
    make, verdict, words = DEALT_WITH[fault]
    findings = found_in(make())
    assert findings.verdict == verdict, messages(findings)
    assert words in messages(findings)
    assert sum(p.value is not None for p in findings.parameters) >= 24
    assert worst_z(findings) < 2.5


@pytest.mark.parametrize("fault", NOT_TOLD)
def test_faults_that_cannot_be_mended_give_no_number(fault: str) -> None:
    make, words = NOT_TOLD[fault]
    findings = found_in(make())
    assert findings.verdict == "rejected"
    assert words in messages(findings)
    assert all(p.value is None and p.description for p in findings.parameters)
    assert {p.name for p in findings.parameters} >= {"kxx", "cyy"}


def test_a_calibrated_lag_is_taken_out() -> None:
    findings = found_in(logs(1, delay=50e-6), {"displacement_lag": 50e-6})
    assert findings.verdict == "ok", messages(findings)
    assert worst_z(findings) < 2.5


def test_a_lag_is_measured_and_its_bias_of_damping_told() -> None:
    text = messages(found_in(logs(1, delay=50e-6)))
    told = float(text.split("displacement late by ")[1].split()[0])
    assert told == pytest.approx(50, abs=10)
    assert "N s/m on cxx" in text


def test_one_plane_alone_is_not_called_ok() -> None:
    runs = [without(r, *(g for g in GAP if g.endswith("2"))) for r in logs(1)]
    findings = found_in(runs)
    assert findings.verdict == "warning"
    assert "one plane only" in messages(findings)


def test_runs_of_another_test_and_runs_too_short_are_left_out_by_name() -> None:
    other = conditions(Recording("bump", logs(1)[0].streams, logs(1)[0].conditions), test="bump")
    short = Recording("short", logs(1, duration=2.0)[0].streams, logs(1)[0].conditions)
    findings = found_in([*logs(1), other, short])
    left = {r.run: r.reason for r in findings.runs if not r.used}
    assert set(left) == {"bump", "short"}
    assert "Log longer" in left["short"]
    assert worst_z(findings) < 2.5
    with pytest.raises(InputError, match="Log longer"):
        found_in([short])


def test_check_says_of_one_log_what_would_keep_it_out() -> None:
    from pipeline.rigs.tpjb.dynamic.declaration import DYNAMIC

    good = logs(1)[0]
    assert DYNAMIC.check(good) == []
    with pytest.raises(InputError, match="Log longer"):
        DYNAMIC.check(logs(1, duration=2.0)[0])
    with pytest.raises(InputError, match=r"no sound probe along v.* no accelerometer along u"):
        DYNAMIC.check(without(good, *(g for g in GAP if g[4] == "v"), *ACC))
    with pytest.raises(InputError, match="no list of numbers"):
        DYNAMIC.check(conditions(good, excitation_tones="many"))
    with pytest.raises(InputError, match="not of the dynamic test"):
        DYNAMIC.check(conditions(good, test="bump"))


def test_the_reason_names_why_the_acceleration_is_not_known() -> None:
    findings = found_in(scaled(logs(1), ACC, 1 / 9.80665))
    assert "in g but read as m/s^2" in findings.reasons[0]
    assert "in g but read as m/s^2" in findings.one("kxx", **{"synchronous": True}).description


def test_a_lag_of_a_bearing_that_bends_with_frequency_is_no_missing_mass() -> None:
    for delay in (0.0, 50e-6):
        findings = found_in(logs(1, bearings=["5pad-L3"], delay=delay))
        assert findings.verdict == "ok"
        assert "displacement late by" in messages(findings)
        assert "wrong sign" not in messages(findings)
        assert all(p.value is not None for p in findings.parameters)


def test_a_decisive_lag_is_named_alone_and_a_wrong_mass_alone() -> None:
    assert "heavier than" not in messages(found_in(logs(1, delay=80e-6)))
    text = messages(found_in([conditions(r, stator_mass=500.0) for r in logs(1)]))
    assert "heavier than stated" in text
    assert "displacement late" not in text


def test_the_change_with_frequency_is_computed_with_its_interval() -> None:
    findings = found_in(logs(1))
    row = next(p for p in findings.published if "kxx" in p.name)
    assert isinstance(row.found, float)
    assert 0 < abs(row.found) < 0.01
    assert row.agrees
    assert "95 % interval" in row.remark


SAID_BY_CHECK = {
    "no acceleration": (lambda r: without(r, *ACC), "error", "no accelerometer along u"),
    "no mass": (lambda r: conditions(r, stator_mass=None), "error", "'stator_mass' is not given"),
    "acceleration in g": (lambda r: scaled([r], ACC, 1 / 9.80665)[0], "error", "in g but read as m/s^2"),
    "acceleration inverted": (lambda r: scaled([r], ACC, -1.0)[0], "error", "of the wrong sign"),
    "forces inverted": (lambda r: scaled([r], ("force_u", "force_v"), -1.0)[0], "error", "goes against the force"),
    "forces in kN": (lambda r: scaled([r], ("force_u", "force_v"), 1e-3)[0], "error", "unit of a force"),
    "v actuator off": (lambda r: scaled([r], ("force_v",), 1e-3)[0], "warning", "force along u only"),
    "inverted probe": (lambda r: changed(r, "gap_vp2", lambda _, v: 2e-3 - v), "warning", "its sign is inverted"),
    "clipped force": (lambda r: changed(r, "force_u", cut(0.97)), "error", "is clipped"),
    "an unknown mode": (lambda r: conditions(r, mode="antifase"), "warning", "'antifase' is not known"),
}


@pytest.mark.parametrize("fault", SAID_BY_CHECK)
def test_check_says_what_identify_says(fault: str) -> None:
    from pipeline.rigs.tpjb.dynamic.declaration import DYNAMIC

    spoil, level, words = SAID_BY_CHECK[fault]
    found = DYNAMIC.check(spoil(logs(1)[0]))
    assert any(q.level == level and words in q.message for q in found), found
