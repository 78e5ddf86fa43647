"""The words on a side wall become metres."""

import math

import pytest

from pipeline.errors import InputError
from pipeline.rigs.tire.tire_size import tire_size


@pytest.mark.parametrize(
    "text",
    ["245/40R18", "245/40 R18", "245/40 ZR 18 97Y", "P245/40R18", " 245 / 40 r 18", "245/40ZR18 (97Y) XL", "245/40-18"],
)
def test_spellings_of_one_size_agree(text):
    size = tire_size(text)
    # 18 x 25.4 mm + 2 x 0.40 x 245 mm; circumference 2.0521 m.
    assert size.diameter == pytest.approx(0.6532, abs=1e-9)
    assert size.radius == pytest.approx(0.3266, abs=1e-9)
    assert 2 * math.pi * size.radius == pytest.approx(2.0521, abs=5e-5)


@pytest.mark.parametrize(
    ("text", "radius"),
    [
        ("205/55R16", 0.31595),
        ("195/65 R 15 91H", 0.31725),
        ("LT265/70R17", 0.4014),
        ("195R14", None),
        ("225/75R17.5", 0.3910),
    ],
)
def test_other_sizes(text, radius):
    if radius is None:
        with pytest.raises(InputError, match="'195R14' is no tire size"):
            tire_size(text)
    else:
        assert tire_size(text).radius == pytest.approx(radius, abs=5e-5)


@pytest.mark.parametrize("text", ["", "big", "245/40R180", "245/4R18", "945/40R18", "245/40R99", 18.0, None])
def test_what_is_no_size_is_refused_with_an_example(text):
    with pytest.raises(InputError, match="245/40R18"):
        tire_size(text, "run 'r1', tire_size")
