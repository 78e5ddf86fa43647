"""Whether a truth makes a rig: numbers in their range, lists in their form; else what is wrong, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from pipeline.errors import InputError
from pipeline.rigs.rap.conditions import TAPS

RIG = "synthetic ultrafiltration device"
"""What messages call it."""
# What may be zero or negative; every other number is more than 0.
_SIGNED = (
    *(f"{name}_{tap}" for name in ("offset", "height") for tap in TAPS),
    *("bench_offset", "tube_change", "device_lag", "device_ppm", "bench_ppm", "scale_lag", "scale_ppm", "skew", "a"),
    *("level_sensor_dx", "level_sensor_dy", "level_offset", "pitch", "roll", "temperature_offset", "scale_tare", "fouling"),
    *("motion_pitch",),
)  # fmt: skip
_ZERO_OR_MORE = (
    "V_d0", "C_p", "heparin_flow", "speed_scatter", "sensor_noise", "adc_noise", "bench_noise", "device_lsb", "bench_lsb",
    "device_jitter", "bench_jitter", "scale_jitter", "meter_noise", "zero_time", "stop_time", "uf_flow", "wear",
    "pump_gain_scatter", "loop_least", "tank_blind_level", "initial_volume", "level_noise", "level_lsb", "wild_echoes", "accel_noise", "temperature_noise", "temperature_lsb",
    "bench_temperature_noise", "bench_temperature_lsb", "scale_noise", "power_scatter", "battery_resistance", "battery_noise",
    "motion_volume", "motion_pitch_scatter", "motion_roll_scatter", "walking_time", "walking_accel", "slosh", "alarm_delay",
)  # fmt: skip
# Fields that are lists: how many entries a row has, 0 for numbers.
_LISTS = {"eps": 0, "flows": 0, "calibration_clamps": 0, "holdout_clamps": 0, "mismatches": 5, "fault_mismatches": 5,
          "episodes": 3, "injections": 3, "pauses": 2}  # fmt: skip
_LONGEST = 86400.0


def check(truth: Any) -> None:
    """Refuse what makes no rig; `truth` is one of the dataclasses of `truth` and `therapy_truth`."""
    for field in fields(truth):
        value = getattr(truth, field.name)
        if isinstance(value, bool) or not isinstance(value, int | float) or field.name in _SIGNED:
            continue
        zero = field.name in _ZERO_OR_MORE
        if not math.isfinite(value) or value < 0.0 or (value == 0.0 and not zero):
            raise InputError(
                f"'{field.name}' of the {RIG} is {value!r}; expected {'0 or more' if zero else 'more than 0'}."
            )
    for name, columns in _LISTS.items():
        if hasattr(truth, name):
            _check_list(name, getattr(truth, name), columns)
    wrong = (
        (truth.w > 1.0, f"'w' is {truth.w!r}; expected up to 1: back suction is over before the next passage"),
        (not truth.eps, "'eps' is empty; expected a number for each roller"),
        (
            any(float(v) <= 0.0 for name in ("flows", "calibration_clamps", "holdout_clamps") for v in getattr(truth, name, ())),
            "flows and clamps are more than 0",
        ),
        (hasattr(truth, "flows") and not truth.flows, "'flows' is empty; expected a set-point or more"),
        (
            hasattr(truth, "run") and truth.duration < truth.zero_time + truth.stop_time + 10.0 * len(truth.flows),
            "'duration' leaves less than 10 s for each of the flows",
        ),
        (
            any(row[0] not in TAPS for name in ("mismatches", "fault_mismatches") for row in getattr(truth, name, ())),
            f"a mismatch begins with one of {', '.join(TAPS)}",
        ),
        (
            truth.flowmeter_location not in ("access", "return"),
            f"'flowmeter_location' is {truth.flowmeter_location!r}; expected access or return",
        ),
        (max(truth.device_jitter * truth.device_rate, truth.bench_jitter * truth.bench_rate) > 0.1,
         "the jitter of the stamps is more than a tenth of the step"),
        (float(getattr(truth, "duration", 1.0)) > _LONGEST, f"'duration' is more than {_LONGEST:g} s"),
    )  # fmt: skip
    for is_wrong, what in wrong:
        if is_wrong:
            raise InputError(f"the {RIG}: {what}.")


def _check_list(name: str, rows: Any, columns: int) -> None:
    """Refuse what is no list of numbers (`columns` 0) or of rows with that many entries."""
    is_list = isinstance(rows, Sequence) and not isinstance(rows, str)
    if is_list and not columns and all(isinstance(v, int | float) and math.isfinite(v) for v in rows):
        return
    if is_list and columns and all(isinstance(row, Sequence) and len(row) == columns for row in rows):
        return
    expected = f"a list of rows of {columns} entries" if columns else "a list of numbers"
    raise InputError(f"'{name}' of the {RIG} is {rows!r}; expected {expected}.")
