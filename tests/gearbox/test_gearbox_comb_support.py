"""An input speed from mesh lines is believed where the lines are those of the stated gears, and not where others fit as well."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.gearbox.model.teeth import teeth_of
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.vibration.mesh import input_speed
from pipeline.rigs.gearbox.vibration.sos_speed import line_orders

TABLE_1 = "60 20 100; 12 44 100"
OTHERS = ("60 20 100; 20 40 100", "48 24 96; 24 36 96")
NOMINAL, TRUE = 12.566, 12.3


def tones(lines, rate=2500.0, duration=9.0, noise=0.5, speed=TRUE, seed=0):
    """Vibration with lines of (order, amplitude)."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 1 / rate)
    waves = sum(a * np.sin(k * speed * t + rng.uniform(0, 6.28)) for k, a in lines)
    return t, {"acc": waves + noise * rng.normal(size=t.size)}


def found_with(lines, teeth=TABLE_1, **options):
    t, channels = tones(lines, **options)
    return input_speed(t, channels, (0.0, 9.0), NOMINAL, line_orders(teeth_of(teeth)))


def solved(stated, actual=TABLE_1):
    """Numbers of a run whose box has the `actual` teeth and whose conditions state others, or none."""
    (recording,) = synthesize({"runs": ["g3"], "teeth": actual}, 4)
    conditions = {**recording.conditions, "teeth": stated}
    if stated is None:
        del conditions["teeth"]
    return numbers_of(record_of(replace(recording, conditions=conditions)))


@pytest.mark.parametrize(
    ("stated", "actual"), [*((one, TABLE_1) for one in OTHERS), *((TABLE_1, one) for one in OTHERS)]
)
def test_wrong_teeth_find_no_input_speed(stated, actual):
    speed = solved(stated, actual).speed_in
    assert speed.source == "nominal"
    assert np.isnan(speed.std_error)


def test_another_box_without_stated_teeth_is_told_and_not_measured():
    speed = solved(None, OTHERS[1]).speed_in
    assert speed.source == "nominal"
    assert "assumed since the run states none" in speed.why


def test_the_papers_box_without_stated_teeth_is_measured_and_the_assumption_told():
    speed = solved(None).speed_in
    assert speed.source == "mesh lines"
    assert speed.teeth_assumed
    assert "assumed" in speed.told
    assert not solved(TABLE_1).speed_in.teeth_assumed


def test_lines_of_both_trains_are_believed_beside_a_stronger_line_of_something_else():
    found = found_with([(40, 1.0), (80, 0.4), (140, 0.7), (63.7, 3.0)])
    assert found.support.trains == 2
    assert found.support.doubt == ""
    assert found.speed == pytest.approx(TRUE, rel=1e-4)


def test_one_train_is_believed_alone_but_not_beside_strong_lines_of_others():
    alone = found_with([(140, 1.0), (280, 0.4), (138, 0.3), (142, 0.3)])
    assert alone.support.trains == 1
    assert alone.support.doubt == ""
    assert alone.support.weak
    beside = found_with([(140, 1.0), (280, 0.4), (63.7, 1.0)])
    assert beside.support.unexplained[0] == pytest.approx(63.7 * TRUE / (2 * np.pi), abs=0.5)
    assert "do not explain" in beside.support.doubt


def test_one_train_that_tells_more_speed_under_load_than_without_is_not_believed():
    assert "faster under load" in found_with([(144, 1.0), (288, 0.4)]).support.doubt


def test_a_train_beyond_the_band_is_no_evidence_against_the_teeth_and_may_fold_back():
    found = found_with([(40, 1.0), (80, 0.4), (140, 0.7)], rate=400.0)
    assert found.support.hidden
    assert found.support.doubt == ""
    assert not found.support.weak


def test_trains_with_the_same_lines_count_as_one():
    """Here the mesh of train 2 is the third harmonic of train 1: one series, which any gear has."""
    teeth = "12 42 96; 48 24 96"
    assert line_orders(teeth_of(teeth)) == (48.0, 96.0, 144.0, 288.0)
    assert found_with([(48, 1.0), (96, 0.5), (144, 0.4), (288, 0.2)], teeth).support.trains == 1
