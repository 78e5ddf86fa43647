"""What `rigfit check` and ingest can tell of one recording by the physics of a passive sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear.declaration import SHEAR
from pipeline.rigs.mre.synthetic import synthesize_rich

PADS: Mapping[str, Condition] = {"pad_diameter": 0.05, "pad_height": 0.006, "n_pads": 2.0}
TIME = np.arange(0, 2, 1e-3)


def recording(x: np.ndarray, F: np.ndarray, conditions: Mapping[str, Condition] = PADS) -> Recording:
    channels = {"displacement": Channel("displacement", x, "m"), "force": Channel("force", F, "N")}
    return Recording("run", {"": Stream("", TIME[: x.size], channels)}, conditions)


def loop(phase: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    x = 4e-4 * np.sin(2 * np.pi * 5 * TIME) + 1.5e-6 * rng.standard_normal(TIME.size)
    F = 160 * np.sin(2 * np.pi * 5 * TIME + phase) + rng.standard_normal(TIME.size) + 3.0
    return x, F


def test_a_sound_loop_says_nothing() -> None:
    assert list(SHEAR.check(recording(*loop()))) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x, F: (1e3 * x, F), "mm taken as m"),
        (lambda x, F: (x, 1e3 * F), "MPa"),
    ],
)
def test_units_are_told_from_one_run(change, words) -> None:
    found = list(SHEAR.check(recording(*change(*loop()))))
    assert [finding.level for finding in found] == ["warning"]
    assert words in found[0].message


@pytest.mark.parametrize(
    ("change", "likely"),
    [
        (lambda x, F: (x, -F), "the sign of one of them is wrong"),
        (lambda x, F: (-x, F), "the sign of one of them is wrong"),
        (lambda x, F: (F, x), "they are swapped"),
    ],
)
def test_what_leaves_a_run_out_is_an_error_in_the_words_of_identification(change, likely) -> None:
    run = recording(*change(*loop()))
    found = list(SHEAR.check(run))
    assert [finding.level for finding in found] == ["error"]
    assert likely in found[0].message
    identified = SHEAR.identify([run], SHEAR.settings(), Context("one", {}))
    assert found[0].message in {quality.message for quality in identified.quality}


def test_a_loop_that_gives_energy_is_told() -> None:
    found = list(SHEAR.check(recording(*loop(phase=-0.2))))
    assert len(found) == 1
    assert "wrong way round" in found[0].message


def test_a_damper_and_a_random_record_say_nothing() -> None:
    x, _ = loop()
    velocity = np.gradient(x, TIME)
    assert list(SHEAR.check(recording(x, 900 * np.tanh(velocity / 2e-3), {}))) == []
    assert list(SHEAR.check(synthesize_rich({}, 3, duration=6.0))) == []


@pytest.mark.parametrize("values", [np.zeros(TIME.size), np.full(TIME.size, np.nan)])
def test_a_dead_channel_is_refused_in_the_words_of_identification(values: np.ndarray) -> None:
    x, F = loop()
    for run in (recording(x, values), recording(values, F)):
        with pytest.raises(InputError) as checked:
            SHEAR.check(run)
        with pytest.raises(InputError) as identified:
            SHEAR.identify([run], SHEAR.settings(), Context("one", {}))
        assert str(checked.value) == str(identified.value)


def test_a_few_missing_samples_do_not_matter() -> None:
    x, F = loop()
    F[[5, 100, 900]] = np.nan
    assert list(SHEAR.check(recording(x, F))) == []
    (finding,) = SHEAR.check(recording(x, -F))
    assert "sign: -1" in finding.message
