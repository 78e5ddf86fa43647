"""Every synthetic rig refuses what it does not have, in words."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.registry import all_experiments

EXPERIMENTS = sorted(name for name in all_experiments() if not name.startswith("spring."))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_unknown_parameter_is_refused_with_those_there_are(name: str) -> None:
    with pytest.raises(InputError, match=r"has no parameter .no_such_thing.\..*It has "):
        all_experiments()[name].synthesize({"no_such_thing": 1.0}, 1)


@pytest.mark.parametrize(
    ("name", "overrides", "message"),
    [
        ("mre.step", {"duration": "long"}, "'duration' of the synthetic step test is 'long'; expected a number"),
        ("gearbox.load_exchange", {"J_L": float("nan")}, "'J_L' of the synthetic gearbox is nan"),
        ("tpjb.dynamic", {"swap_uv": 3}, "'swap_uv' of the synthetic bearing rig is 3; expected true or false"),
        ("tpjb.dynamic", {"bench": {"hight": 1.0}}, "has no parameter 'hight'"),
        ("tpjb.rotating", {"turns": True}, "'turns' .* is True; expected a number"),
    ],
)
def test_a_word_in_place_of_a_number_is_refused(name: str, overrides: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        all_experiments()[name].synthesize(overrides, 1)


def test_a_number_of_numpy_is_a_number() -> None:
    runs = all_experiments()["mre.step"].synthesize({"duration": np.float64(12.0)}, 1)
    assert runs[0].streams
