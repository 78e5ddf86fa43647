"""Captions answer from the tables that they stand under: sound, faulty and missing data each get a true sentence."""

from __future__ import annotations

import pandas as pd
import pytest

from pipeline.findings import Parameter
from pipeline.rigs.rap.flow import captions as flow
from pipeline.rigs.rap.pressures import captions
from pipeline.rigs.rap.therapy.outcome import captions as therapy
from pipeline.rigs.rap.wording import grouped, plus_minus, signed


def test_numbers_in_words_have_no_minus_zero() -> None:
    assert [signed(-0.004, 2), signed(-0.006, 2), signed(3.0, 1)] == ["0.00", "-0.01", "+3.0"]
    assert plus_minus(39.704, 0.4651, "ppm") == "39.70 +- 0.47 ppm"
    assert grouped([("a", "within"), ("b", "within")], "every tap") == "within at every tap"
    assert (
        grouped([("a", "within"), ("b", "outside"), ("c", "within")], "every tap") == "within at a and c; outside at b"
    )


def gains(words: tuple[str, str]) -> pd.DataFrame:
    return pd.DataFrame({
        "run": "r", "channel": ["access", "return"], "gain": [1.0114, 1.05], "offset": [-61.0, 40.0],
        "gain_word": words, "offset_word": ["within", "undecided"],
    })  # fmt: skip


def test_gains_outside_their_tolerance_are_named() -> None:
    assert "gains lie within at every tap" in captions.gains(gains(("within", "within")), "r")
    assert "gains lie within at access; outside at return" in captions.gains(gains(("within", "outside")), "r")
    assert captions.gains(gains(("within", "within")), "other") == "They could not be told."


def test_a_line_left_and_a_check_beyond_are_named() -> None:
    rows = pd.DataFrame({"channel": ["access"] * 2 + ["uf"] * 2, "residual": [3.0, -3.0, 10.0, 10.0]})
    checks = pd.DataFrame({"name": "residual_line", "channel": ["access", "uf"], "exceeds": [False, True]})
    assert captions.overlay(rows, checks).startswith(
        "What is left is 3 Pa at access and 10 Pa at ultrafiltrate (rms); a line"
    )
    assert "left at ultrafiltrate" in captions.overlay(rows, checks)
    assert "no line of the pump is left" in captions.overlay(rows, checks.assign(exceeds=False))
    assert captions.checks(checks) == "1 of 2 are beyond: see ultrafiltrate."
    assert captions.checks(checks.assign(exceeds=False)) == "None of the 2 is beyond its limit."


def test_coherence_counts_harmonics_from_the_first_on() -> None:
    rows = pd.DataFrame({
        "channel": ["access"] * 4 + ["uf"] * 2, "harmonic": [1, 2, 3, 1, 1, 2], "threshold": 0.2,
        "coherence": [0.9, 0.1, 0.5, 0.8, 0.1, 0.9],
    })  # fmt: skip
    assert captions.coherent(rows) == "At every set-point up to k = 1 at access; at none at ultrafiltrate."


def test_the_better_estimator_of_flow_is_the_one_of_the_hold_out() -> None:
    errors = pd.DataFrame({
        "estimator": ["E2", "E2", "E3", "E3"], "set": ["calibration", "holdout"] * 2, "group": ["calibration", "hold-out, tube A"] * 2,
        "worst": [0.02, 0.03, 0.001, 0.12], "rms": [0.01, 0.02, 0.0005, 0.08], "mean": [0.0, 0.001, 0.0, -0.05],
    })  # fmt: skip
    assert flow.held_out(errors) == "By the hold-out E2 predicts better: it is off by 3 % at most, E3 by 12 %."
    assert "no hold-out" in flow.held_out(errors[errors["set"] == "calibration"])
    assert (
        "E3 leaves 0.05 % (rms) of the calibration and on the mean is off by -5.00 % (hold-out, tube A)"
        in flow.laws(errors)
    )
    assert flow.laws(errors.iloc[:0]) == "Neither could be calibrated."
    windows = pd.DataFrame({"E2_error": [0.01, -0.2], "E3_error": [float("nan")] * 2})
    assert flow.beyond(windows, 0.0912) == "Beyond 9.12 % lie 1 of 2 windows of E2."


def test_alarms_and_mismatches_are_counted_and_their_absence_said() -> None:
    table = pd.DataFrame({"run": "r", "verdict": ["match", "missed", "match"]})
    assert therapy.alarms(table) == "Of 3 alarms 2 were logged in time and 1 was not logged."
    assert therapy.alarms(table.iloc[:0]) == "No alarm was due and none logged."
    found = pd.DataFrame({"run": ["r"], "channel": ["uf"], "kind": ["drift"], "size": [4.949], "time": [1406.0]})
    assert therapy.units(found, "r") == "No: a drift of 4.95 Pa/s at ultrafiltrate, found 1406 s into the log."
    assert therapy.units(found, "other") == "Yes: no mismatch at any tap."


@pytest.mark.parametrize(
    ("ci95", "said"),
    [
        ((18000.0, 19000.0), "Not surely: "),
        ((18100.0, 19000.0), "Yes: "),
        ((17000.0, 17900.0), "No: "),
        (None, "That cannot"),
    ],
)
def test_a_battery_lasts_where_its_whole_interval_does(ci95: tuple[float, float] | None, said: str) -> None:
    value = None if ci95 is None else sum(ci95) / 2
    runtime = Parameter(name="runtime_projected", symbol="t", value=value, ci95=ci95, unit="s", description="no power")
    assert therapy.battery(runtime, 18000.0).startswith(said)


def test_innovations_that_are_too_large_are_called_so() -> None:
    account = pd.DataFrame({"run": ["a", "b", "c"], "nis": [1.02, 1.6, float("nan")]})
    words = [therapy.innovations(account, run) for run in "abcd"]
    assert [word.split(":")[0] for word in words[:2]] == [
        "They are as large as it expects",
        "They are larger than it expects",
    ]
    assert words[2] == words[3] == "Too few levels tell."
