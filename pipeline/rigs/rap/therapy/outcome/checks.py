"""What a therapy run is judged by (rap.md, section 7), one row each: what was found, what is allowed, green, amber or red."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.errors import counted, listing
from pipeline.findings.figures import Mood
from pipeline.rigs.rap.therapy.declaration import TherapySettings
from pipeline.rigs.rap.therapy.run_numbers import RunNumbers

_ALARMS, _CIRCULATION, _UNITS = (
    "alarms beside the log",
    "ultrafiltration without circulation",
    "control and protective unit",
)
# What the log itself shows, and whoever reads the findings on the data alone must know.
OF_THE_LOG = (_ALARMS, _CIRCULATION, _UNITS)
ML, HOUR, WH = 1e-6, 3600.0, 3600.0
_SURE = 1.96


@dataclass(frozen=True)
class Check:
    """One criterion of one run: `found` and `allowed` in words, a `word` and its `mood`, the whole as a `sentence`."""

    run: str
    criterion: str
    found: str
    allowed: str
    word: str
    mood: Mood
    sentence: str
    span: tuple[float, float] | None = None


def checks_of(run: RunNumbers, settings: TherapySettings) -> list[Check]:
    """Return the checks that a run's channels allow."""
    return [
        *_temperature(run, settings), *_volume(run, settings), *_rate(run, settings), *_energy(run, settings),
        *_membrane(run), *_alarms(run), *_circulation(run), *_units(run),
    ]  # fmt: skip


def _within(value: float, doubt: float, limit: float) -> tuple[str, Mood]:
    """Judge a magnitude with its standard error against a limit."""
    reach = _SURE * doubt if math.isfinite(doubt) else 0.0
    if value + reach < limit:
        return "within", "ok"
    return ("outside", "rejected") if value - reach > limit else ("at the limit", "warning")


def _placed(word: str) -> str:
    return {"outside": "outside of", "at the limit": "not surely within"}.get(word, word)


def _temperature(run: RunNumbers, settings: TherapySettings) -> Iterator[Check]:
    error = run.temperature_error
    if error is None or error.largest.value is None:
        return
    share, largest = error.percent_max / 100.0, error.largest.value
    doubt = (error.largest.std_error or 0.0) * share / largest if largest else 0.0
    word, mood = _within(share, doubt, settings.temperature_tolerance)
    found, allowed = f"{100 * share:.2f} % ({largest:.2f} K)", f"below {100 * settings.temperature_tolerance:g} %"
    bias = f", mean {error.bias.value:+.2f} K" if error.bias.value is not None else ""
    yield Check(
        run.run, "largest temperature error, of the bench in °C", found, allowed, word, mood,
        f"The device's temperature is at most {found} off the bench's{bias}: {_placed(word)} the tolerance of {100 * settings.temperature_tolerance:g} %.",
    )  # fmt: skip


def _volume(run: RunNumbers, settings: TherapySettings) -> Iterator[Check]:
    volume = run.volume
    if volume is None or volume.error is None or not math.isfinite(volume.final_share):
        return
    final, share = volume.error.final.value or 0.0, abs(volume.final_share)
    doubt = (volume.error.final.std_error or 0.0) * share / abs(final) if final else 0.0
    word, mood = _within(share, doubt, settings.volume_tolerance)
    found = f"{final / ML:+.1f} mL, {100 * volume.final_share:+.2f} %"
    yield Check(
        run.run, "final error of the ultrafiltrate volume", found, f"below {100 * settings.volume_tolerance:g} %", word, mood,
        f"The estimated ultrafiltrate ends {found} off the scale: {_placed(word)} the tolerance of {100 * settings.volume_tolerance:g} %.",
    )  # fmt: skip


def _rate(run: RunNumbers, settings: TherapySettings) -> Iterator[Check]:
    ratio = run.volume.error.rate_ratio if run.volume and run.volume.error else None
    if run.volume is None or ratio is None or ratio.value is None:
        return
    apart = run.volume.disagreement
    off = float(ratio.value or 1.0) - 1.0
    word, mood = _within(abs(off), ratio.std_error or 0.0, settings.rate_tolerance)
    found = f"{100 * off:+.2f} %"
    yield Check(
        run.run, "ultrafiltration rate, scale over set", found, f"within {100 * settings.rate_tolerance:g} %", word,
        "warning" if mood == "rejected" else mood,
        f"The scale gains {found} against the set ultrafiltration rate: {_placed(word)} the tolerance of {100 * settings.rate_tolerance:g} %"
        + ("." if mood == "ok" or apart else f"; ultrafiltrate pump gain {ratio.value:.3f}.")
        + (f" The level does not say the same ({100 * apart.mean_share:+.1f} % to the scale)." if apart and mood != "ok" else ""),
    )  # fmt: skip


def _energy(run: RunNumbers, settings: TherapySettings) -> Iterator[Check]:
    battery = run.battery
    if battery is None or battery.runtime.value is None:
        return
    runtime, needed = battery.runtime.value, settings.therapy_duration
    doubt = battery.runtime.std_error or 0.0
    margin = runtime / needed - 1.0
    mood: Mood = (
        "ok" if runtime - _SURE * doubt > needed else "rejected" if runtime + _SURE * doubt < needed else "warning"
    )
    word = {"ok": "enough", "rejected": "too little", "warning": "barely"}[mood]
    found, allowed = f"{runtime / HOUR:.2f} h, margin {100 * margin:+.1f} %", f"{needed / HOUR:g} h or more"
    yield Check(
        run.run, "time that a full battery lasts", found, allowed, word, mood,
        f"A full battery lasts {found} of the {needed / HOUR:g} h asked for: {word}.",
    )  # fmt: skip


def _membrane(run: RunNumbers) -> Iterator[Check]:
    found = run.membrane
    if found is None or found.decline.value is None or found.decline.ci95 is None:
        return
    low, high = found.decline.ci95
    a = found.decline.value
    told = f"a = {a:.3f} ({low:.3f} to {high:.3f})"
    if not found.excludes_zero:
        yield Check(
            run.run, "trend of the membrane's coefficient", told, "none on saline", "none seen", "ok",
            f"The membrane's coefficient shows no trend: {told} does not exclude 0.",
        )  # fmt: skip
        return
    what = "declines" if a > 0 else "rises"
    yield Check(
        run.run, "trend of the membrane's coefficient", told, "none on saline", what, "warning",
        f"The membrane's coefficient {what}: {told} excludes 0.",
    )  # fmt: skip


def _alarms(run: RunNumbers) -> Iterator[Check]:
    alarms = run.alarms
    if alarms is None or (alarms.undetermined and not alarms.comparison.rows):
        return
    rows = alarms.comparison.rows
    if not alarms.comparison.logged_any and alarms.alarms:
        due = counted(len(alarms.alarms), "alarm")
        yield Check(
            run.run, _ALARMS, f"{due} due", "match", "not checkable", "unsaid",
            f"By the pressures and flags {due} would be due; the log lists no codes (alarm_code) to hold them against.",
        )  # fmt: skip
        return
    if not rows:
        yield Check(
            run.run, _ALARMS, "none due, none logged", "match", "match", "ok", "No alarm was due and none was logged."
        )  # fmt: skip
        return
    by = {word: [row.code for row in rows if row.verdict == word] for word in ("match", "late", "missed", "extra")}
    raised = len(rows) - len(by["extra"])
    words = {"late": "late", "missed": "due but not logged", "extra": "logged without a cause in the log"}
    odd = [f"{words[kind]}: {listing(codes, 6)}" for kind, codes in by.items() if kind != "match" and codes]
    found = f"{len(by['match'])} of {raised} due match" + (f"; {'; '.join(odd)}" if odd else "")
    mood: Mood = "ok" if not odd else "rejected" if by["missed"] else "warning"
    yield Check(
        run.run, _ALARMS, found, "match", "match" if not odd else "do not match", mood,
        f"Re-derived alarms beside the log: {found}.",
    )  # fmt: skip


def _circulation(run: RunNumbers) -> Iterator[Check]:
    alone = run.alarms.uf_alone if run.alarms else ()
    if not alone:
        return
    volume = sum(one.volume for one in alone if math.isfinite(one.volume))
    sure = any(one.certain for one in alone)
    seconds = sum(one.end - one.start for one in alone)
    first, last = min(one.start for one in alone), max(one.end for one in alone)
    found = f"{seconds:.0f} s, {volume / ML:.1f} mL"
    yield Check(
        run.run, _CIRCULATION, found, "none", "stop condition" if sure else "suspected",
        "rejected" if sure else "warning",
        f"UF without circulation: the blood pump stands and ultrafiltrate is drawn, {found}, from {first:.0f} s on: a stop condition"
        + ("." if sure else ", by the set rate alone."),
        (first, last),
    )  # fmt: skip


def _units(run: RunNumbers) -> Iterator[Check]:
    taps = run.alarms.redundancy if run.alarms else ()
    if not taps:
        return
    odd = {tap.tap: len(tap.mismatches) for tap in taps if tap.mismatches}
    found = ", ".join(f"{n} at {tap}" for tap, n in odd.items()) or "no mismatch"
    yield Check(
        run.run, _UNITS, found, "no mismatch", "disagree" if odd else "agree", "warning" if odd else "ok",
        f"Control and protective unit disagree: {found}." if odd else "Control and protective unit agree.",
    )  # fmt: skip
