"""A recipe is strict: what is misspelt is answered with its line and the nearest right word."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.campaign.recipe import Recipe, load
from pipeline.errors import InputError
from pipeline.rigs.registry import experiment


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "spring.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_full_recipe_is_read_with_its_units_in_si(tmp_path: Path) -> None:
    recipe = load(
        written(
            tmp_path,
            "experiment: spring.pull\n"
            "channels:\n"
            "  time: {channel: Zeit, unit: ms}\n"
            '  force: {channel: "Load cell", unit: kN, sign: -1}\n'
            "  extension: Weg\n"
            "conditions: {wire_diameter: 1.2 mm}\n"
            "settings: {largest_extension: 0.03}\n",
        )
    )
    assert recipe.experiment.id == "spring.pull"
    assert recipe.channels["force"].channel == "Load cell"
    assert recipe.channels["force"].unit == "kN"
    assert recipe.channels["force"].sign == -1
    assert recipe.channels["extension"].channel == "Weg"
    assert recipe.conditions["wire_diameter"] == pytest.approx(1.2e-3)
    assert recipe.settings.largest_extension == 0.03


def test_without_a_recipe_everything_is_as_the_experiment_has_it() -> None:
    recipe = Recipe.default(experiment("spring.pull"))
    assert recipe.channels == {}
    assert recipe.settings.largest_extension == 0.1


FAULTS = [
    ("experiment: spring.pul\n", 1, "spring.pull"),
    ("experiment: spring.pull\nchanels: {}\n", 2, "'channels'"),
    ("experiment: spring.pull\nchannels:\n  forces: {channel: F}\n", 3, "'force'"),
    ("experiment: spring.pull\nchannels:\n  force: {chanel: F}\n", 3, "'channel'"),
    ("experiment: spring.pull\nchannels:\n  force:\n    channel: F\n    units: kN\n", 5, "'unit'"),
    ("experiment: spring.pull\nchannels:\n  force: {channel: F, unit: kNn}\n", 3, "unknown unit 'kNn'"),
    ("experiment: spring.pull\nchannels:\n  force: {channel: F, unit: mm}\n", 3, "does not measure the same as 'N'"),
    ("experiment: spring.pull\nchannels:\n  force: {channel: F, sign: 2}\n", 3, "sign"),
    ("experiment: spring.pull\nsettings:\n  largest_extention: 1\n", 3, "'largest_extension'"),
    ("experiment: spring.pull\nsettings:\n  largest_extension: wide\n", 3, "wide"),
    ("experiment: spring.pull\nsettings:\n  largest_extension: -1\n", 3, "greater than 0"),
    ("experiment: spring.pull\nconditions: {wire_diametre: 1 mm}\n", 2, "'wire_diameter'"),
    ("experiment: spring.pull\nconditions:\n  wire_diameter: 1 kg\n", 3, "does not measure the same as 'm'"),
    ("experiment: spring.pull\nconditions:\n  wire_diameter: thick\n", 3, "thick"),
    ("experiment: spring.pull\nconditions: {a: 1, a: 2}\n", 2, "duplicate"),
    ("experiment: spring.pull\n  channels: {}\n", 2, "YAML"),
    ("experiment: [spring\n", 2, "YAML"),
    ("channels: {}\n", None, "experiment"),
    ("- a\n- b\n", None, "key: value"),
    ("", None, "experiment"),
]


@pytest.mark.parametrize(("text", "line", "hint"), FAULTS)
def test_a_fault_is_answered_with_file_line_and_what_is_known(
    tmp_path: Path, text: str, line: int | None, hint: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as told:
        load(path)
    message = str(told.value)
    assert str(path) in message
    assert hint in message
    if line is not None:
        assert f"line {line}" in message


def test_a_recipe_of_another_experiment_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"line 1: this recipe is for 'spring.pull', not for 'mre.shear'"):
        load(written(tmp_path, "experiment: spring.pull\n"), "mre.shear")


def test_a_recipe_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_bytes(b"experiment: \xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        load(path)


def test_the_digest_changes_with_the_content_and_not_with_comments(tmp_path: Path) -> None:
    one = load(written(tmp_path, "experiment: spring.pull\n")).digest
    same = load(written(tmp_path, "# note\nexperiment: spring.pull   # here\n")).digest
    other = load(written(tmp_path, "experiment: spring.pull\nsettings: {largest_extension: 0.2}\n")).digest
    assert one == same != other
