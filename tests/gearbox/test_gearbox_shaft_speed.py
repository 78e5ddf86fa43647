"""A wrong encoder resolution or unit of speed is found from what does not depend on the encoder, or not claimed at all."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.check import check
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.vibration.shaft_speed import by_mesh, by_ripple, mistake, true_speed

RUNS = ("g1", "g3", "g8")
# The rule is one for all runs: the first stands for them where each costs seconds.
FEW_RUNS = [RUNS[0], *(pytest.param(run, marks=pytest.mark.thorough) for run in RUNS[1:])]


def log(run: str, vibration: bool, **conditions: float) -> Recording:
    (recording,) = synthesize({"runs": (run,), "vibration": vibration}, 3)
    kept = {name: value for name, value in recording.conditions.items() if name != "speed_nominal"}
    return replace(recording, conditions={**kept, **conditions})


def with_speed(recording: Recording, factor: float) -> Recording:
    time, counts = recording.signal("encoder_count_out")
    speed = factor * np.gradient(counts, time) * 2 * np.pi / 512
    stream = Stream("encoder", time, {"speed_out": Channel("speed_out", speed, "rad/s")})
    return replace(recording, streams={**recording.streams, "encoder": stream})


def refused(recording: Recording) -> str:
    with pytest.raises(InputError) as caught:
        identify([recording], LoadExchangeSettings(), Context("test", {}))
    said = [finding.message for finding in check(recording) if finding.level == "error"]
    assert said[0].rstrip(".")[:60] in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("run", FEW_RUNS)
@pytest.mark.parametrize("vibration", [True, False])
@pytest.mark.parametrize("ppr", [1024.0, 32.0])
@pytest.mark.thorough
def test_wrong_pulses_per_turn_are_named_without_a_nominal_speed(run, vibration, ppr):
    said = refused(log(run, vibration, encoder_ppr=ppr))
    assert "is wrong by that factor; 512 fits" in said
    assert "ripple" in said or "mesh lines" in said


@pytest.mark.parametrize("run", FEW_RUNS)
@pytest.mark.parametrize(("factor", "unit"), [(30 / np.pi, "rpm"), (0.5 / np.pi, "Hz")])
def test_a_speed_in_another_unit_is_named_without_a_nominal_speed(run, factor, unit):
    assert f"the speed is in {unit} and not in rad/s" in refused(with_speed(log(run, False), factor))


@pytest.mark.parametrize("run", FEW_RUNS)
def test_a_sound_encoder_is_left_alone(run):
    numbers = numbers_of(record_of(log(run, True)))
    assert by_ripple(numbers.run, numbers.torques.steady).factor == 1.0
    assert by_mesh(numbers.record, numbers.run).factor == pytest.approx(0.98, abs=0.02)
    assert true_speed(numbers.record, numbers.run, numbers.torques.steady) is None


def test_without_ripple_and_vibration_nothing_is_claimed():
    (recording,) = synthesize({"runs": ("g3",), "vibration": False, "ripple_in": 0.0, "ripple_out": 0.0}, 3)
    kept = {name: value for name, value in recording.conditions.items() if name != "speed_nominal"}
    numbers = numbers_of(record_of(replace(recording, conditions={**kept, "encoder_ppr": 32.0})))
    assert true_speed(numbers.record, numbers.run, numbers.torques.steady) is None


def test_a_nominal_speed_that_bears_the_encoder_out_leaves_a_warning():
    recording = log("g3", False, encoder_ppr=32.0, speed_nominal=4 * 12.566)
    findings = identify([recording], LoadExchangeSettings(), Context("test", {}))
    assert findings.verdict == "warning"
    assert any("yet speed_nominal bears the encoder out" in q.message for q in findings.quality)


@pytest.mark.parametrize(("factor", "known"), [(0.98, 1.0), (0.122, 0.125), (1.95, 2.0), (0.78, None), (3.0, None)])
def test_only_known_mistakes_have_a_name(factor, known):
    assert mistake(factor) == known
