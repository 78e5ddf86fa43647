"""What is wrong with a log is named, and nothing that is not (tire.md, section 8)."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.rigs.tire.passages.device import device_of
from pipeline.rigs.tire.passages.passage_faults import course_of, passage_findings
from pipeline.rigs.tire.passages.revolutions import joined, revolutions_of
from pipeline.rigs.tire.passages.waveform import averaged
from pipeline.rigs.tire.synthetic import rig
from pipeline.rigs.tire.synthetic.motion import Motion
from pipeline.rigs.tire.synthetic.rig import synthesize_bench
from pipeline.rigs.tire.synthetic.runs import VARIANTS
from pipeline.rigs.tire.synthetic.truth import road_truth

SAID = {
    "debond": ("error", "flex sensor amplitude fell by 45% at t = 1"),
    "broken": ("error", "reads an end of its range from t = 12.0 s on"),
    "gated": ("warning", "gated log: baseline not recorded"),
    "swapped": ("error", "channels look swapped"),
    "polarity": ("warning", "flex polarity inverted: the peaks point down; R2 is mirrored"),
    "divider": ("warning", "because the sensor is in the divider's upper leg"),
    "saturated": ("warning", "PVDF clipped in"),
    "loss": ("warning", "of the packets lost"),
    "packet_id": ("warning", "radio packet id of 2 bits cannot count losses"),
    "sag": ("warning", "ratiometric reference missing"),
    "drift": ("warning", "R0 drifts by +"),
    "once_per_rev": ("warning", "first harmonic of R2"),
    "mains": ("warning", "mains hum of 29"),
    "speed": ("warning", "speed not constant"),
}


def driven(corners, seed=1, **truth):
    """Return the log of a drive with the given corners of the speed, which may be 0, and its motion."""
    known = road_truth({"pulses": (), "duration": float(corners[-1][0]), **truth})
    time = np.arange(int(known.duration * known.rate)) / known.rate
    speed = np.interp(time, *np.transpose(corners))
    angle = 1.0 + np.cumsum(speed) / known.rate / known.R
    motion = Motion(time, speed, angle, np.full(time.size, 3500.0), np.zeros(time.size))
    device = rig._device(known, motion, np.random.default_rng(seed))
    return Recording("drive", {"device": device}, rig._conditions(known, {"bench_or_road": "road"})), motion


@cache
def judged(**truth):
    (recording,) = synthesize_bench({"runs": [], **truth}, 1)
    device = device_of(recording)
    found = joined(revolutions_of(device))
    try:
        waveform = averaged(found)
    except InputError:
        waveform = None
    return found, waveform, passage_findings(device, course_of([found]), waveform)


@pytest.mark.parametrize("variant", VARIANTS)
def test_each_fault_is_named_and_no_other(variant):
    _, _, findings = judged(variants=(variant,))
    loud = [(finding.level, finding.message) for finding in findings if finding.level != "note"]
    if variant not in SAID:
        assert loud == []
        return
    level, message = SAID[variant]
    assert [entry[0] for entry in loud] == [level]
    assert message in loud[0][1]


@pytest.mark.parametrize("name", ["load_1000", "load_3000", "speed_05", "speed_20"])
def test_a_sound_run_is_not_blamed(name):
    assert [f for f in judged(runs=(name,))[2] if f.level != "note"] == []


@pytest.mark.parametrize(
    ("truth", "swing"),
    [
        ({"runs": ("free_spin",)}, "mV only"),
        ({"runs": ("free_spin",), "once_per_rev": 2000.0}, "without three regular peaks"),
    ],
)
def test_an_unloaded_wheel_has_no_passages(truth, swing):
    found, waveform, findings = judged(**truth)
    assert len(found) == 0
    assert waveform is None
    (finding,) = findings
    assert finding.level == "error"
    assert "no revolution found in 20.0 s" in finding.message
    assert swing in finding.message


@pytest.mark.parametrize("variant", ["polarity", "divider"])
def test_a_sensor_that_is_mounted_the_other_way_gives_the_same_waveform(variant):
    right, turned = judged(runs=("load_2000",))[1], judged(variants=(variant,))[1]
    assert turned.skewness == pytest.approx(right.skewness, abs=0.05)
    assert turned.change.max() == pytest.approx(right.change.max(), rel=5e-3)
    assert turned.level == pytest.approx(1e4, rel=2e-3)


def test_a_gated_log_has_no_level_of_its_own_but_a_peak():
    found, waveform, _ = judged(variants=("gated",))
    assert np.isnan(waveform.level)
    assert np.mean(waveform.count > 0) < 0.6
    assert len(found) == 26


def test_a_missing_film_is_noted():
    (recording,) = synthesize_bench({"runs": ["load_2000"], "duration": 8.0}, 1)
    del recording.streams["device"].channels["pvdf_code"]
    device = device_of(recording)
    found = joined(revolutions_of(device))
    assert found.film is None
    (finding,) = passage_findings(device, found, None)
    assert finding.level == "note"
    assert "no PVDF film" in finding.message


def test_passages_lost_in_a_silence_are_put_between_their_neighbours():
    found, _, findings = judged(runs=("load_2000",), silence=(8.0, 9.8))
    assert 2 <= found.repaired.sum() <= 3
    assert np.std(np.diff(found.times)) < 5e-3
    assert not found.whole[found.repaired].any()
    assert any("lost in gaps" in finding.message for finding in findings)


def test_a_gain_that_drifts_while_the_film_does_not_is_named():
    findings = judged(runs=("load_2000",), gain_drift=-0.2)[2]
    assert [f.level for f in findings] == ["warning"]
    assert "amplitude drifts by -19%" in findings[0].message or "amplitude drifts by -18%" in findings[0].message


def test_a_speed_that_halves_within_a_run_is_followed_and_named():
    recording, _ = driven([(0, 2.8), (8, 2.8), (8.4, 1.4), (16, 1.4)])
    bench = replace(recording, conditions={**recording.conditions, "bench_or_road": "bench"})
    device = device_of(bench)
    found = joined(revolutions_of(device))
    assert found.speed[-1] == pytest.approx(1.4 / 0.3171, rel=5e-3)
    loud = [f.message for f in passage_findings(device, found, None) if f.level != "note"]
    assert len(loud) == 1
    assert "speed not constant" in loud[0]


@pytest.mark.parametrize("height", [4095.0, 300.0])
def test_spikes_of_single_samples_do_not_break_the_chain(height):
    (recording,) = synthesize_bench({"runs": ["load_2000"], "duration": 10.0}, 1)
    codes = recording.values("flex_code")
    at = np.random.default_rng(1).integers(10, codes.size - 10, 40)
    codes[at] = np.clip(codes[at] + height, 0.0, 4095.0)
    device = device_of(recording)
    found = joined(revolutions_of(device))
    assert len(found) == 12
    assert found.whole.all()
    assert any("spikes of single samples left out" in f.message for f in passage_findings(device, found, None))
