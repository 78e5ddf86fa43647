"""Foreign names become canonical SI channels; whatever is unclear is asked for with the recipe's line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from memory_log import MemoryTable, Spec, sources_of

from pipeline.errors import InputError
from pipeline.ingest.mapping import ChannelMap, Selection, resolve

FORCE = Spec("force", "N", "shear force on the platelet")
DISPLACEMENT = Spec("displacement", "m", "platelet against core")
CURRENT = Spec("current", "A", "coil current", required=False)
NUMBERS = np.array([1.0, 2.0, 3.0])


def resolved(
    table: MemoryTable | Sequence[MemoryTable], specs: Sequence[Spec], maps: dict[str, ChannelMap] | None = None
) -> tuple[Selection, ...]:
    tables = [table] if isinstance(table, MemoryTable) else table
    return resolve(sources_of(*tables), specs, maps or {})


def si(selection: Selection, name: str) -> np.ndarray:
    (channel,) = [channel for channel in selection.channels if channel.name == name]
    return channel.si(selection.source.table.columns[channel.raw.name])


def refusal(*args: object, **kwargs: object) -> str:
    with pytest.raises(InputError) as caught:
        resolved(*args, **kwargs)
    return str(caught.value)


def test_canonical_names_with_units_need_no_recipe() -> None:
    table = MemoryTable(
        {"time": NUMBERS, "force": NUMBERS, "displacement": NUMBERS}, {"force": "kN", "displacement": "mm"}
    )
    (selection,) = resolved(table, [FORCE, DISPLACEMENT, CURRENT])
    np.testing.assert_allclose(si(selection, "force"), [1000, 2000, 3000], rtol=1e-15)
    np.testing.assert_allclose(si(selection, "displacement"), [1e-3, 2e-3, 3e-3], rtol=1e-15)
    assert [channel.name for channel in selection.channels] == ["force", "displacement"]
    assert selection.left_out == ("time",)
    assert selection.notes == ()


@pytest.mark.parametrize("name", ["Force", "FORCE ", "rig.state.force"])
def test_case_and_nesting_do_not_matter(name: str) -> None:
    (selection,) = resolved(MemoryTable({name: NUMBERS}, {name: "N"}), [FORCE])
    assert selection.channels[0].raw.name == name


@pytest.mark.parametrize("name", ["Force Axial", "force-axial", "FORCE_AXIAL", "msg.Force axial"])
def test_blanks_and_dashes_stand_for_underscores(name: str) -> None:
    (selection,) = resolved(MemoryTable({name: NUMBERS}, {name: "N"}), [Spec("force_axial", "N")])
    assert selection.channels[0].raw.name == name


def test_the_recipe_wins_over_a_channel_of_the_canonical_name() -> None:
    table = MemoryTable({"force": NUMBERS, "Load cell": 10 * NUMBERS}, {"force": "N", "Load cell": "N"})
    (selection,) = resolved(table, [FORCE], {"force": ChannelMap("Load cell")})
    np.testing.assert_allclose(si(selection, "force"), 10 * NUMBERS)
    assert selection.left_out == ("force",)


def test_sign_scale_and_offset_make_a_calibration() -> None:
    table = MemoryTable({"U": NUMBERS}, {"U": "V"})
    entry = ChannelMap("U", unit="kN", sign=-1, scale=2.0, offset=0.5)
    (selection,) = resolved(table, [FORCE], {"force": entry})
    np.testing.assert_allclose(si(selection, "force"), -1000 * (2.0 * NUMBERS + 0.5), rtol=1e-14)
    assert selection.notes == (), "a calibrated voltage is no contradiction"


def test_degrees_celsius_become_kelvin() -> None:
    table = MemoryTable({"T": NUMBERS}, {"T": "°C"})
    (selection,) = resolved(table, [Spec("temperature", "K")], {"temperature": ChannelMap("T")})
    np.testing.assert_allclose(si(selection, "temperature"), NUMBERS + 273.15, rtol=1e-12)


def test_a_recipe_may_copy_the_heading_with_its_unit() -> None:
    (selection,) = resolved(
        MemoryTable({"Kraft": NUMBERS}, {"Kraft": "kN"}), [FORCE], {"force": ChannelMap("Kraft [kN]")}
    )
    assert selection.channels[0].raw.name == "Kraft"


def test_a_missing_channel_is_answered_with_what_the_log_has_and_the_line_to_add() -> None:
    table = MemoryTable({"t": NUMBERS, "Load cell": NUMBERS, "pos": NUMBERS}, {"Load cell": "kN", "pos": "mm"})
    message = refusal(table, [FORCE])
    for part in ("r1.csv", "'force'", "shear force on the platelet", "in N", "'t', 'Load cell' [kN], 'pos' [mm]"):
        assert part in message
    assert 'force: {channel: "Load cell", unit: kN}' in message, "the only channel of that dimension is proposed"


def test_a_wrong_name_in_the_recipe_is_answered_with_the_nearest() -> None:
    table = MemoryTable({"Load cell": NUMBERS, "pos": NUMBERS}, {"Load cell": "kN"})
    message = refusal(table, [FORCE], {"force": ChannelMap("Load cel")})
    assert "Did you mean 'Load cell'?" in message
    assert "'channels'" in message


def test_an_optional_channel_may_be_missing_but_not_one_that_the_recipe_names() -> None:
    table = MemoryTable({"force": NUMBERS}, {"force": "N"})
    assert len(resolved(table, [FORCE, CURRENT])[0].channels) == 1
    assert "'Strom'" in refusal(table, [FORCE, CURRENT], {"current": ChannelMap("Strom")})


def test_a_canonical_name_without_unit_is_si_and_that_is_said() -> None:
    (selection,) = resolved(MemoryTable({"force": NUMBERS}), [FORCE])
    assert si(selection, "force") is selection.source.table.columns["force"]
    (note,) = selection.notes
    assert note.level == "warning"
    assert "taken as N" in note.message
    assert note.channel == "force"


def test_ratios_need_no_unit() -> None:
    (selection,) = resolved(MemoryTable({"slip": NUMBERS}), [Spec("slip", "1")])
    assert selection.notes == ()


def test_a_mapped_channel_without_any_unit_is_asked_for_one() -> None:
    message = refusal(MemoryTable({"D": NUMBERS}), [DISPLACEMENT], {"displacement": ChannelMap("D")})
    assert "has no unit" in message
    assert 'displacement: {channel: "D", unit: m}' in message


def test_the_recipes_unit_wins_over_the_logs_and_that_is_said() -> None:
    table = MemoryTable({"force": NUMBERS}, {"force": "kN"})
    (selection,) = resolved(table, [FORCE], {"force": ChannelMap(unit="N")})
    np.testing.assert_allclose(si(selection, "force"), NUMBERS)
    assert "'kN'" in selection.notes[0].message
    assert "'N'" in selection.notes[0].message


def test_an_impossible_unit_of_the_log_is_refused_with_a_way_out() -> None:
    message = refusal(MemoryTable({"force": NUMBERS}, {"force": "mm"}), [FORCE])
    for part in ("r1.csv", "'force'", "'mm'", "kN", "force: {unit: N}"):
        assert part in message
    assert "unknown unit 'furlongs/fortnite'" in refusal(
        MemoryTable({"force": NUMBERS}, {"force": "furlongs/fortnite"}), [FORCE]
    )


def test_a_name_in_two_tables_is_asked_for_its_table() -> None:
    tables = [MemoryTable({"force": NUMBERS}, {"force": "N"}, name=name) for name in ("/device", "/bench")]
    message = refusal(tables, [FORCE])
    assert "'device', 'bench'" in message
    assert 'table: "device"' in message
    for said in ("bench", "/bench"):
        (selection,) = resolved(tables, [FORCE], {"force": ChannelMap(table=said)})
        assert selection.source.table.name == "/bench"
    assert "Did you mean 'bench'?" in refusal(tables, [FORCE], {"force": ChannelMap(table="bensch")})


def test_an_unclear_optional_channel_is_left_out_and_said() -> None:
    tables = [
        MemoryTable({"force": NUMBERS, "current": NUMBERS}, {"force": "N", "current": "A"}, name="a"),
        MemoryTable({"current": NUMBERS}, {"current": "A"}, name="b"),
    ]
    (selection,) = resolved(tables, [FORCE, CURRENT])
    assert [channel.name for channel in selection.channels] == ["force"]
    assert "left out" in selection.notes[0].message


def test_two_likely_names_in_one_table_are_not_guessed_between() -> None:
    table = MemoryTable({"left.force": NUMBERS, "right.force": NUMBERS}, {"left.force": "N", "right.force": "N"})
    assert "'left.force', 'right.force' could all be 'force'" in refusal(table, [FORCE])


def test_words_where_numbers_are_needed_are_shown() -> None:
    words = np.array(["", "OK", "fail"], dtype=object)
    message = refusal(MemoryTable({"force": words}), [FORCE])
    assert "'OK' in row 2" in message
    (selection,) = resolved(MemoryTable({"force": NUMBERS, "current": words}, {"force": "N"}), [FORCE, CURRENT])
    assert [channel.name for channel in selection.channels] == ["force"]
    assert "left out" in selection.notes[0].message


def test_channels_of_words_stay_words() -> None:
    state = Spec("state", "")
    (selection,) = resolved(MemoryTable({"state": np.array(["a", "b", ""], dtype=object)}), [state])
    assert list(si(selection, "state")) == ["a", "b", ""]
    (selection,) = resolved(MemoryTable({"state": NUMBERS}), [state])
    assert list(si(selection, "state")) == ["1", "2", "3"]


def test_each_table_with_a_wanted_channel_is_selected() -> None:
    tables = [
        MemoryTable({"force": NUMBERS}, {"force": "N"}, name="fast"),
        MemoryTable({"other": NUMBERS}, name="unused"),
        MemoryTable({"displacement": NUMBERS}, {"displacement": "m"}, name="slow"),
    ]
    names = [selection.source.table.name for selection in resolved(tables, [FORCE, DISPLACEMENT])]
    assert names == ["fast", "slow"]
