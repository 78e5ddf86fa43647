"""R6 of the fact sheet: six faults, two pauses, two mismatches, on the whole synthetic rig."""

import numpy as np
import pytest

from pipeline.rigs.rap.alarms import alarm_numbers
from pipeline.rigs.rap.synthetic.rig import synthesize_therapy

# When each fault sets in, s of the bench; the device starts 3.37 s late and runs 40 ppm slow.
ONSET = {
    "ACCESS_OCCLUDED": 200.0, "FILTER_COAGULATION": 330.0, "RETURN_OCCLUDED": 460.0, "RETURN_DISCONNECTED": 590.0,
    "ACCESS_DISCONNECTED": 720.0, "MEMBRANE_COAGULATION": 850.0,
}  # fmt: skip


def _bench(time):
    return time * (1.0 + 40e-6) + 3.37


@pytest.fixture(scope="module", params=[0, 1, 2])
def found(request):
    return alarm_numbers(synthesize_therapy({"runs": ["rap_faults"]}, request.param)[0])


def test_all_six_faults_are_found_without_a_cross_alarm(found):
    pressures = [alarm.code for alarm in found.alarms if alarm.code in ONSET]
    assert pressures == list(ONSET)
    others = {alarm.code for alarm in found.alarms} - set(ONSET)
    assert others == {"PROLONGED_STAGNATION", "SENSOR_MISMATCH"}


def test_delays_are_those_of_the_fact_sheet(found):
    delay = {a.code: _bench(a.time) - ONSET[a.code] for a in found.alarms if a.code in ONSET}
    membrane = delay.pop("MEMBRANE_COAGULATION")
    assert 1.3 <= np.mean(list(delay.values())) <= 1.8
    assert all(1.2 <= value <= 1.95 for value in delay.values())
    assert membrane == pytest.approx(4.1, abs=0.3)


def test_standstill_is_told_at_120_s_of_the_long_pause_only(found):
    stagnation = [alarm for alarm in found.alarms if alarm.code == "PROLONGED_STAGNATION"]
    assert len(stagnation) == 1
    assert stagnation[0].time - stagnation[0].began == pytest.approx(120.05, abs=0.06)
    assert _bench(stagnation[0].began) == pytest.approx(1200.0, abs=0.1)


def test_every_alarm_stands_in_the_log(found):
    assert {row.verdict for row in found.comparison.rows} == {"match"}
    assert found.false_alarms.count == 0


def test_both_mismatches_are_found_with_kind_and_size(found):
    by_tap = {pair.tap: pair.mismatches for pair in found.redundancy}
    assert by_tap["access"] == by_tap["uf"] == ()
    step, drift = by_tap["prefilter"][0], by_tap["return"][0]
    assert (step.kind, drift.kind) == ("step", "drift")
    assert step.size == pytest.approx(500.0, rel=0.03)
    assert drift.size == pytest.approx(5.0, rel=0.05)
    assert step.delay == pytest.approx(0.15, abs=0.1)
    assert drift.delay == pytest.approx(10.0, abs=1.5)


@pytest.mark.parametrize(
    "truth", [{"device_rate": 10.0}, {"blood_flow": 100e-6 / 60.0, "uf_flow": 2e-6 / 60.0}, {"skew": 0.025}]
)
def test_other_rigs_are_judged_alike(truth):
    found = alarm_numbers(synthesize_therapy({"runs": ["rap_faults"], **truth}, 4)[0])
    assert [alarm.code for alarm in found.alarms if alarm.code in ONSET] == list(ONSET)
    assert {row.verdict for row in found.comparison.rows} == {"match"}


def test_a_device_that_stops_its_pumps_is_followed():
    found = alarm_numbers(synthesize_therapy({"runs": ["rap_faults"], "alarm_reaction": True}, 5)[0])
    assert [alarm.code for alarm in found.alarms if alarm.code in ONSET] == list(ONSET)
    assert {row.verdict for row in found.comparison.rows} == {"match"}
    # What the pump's stop takes out of sight stays an alarm until it runs again.
    spans = [s.end - s.start for s in found.states if s.state == "ALARM" and "baseline" in s.reason]
    assert len(spans) == len(ONSET)
    assert min(spans) > 25.0


def test_an_hour_without_faults_raises_nothing():
    sound = {"runs": ["rap_therapy_312"], "duration": 3600.0}
    found = alarm_numbers(synthesize_therapy(sound, 6)[0])
    assert found.alarms == ()
    assert all(pair.mismatches == () and pair.false_kept.count == 0 for pair in found.redundancy)
    assert found.false_alarms.upper95 == pytest.approx(3.0, rel=0.01)
    assert max(found.ratios.noise.values()) < 0.012
