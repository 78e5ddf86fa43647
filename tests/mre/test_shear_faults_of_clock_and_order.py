"""A late force is told from a wrong sign and from swapped channels; a trend over the runs is told with its order."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from faulty_logs import assert_numbers_hold, changed, in_all, left_out, said, with_conditions
from faulty_logs import identify as identify_with
from scipy.signal import butter, lfilter

from pipeline.findings import Findings
from pipeline.recording import Provenance, Recording
from pipeline.rigs.mre.shear.declaration import SHEAR

RATE = 1000.0


def identify(recordings: Iterable[Recording], **settings: object) -> Findings:
    return identify_with(recordings, starts=1, **settings)


@pytest.fixture(scope="module")
def campaign() -> list[Recording]:
    return SHEAR.synthesize({"duration": 1.5, "rate": RATE, "preload_runs": False, "currents": [0.0, 3.0, 6.0]}, 6)


def shifted(recording: Recording, seconds: float) -> Recording:
    """Return the recording with its force late by that much; where the log ends, the rows that lack one do too."""
    whole = round(abs(seconds) * RATE)
    early, late = slice(None, -whole), slice(whole, None)
    (stream,) = recording.streams.values()
    channels = {
        name: replace(c, values=c.values[(early if seconds > 0 else late) if name == "force" else (late if seconds > 0 else early)])
        for name, c in stream.channels.items()
    }  # fmt: skip
    time = stream.time[: stream.time.size - whole]
    return replace(recording, streams={stream.name: replace(stream, time=time, channels=channels)})


def told(findings: Findings) -> list[str]:
    return [*left_out(findings).values(), *findings.reasons, *(q.message for q in findings.quality)]


# Late, wrong sign, swapped


def test_a_force_that_is_late_in_all_runs_is_called_late_by_its_milliseconds_and_no_sign_is_advised(
    campaign: list[Recording],
) -> None:
    findings = identify(shifted(r, 5e-3) for r in campaign)
    assert findings.verdict == "rejected"
    assert len(left_out(findings)) == len(campaign)
    late = next(float(text.split("late by about ")[1].split()[0]) for text in told(findings) if "late by about" in text)
    assert late == pytest.approx(5.0, abs=0.6)
    assert not any("sign: -1" in text or "swapped" in text for text in told(findings))


def test_a_low_pass_of_the_force_alone_is_called_late_and_may_be_a_filter(campaign: list[Recording]) -> None:
    def filtered(_: np.ndarray, F: np.ndarray) -> np.ndarray:
        return np.asarray(lfilter(*butter(2, 60, fs=RATE), F))

    findings = identify(in_all(campaign, "force", filtered))
    assert findings.verdict == "rejected"
    # The delay of such a filter at low frequency is sqrt(2) / (2 pi 60 Hz) = 3.75 ms.
    assert any("late by about 3." in text and "a filter" in text for text in told(findings))
    assert not any("sign: -1" in text for text in told(findings))


def test_an_offset_of_the_clocks_of_one_run_is_told_as_late_or_early_and_not_as_a_sign(
    campaign: list[Recording],
) -> None:
    run = next(r for r in campaign if r.run == "sh_10hz_3a")
    (reason,) = left_out(identify([shifted(run, 0.02)])).values()
    late, early = (float(part.split()[0]) for part in reason.split(" by about ")[1:])
    assert late == pytest.approx(20, abs=3)
    assert early == pytest.approx(80, abs=3)  # of a period of 100 ms
    assert "sign: -1" not in reason


def test_a_phase_near_180_degrees_at_one_frequency_may_be_half_a_period_as_well(campaign: list[Recording]) -> None:
    run = next(r for r in campaign if r.run == "sh_10hz_3a")
    (reason,) = left_out(identify([shifted(run, 0.05)])).values()
    assert "sign: -1" in reason
    assert "clocks are offset by about half a period (50 ms)" in reason


def test_a_known_lag_turns_the_loops_right_again(campaign: list[Recording]) -> None:
    late = [shifted(r, 5e-3) for r in campaign]
    findings = identify(late, force_lag=5e-3 + 60e-6)
    assert not left_out(findings)
    assert_numbers_hold(findings)


def test_a_wrong_sign_of_several_runs_is_near_180_degrees_at_every_frequency(campaign: list[Recording]) -> None:
    wrong = {"sh_5hz_0a", "sh_15hz_3a", "sh_10hz_6a"}
    findings = identify(changed(r, "force", lambda _, F: -F) if r.run in wrong else r for r in campaign)
    assert set(left_out(findings)) == wrong
    assert all("sign: -1" in reason and "deg" in reason for reason in left_out(findings).values())
    assert_numbers_hold(findings)


def test_one_late_run_among_good_ones_leaves_them_alone(campaign: list[Recording]) -> None:
    findings = identify(shifted(r, 8e-3) if r.run == "sh_15hz_3a" else r for r in campaign)
    assert set(left_out(findings)) == {"sh_15hz_3a"}
    reason = left_out(findings)["sh_15hz_3a"]
    assert float(reason.split("late by about ")[1].split()[0]) == pytest.approx(8.0, abs=1.0)
    assert "sign: -1" not in reason
    assert_numbers_hold(findings)


def test_an_early_force_is_early_in_every_sentence(campaign: list[Recording]) -> None:
    findings = identify(shifted(r, -1e-3) for r in campaign)
    assert said(findings, "us early against the displacement")
    assert not said(findings, "taken for a delay")
    for text in told(findings):
        assert "us late" not in text
    assert any(
        "us early is taken for" in reason and "filter of the displacement" in reason for reason in findings.reasons
    )


# Trend


def heating(recordings: list[Recording], order: Callable[[int], int], share: float) -> list[Recording]:
    """Runs whose force falls by `share` per run; `order` says which place run i had."""
    return [changed(r, "force", lambda _, F, i=i: F * (1 - share * order(i))) for i, r in enumerate(recordings)]


def size_of(reason: str) -> float:
    """Return the change that is told (%), which must be known to better than 0.5 %."""
    value, error = reason.split("changes by ")[1].split(" %)")[0].split(" % (standard error ")
    assert 0 < float(error) < 0.5
    return float(value)


def test_a_trend_in_the_order_of_names_is_told_with_its_size_and_no_mounting_is_blamed(
    campaign: list[Recording],
) -> None:
    named = [replace(r, run=f"r{i}") for i, r in enumerate(campaign)]
    findings = identify(heating(named, lambda i: i, 0.004))
    assert findings.verdict == "warning"
    assert not left_out(findings)
    reason = next(r for r in findings.reasons if "Stiffness changes by" in r)
    assert size_of(reason) == pytest.approx(-3.2, abs=0.6)
    assert "order of their names" in reason
    assert "heating, Mullins" in reason
    assert not said(findings, "mounting")


@pytest.mark.thorough
def test_the_order_is_that_of_the_times_at_which_the_logs_begin(campaign: list[Recording]) -> None:
    # Made in another order than that of the names.
    made = [4, 0, 7, 2, 8, 5, 1, 6, 3]
    dated = [
        replace(r, provenance=Provenance(begins=1.7e9 + 3600 * place)) for r, place in zip(campaign, made, strict=True)
    ]
    findings = identify(heating(dated, lambda i: made[i], 0.003))
    reason = next(r for r in findings.reasons if "Stiffness changes by" in r)
    assert size_of(reason) == pytest.approx(-2.4, abs=0.3)
    assert "times at which the logs begin" in reason


@pytest.mark.thorough
def test_a_trend_too_large_for_scatter_is_told_of_a_rejected_fit_as_well(campaign: list[Recording]) -> None:
    numbered = [with_conditions(r, sequence_index=float(i)) for i, r in enumerate(campaign)]
    findings = identify(heating(numbered, lambda i: i, 0.02))
    assert findings.verdict != "ok"
    reason = next(r for r in findings.reasons if "Stiffness changes by" in r)
    assert -18 < float(reason.split("changes by ")[1].split()[0]) < -14
    assert "sequence_index" in reason


@pytest.mark.thorough
def test_scatter_without_order_is_no_trend() -> None:
    recordings = SHEAR.synthesize({"duration": 1.0, "rate": RATE, "preload_runs": False, "gain_scatter": 0.008}, 8)
    assert not said(identify(recordings), "Stiffness changes")
