"""Faults of pressure logs are named, doubted or refused in plain words, and none ends in numbers that look good (rap.md, 8)."""

from __future__ import annotations

import numpy as np
import pytest
from pressure_logs import MMHG, changed, edited, exchanged, found, told, usual, without

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.rap.pressures.check import check
from pipeline.rigs.rap.pressures.sections import sections
from pipeline.rigs.rap.pressures.spikes import spikes
from pipeline.rigs.rap.tables import Signal

READERS = ("rap", "bench", "prot")
TAPS = ("access", "prefilter", "return", "uf")


def messages(findings: Findings) -> str:
    return "\n".join(f"{q.level}: {q.message}" for q in findings.quality)


def refusal(recording: Recording) -> str:
    """Return why a run is rejected; nothing of it is told as a number."""
    findings = found(recording)
    assert findings.verdict == "rejected"
    assert all(p.value is None for p in findings.parameters)
    assert not findings.runs[0].used
    assert any(q.level == "error" for q in check(recording))
    assert sections(findings) == []
    return findings.runs[0].reason


@pytest.mark.parametrize("reader", ["rap", "bench"])
def test_exchanged_prefilter_and_return_are_refused(reader: str) -> None:
    spoilt = exchanged(usual(), f"pressure_prefilter_{reader}", f"pressure_return_{reader}")
    assert "pre-filter and return exchanged?" in refusal(spoilt)


def test_exchanged_prefilter_and_return_of_both_readers_are_refused() -> None:
    spoilt = usual()
    for reader in READERS:
        spoilt = exchanged(spoilt, f"pressure_prefilter_{reader}", f"pressure_return_{reader}")
    assert "pre-filter and return exchanged?" in refusal(spoilt)


@pytest.mark.parametrize("other", ["prefilter", "uf"])
def test_access_exchanged_with_another_tap_is_refused(other: str) -> None:
    text = refusal(exchanged(usual(), "pressure_access_rap", f"pressure_{other}_rap"))
    assert "exchanged?" in text
    assert "access" in text


@pytest.mark.parametrize("reader", ["rap", "bench"])
def test_turned_sign_of_access_is_refused_with_what_to_write(reader: str) -> None:
    text = refusal(changed(usual(), **{f"pressure_access_{reader}": lambda p: -p}))
    assert "access must be negative" in text
    assert "sign: -1" in text


def test_turned_sign_of_return_is_refused() -> None:
    assert "return pressure must be positive" in refusal(changed(usual(), pressure_return_rap=lambda p: -p))


@pytest.mark.parametrize(("unit", "size"), [("mmHg", MMHG), ("kPa", 1e3), ("psi", 6894.76)], ids=["mmHg", "kPa", "psi"])
def test_another_unit_labelled_pascal_is_refused_by_name(unit: str, size: float) -> None:
    device = {f"pressure_{tap}_{reader}": lambda p: p / size for tap in TAPS for reader in ("rap", "prot")}
    text = refusal(changed(usual(), **device))
    assert f"unit mix-up, factor {size:.4g}" in text
    assert f"'unit: {unit}'" in text


def test_another_unit_on_device_and_bench_alike_is_refused() -> None:
    all_ = {f"pressure_{tap}_{reader}": lambda p: p / MMHG for tap in TAPS for reader in READERS}
    assert "unit: mmHg" in refusal(changed(usual(), **all_))


@pytest.mark.parametrize("tap", TAPS)
def test_another_unit_of_one_tap_is_refused(tap: str) -> None:
    assert "unit mix-up, factor 133.3" in refusal(changed(usual(), **{f"pressure_{tap}_bench": lambda p: p / MMHG}))


def test_pascals_converted_as_if_they_were_mmhg_are_refused() -> None:
    assert "unit mix-up, factor 1/133.3" in refusal(changed(usual(), pressure_prefilter_rap=lambda p: p * MMHG))


def test_blood_flow_in_millilitres_a_minute_is_refused() -> None:
    text = refusal(changed(usual(), blood_flow_set=lambda q: q * 6e7))
    assert "blood_flow_set" in text
    assert "mL/min" in text


def test_log_in_which_everything_is_wrong_names_it_all() -> None:
    spoilt = exchanged(usual(), "pressure_prefilter_rap", "pressure_return_rap")
    device = {f"pressure_{tap}_{reader}": lambda p: p / MMHG for tap in TAPS for reader in ("rap", "prot")}
    spoilt = changed(spoilt, **device)
    spoilt = changed(spoilt, pressure_uf_rap=lambda p: np.full_like(p, p[5]))

    def dropout(
        stream: str, time: np.ndarray, columns: dict[str, np.ndarray]
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        kept = (time < 100.0) | (time > 102.0) if stream == "device" else np.ones(time.size, dtype=bool)
        return time[kept], {k: v[kept] for k, v in columns.items()}

    spoilt = edited(spoilt, dropout)
    assert "exchanged?" in refusal(spoilt)
    words = "\n".join(q.message for q in check(spoilt))
    for part in (
        "unit mix-up",
        "pre-filter and return exchanged?",
        "channel frozen: pressure_uf_rap",
        "gap of 4",
    ):
        assert part in words


def test_frozen_tap_is_left_out_and_the_others_stand() -> None:
    findings = found(changed(usual(), pressure_uf_rap=lambda p: np.full_like(p, p[5])))
    assert findings.verdict == "warning"
    assert "channel frozen: pressure_uf_rap" in messages(findings)
    assert "pressure_uf_prot goes on" in messages(findings)
    assert findings.one("gain", channel="uf").value is None
    assert "frozen" in findings.one("gain", channel="uf").description
    assert findings.one("gain", channel="prefilter").value == pytest.approx(1.015, abs=0.003)


def test_samples_of_a_channel_that_hangs_for_a_while_are_not_used() -> None:
    def hang(p: np.ndarray) -> np.ndarray:
        p[2400:2700] = p[2400]
        return p

    findings = found(changed(usual(), pressure_return_rap=hang))
    assert "these samples are not used" in messages(findings)
    assert findings.one("gain", channel="return").value == pytest.approx(0.990, abs=0.004)


def test_zero_not_taken_is_told_as_a_head() -> None:
    findings = found(changed(usual(), pressure_access_rap=lambda p: p + 460.0))
    assert "zero not taken: pressure_access_rap" in messages(findings)
    assert "head = 4.1 cm" in messages(findings)
    assert findings.verdict == "warning"


def test_reading_at_rest_that_a_stated_height_explains_is_a_note() -> None:
    lifted = changed(usual(), **{f"pressure_prefilter_{reader}": lambda p: p - 985.0 for reader in READERS})
    findings = found(told(lifted, {"sensor_height_prefilter": 0.10}))
    told_of = [q for q in findings.quality if "height over the reservoir" in q.message]
    assert {q.level for q in told_of} == {"note"}
    assert "zero not taken" not in messages(findings)


def test_blood_that_draws_the_ultrafiltrate_down_at_rest_is_no_zero_to_take_again() -> None:
    drawn = changed(usual(), **{f"pressure_uf_{reader}": lambda p: p - 3333.0 for reader in READERS})
    as_blood, as_saline = messages(found(told(drawn, {"fluid": "blood"}))), messages(found(drawn))
    assert "osmotic pressure" in as_blood
    assert "re-zero" not in as_blood
    assert "zero not taken: pressure_uf_rap" in as_saline


def test_two_speeds_of_the_pump_lines_are_one_stroke() -> None:
    assert "rotor rate" not in messages(found(usual()))


def test_log_too_slow_for_the_pump_is_told_as_aliasing() -> None:
    def thinned(
        stream: str, time: np.ndarray, columns: dict[str, np.ndarray]
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        step = 4 if stream in ("device", "bench") else 1
        return time[::step], {k: v[::step] for k, v in columns.items()}

    findings = found(edited(usual(), thinned))
    assert "aliasing" in messages(findings)
    assert findings.verdict != "ok"


def test_repeated_rows_are_told() -> None:
    def held(stream: str, time: np.ndarray, columns: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        if stream == "device":
            for values in columns.values():
                values[600:4800:60] = values[599:4799:60]
        return time, columns

    assert "duplicated samples" in messages(found(edited(usual(), held)))


def test_skew_between_the_control_units_is_a_note_with_its_size() -> None:
    skews = [q for q in found(usual()).quality if "skew" in q.message]
    assert len(skews) == 1
    assert skews[0].level == "note"
    assert "skew +9.9 ms" in skews[0].message


def test_control_units_that_part_are_told() -> None:
    def step(p: np.ndarray) -> np.ndarray:
        p[2000:3000] += 400.0
        return p

    assert "the two control units part" in messages(found(changed(usual(), pressure_access_prot=step)))


def test_run_without_bench_gives_hydraulics_only() -> None:
    bench = [name for name in (c.name for c in usual()) if name.startswith("pressure_") and name.endswith("_bench")]
    findings = found(without(usual(), *bench))
    assert findings.one("gain", channel="access").value is None
    assert "no bench pressure" in findings.one("gain", channel="access").description
    assert findings.one("r_return").value == pytest.approx(1.4e9, rel=0.03)


def test_run_without_any_flow_gives_agreement_only() -> None:
    flows = ("blood_flow_set", "blood_flow_rap", "blood_flow_bench", "blood_pump_speed")
    findings = found(without(usual(), *flows))
    assert findings.one("gain", channel="prefilter").value == pytest.approx(1.015, abs=0.003)
    assert findings.one("r_return").value is None
    assert "flow" in findings.one("r_return").description


def test_run_without_any_pressure_is_refused() -> None:
    names = [channel.name for channel in usual() if channel.name.startswith("pressure_")]
    with pytest.raises(InputError, match="no pressure of device or bench"):
        found(without(usual(), *names))


def test_membrane_that_clogs_within_the_run_is_told() -> None:
    def falling(p: np.ndarray) -> np.ndarray:
        # A coefficient that falls lets the ultrafiltrate pressure sink while ultrafiltration is on.
        return np.where(p < -500.0, p - 6.0 * np.arange(p.size) / 20.0, p)

    findings = found(changed(usual(), pressure_uf_bench=falling, pressure_uf_rap=falling, pressure_uf_prot=falling))
    assert "K_uf changes by -" in messages(findings)
    assert findings.verdict == "warning"


def test_lone_spikes_are_named_and_spoil_nothing() -> None:
    rng = np.random.default_rng(5)

    def struck(p: np.ndarray) -> np.ndarray:
        return p + rng.choice([-2e4, 2e4], p.size) * (rng.random(p.size) < 0.01)

    findings = found(changed(usual(), **{f"pressure_{tap}_rap": struck for tap in TAPS}))
    assert "lone spikes of up to" in messages(findings)
    assert "exchanged?" not in messages(findings)
    sound = found(usual())
    for tap in TAPS:
        for name in ("gain", "limit_upper"):
            ours, theirs = findings.one(name, channel=tap), sound.one(name, channel=tap)
            assert ours.value == pytest.approx(theirs.value, abs=4.0 * theirs.std_error)


def test_strokes_are_no_spikes() -> None:
    assert "spikes" not in messages(found(usual()))


def test_minutes_labelled_seconds_are_refused_as_that() -> None:
    text = refusal(edited(usual(), lambda _stream, time, columns: (time / 60.0, columns)))
    assert "time in min, labelled s?" in text
    assert "exchanged?" not in text


def test_one_reading_in_kilopascal_is_no_exchange() -> None:
    text = refusal(changed(usual(), pressure_prefilter_bench=lambda p: p / 1e3))
    assert "unit mix-up, factor 1000" in text
    assert "exchanged?" not in text


def test_turned_sign_of_all_ultrafiltrate_pressures_is_told() -> None:
    findings = found(changed(usual(), **{f"pressure_uf_{reader}": lambda p: -p for reader in READERS}))
    assert findings.one("k_uf").value is None
    assert any(
        "sign of pressure_uf is turned" in q.message and q.channel == "pressure_uf_bench" for q in findings.quality
    )
    assert any("sign of pressure_uf is turned" in reason for reason in findings.reasons)


def test_settings_on_a_clock_of_their_own_are_told_and_not_used() -> None:
    def booted(
        stream: str, time: np.ndarray, columns: dict[str, np.ndarray]
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        return time + (1e6 if stream == "device" else 0.0), columns

    findings = found(edited(usual(), booted))
    assert "two clocks in one device" in messages(findings)
    assert findings.one("k_uf").value is None
    assert findings.one("r_return").value == pytest.approx(1.4e9, rel=0.003)


def test_meter_without_a_place_is_told() -> None:
    findings = found(told(usual(), {"flowmeter_location": None}))
    assert "flowmeter_location is not stated" in messages(findings)
    assert findings.verdict == "warning"
    assert findings.one("r_access").value == pytest.approx(1.4e9, rel=0.003)


def test_noise_of_coarse_readings_at_rest_is_no_spike() -> None:
    noise = np.random.default_rng(4).normal(0.0, 25.0, 300)
    rest = Signal("pressure_uf_rap", np.arange(300) / 20.0, np.round(noise / 26.0) * 26.0)
    assert not spikes(rest).any()
    struck = Signal(rest.name, rest.time, rest.values + np.where(np.arange(300) == 150, 2e4, 0.0))
    assert list(np.flatnonzero(spikes(struck))) == [150]
