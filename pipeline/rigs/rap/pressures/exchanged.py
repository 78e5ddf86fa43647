"""Signs and exchanges of taps, told by what a running pump does to each (rap.md, section 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures.record import READERS, WORDS, Record
from pipeline.rigs.rap.pressures.tap_levels import TapLevel
from pipeline.rigs.rap.pressures.units import side_of

# A level that is so far from zero (Pa, and that many standard errors) has a sign.
_CLEAR, _SIGMAS = 100.0, 4.0
# Pulsation of the return over the pre-filter tap: above the first they are exchanged, at most the second is usual.
_REVERSED = 1.0
# The ultrafiltrate hardly pulsates: its membrane and chamber smooth it (section 3.3).
# One that does not move at all is frozen or at its rail, which is told elsewhere.
_PULSATION_SHARE, _LEAST_PULSATION, _LEAST_CALM = 1.3, 60.0, 10.0


def exchange_faults(record: Record, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Return errors where taps are exchanged or signs turned, reader by reader."""
    found: list[QualityFinding] = []
    for reader in READERS:
        taps = {level.tap: level for level in levels if level.reader == reader and math.isfinite(level.rise)}
        found += _ultrafiltrate(record, reader, taps) or _signs(record, reader, taps) or _order(record, reader, taps)
    return found


def _sign(level: TapLevel | None) -> int:
    """Return the sign of a level with the pump on, 0 where it cannot be told."""
    if level is None or abs(level.rise) < max(_CLEAR, _SIGMAS * level.error):
        return 0
    return 1 if level.rise > 0.0 else -1


def _signs(record: Record, reader: str, taps: dict[str, TapLevel]) -> list[QualityFinding]:
    """Tell access pressures that are positive and pre-filter or return pressures that are negative."""
    access = taps.get("access")
    positive = _sign(access) > 0
    negative = [taps[tap] for tap in ("prefilter", "return") if _sign(taps.get(tap)) < 0]
    if access is not None and positive and negative:
        other = negative[0]
        text = (
            f"access and {TAP_NAMES[other.tap]} exchanged? With the pump on {access.channel} is {access.rise:+.0f} Pa, where it must be negative, and "
            f"{other.channel} {other.rise:+.0f} Pa, where it must be positive. Map them the other way round in the recipe"
        )
        return [QualityFinding("error", text, record.run, access.channel)]
    found = []
    if access is not None and positive:
        found.append(
            QualityFinding(
                "error",
                f"access must be negative: {access.channel} ({WORDS[reader]} reading) is {access.rise:+.0f} Pa with the pump on{_rest(access)}, but a "
                "pump that draws from the access line pulls it below the reservoir. Its sign is turned: 'sign: -1' in the recipe",
                record.run,
                access.channel,
            )
        )  # fmt: skip
    found += [
        QualityFinding(
            "error",
            f"{TAP_NAMES[level.tap]} pressure must be positive: {level.channel} ({WORDS[reader]} reading) is {level.rise:+.0f} Pa with the pump "
            f"on{_rest(level)}. Its sign is turned ('sign: -1' in the recipe), or it is another tap's",
            record.run,
            level.channel,
        )
        for level in negative
    ]  # fmt: skip
    return found


def _rest(level: TapLevel) -> str:
    return " (its reading at rest taken off)" if level.zeroed else ""


def _order(record: Record, reader: str, taps: dict[str, TapLevel]) -> list[QualityFinding]:
    """Tell pre-filter and return that are exchanged: fluid runs and pulsation decays from the former to the latter."""
    before, after = taps.get("prefilter"), taps.get("return")
    if before is None or after is None or not (before.scatter > 0.0 and after.scatter > 0.0):
        return []
    drop, error = before.rise - after.rise, math.hypot(before.error, after.error)
    reversed_ = drop <= 0.0 and abs(drop) > _SIGMAS * error
    # Of two that are in different units neither can be said to be the larger.
    if not before.pulsation > 0.0 or side_of(before) != side_of(after):
        return []
    ratio = after.pulsation / before.pulsation
    told = (
        f"{before.channel} is {before.rise:.4g} Pa and {after.channel} {after.rise:.4g} Pa, and the latter pulsates "
        f"{ratio:.2g} times as much"
    )
    if reversed_ and ratio > _REVERSED:
        text = (
            f"pre-filter and return exchanged? With the pump on, {told} ({WORDS[reader]} readings): the filter can only lower both. Map them the "
            "other way round in the recipe"
        )
        return [QualityFinding("error", text, record.run, before.channel)]
    if reversed_:
        text = (
            f"pre-filter below return: with the pump on, {told}. Fluid cannot run uphill through the filter, yet the pulsation decays along it: a zero, gain or unit "
            "of one of them is wrong"
        )
        return [QualityFinding("error", text, record.run, before.channel)]
    if ratio > _REVERSED:
        text = f"air at the pre-filter sensor? With the pump on, {told}, while the means are in order: something soft (air, a loose dome) smooths the pre-filter reading"
        return [QualityFinding("warning", text, record.run, before.channel)]
    return []


def _ultrafiltrate(record: Record, reader: str, taps: dict[str, TapLevel]) -> list[QualityFinding]:
    """Tell an ultrafiltrate pressure that pulsates like a blood pressure."""
    uf = taps.get("uf")
    others = {tap: taps[tap] for tap in ("access", "prefilter", "return") if tap in taps}
    if uf is None or not others or not uf.pulsation > _LEAST_PULSATION:
        return []
    calm = [one for one in others.values() if uf.pulsation > _PULSATION_SHARE * one.pulsation > _LEAST_CALM]
    if not calm:
        return []
    other = min(calm, key=lambda level: level.pulsation)
    text = (
        f"{TAP_NAMES[other.tap]} and ultrafiltrate exchanged? {uf.channel} pulsates by {uf.pulsation:.0f} Pa rms and {other.channel} by "
        f"{other.pulsation:.0f} Pa ({WORDS[reader]} readings), but membrane and ultrafiltrate chamber smooth the former. Map them the other way round"
    )
    return [QualityFinding("error", text, record.run, uf.channel)]
