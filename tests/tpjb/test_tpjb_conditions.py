"""Lists of numbers, pad directions and run groups."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.tpjb.conditions import (
    n_pads_of,
    numbers_of,
    operating_point,
    pad_angles_of,
    run_groups,
    static_load_of,
)


def recording(name: str = "r", force_static: float | None = None, **conditions: float | str) -> Recording:
    t = np.arange(10.0)
    values = {} if force_static is None else {"force_static": Channel("force_static", t * 0 + force_static, "N")}
    return Recording(name, {"log": Stream("log", t, values)}, conditions)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("7 11 13 Hz", (7, 11, 13)),
        ("7, 11, 13", (7, 11, 13)),
        ("[7,11,13] Hz", (7, 11, 13)),
        ("7;11;13Hz", (7, 11, 13)),
        ("7Hz 11Hz", (7, 11)),
        ("7,5 11,2 Hz", (7.5, 11.2)),
        ("7,5; 11,2", (7.5, 11.2)),
        ("0.007 0.011 kHz", (7, 11)),
        ("60 120 rpm", (1, 2)),
        (7.0, (7,)),
        ("1e1 Hz", (10,)),
    ],
)
def test_numbers_are_read_as_people_write_them(text: str | float, numbers: tuple[float, ...]) -> None:
    np.testing.assert_allclose(numbers_of(text, "Hz"), numbers)


@pytest.mark.parametrize("text", ["", "none", "7 to 11 Hz or so", "7 Hz 11 rpm", "7 11 kg", True])
def test_what_is_no_list_of_numbers_is_said_with_run_and_text(text: str) -> None:
    with pytest.raises(InputError, match="r1"):
        numbers_of(text, "Hz", run="r1", name="excitation_tones")


def test_pads_stand_with_the_load_between_two_of_them_unless_told() -> None:
    found = pad_angles_of(recording(n_pads=5.0))
    assert found is not None
    np.testing.assert_allclose(np.degrees(found), [18, 90, 162, 234, 306])
    told = pad_angles_of(recording(pad_angles="0 90 180 270 deg"))
    assert told is not None
    np.testing.assert_allclose(np.degrees(told), [0, 90, 180, 270])
    assert pad_angles_of(recording()) is None


@pytest.mark.parametrize("bad", ["45 135 225 315", "10 20 30 deg", "45 135 deg"])
def test_impossible_pad_angles_are_refused(bad: str) -> None:
    with pytest.raises(InputError, match="pad_angles"):
        pad_angles_of(recording(pad_angles=bad))


def test_angles_that_contradict_the_number_of_pads_are_refused() -> None:
    with pytest.raises(InputError, match="n_pads"):
        pad_angles_of(recording(pad_angles="45 135 225 315 deg", n_pads=5.0))
    with pytest.raises(InputError, match="n_pads"):
        n_pads_of(recording(n_pads=4.5))


def test_static_load_is_the_condition_or_else_what_the_cell_shows() -> None:
    assert static_load_of(recording(static_load=4e4, force_static=1.0)) == 4e4
    assert static_load_of(recording(force_static=41e3)) == 41e3
    assert static_load_of(recording()) is None


def test_runs_at_nearly_the_same_load_are_one_group() -> None:
    runs = [
        recording("a", static_load=40e3, shaft_speed_nominal=104.72),
        recording("b", force_static=40.1e3, shaft_speed_nominal=104.7),
        recording("c", static_load=80e3, shaft_speed_nominal=104.7),
        recording("d", static_load=40e3, shaft_speed_nominal=104.7, bearing="5pad"),
    ]
    groups = run_groups(runs)
    assert [[r.run for r in members] for _, members in groups] == [["a", "b"], ["c"], ["d"]]
    assert groups[0][0] == {"static_load": 40e3, "shaft_speed": 104.7}
    assert operating_point(recording()) == {}
