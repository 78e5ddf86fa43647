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
    ("- a\n- b\n", None, "found a list"),
    ("hello\n", None, "found only 'hello'"),
    ("experiment: 42\n", 1, "expected is text"),
    ("experiment: spring.pull\nchannels: [Zeit]\n", 2, "'channels' is a list"),
    ("experiment: spring.pull\nchannels:\n  force:\n", 3, "'channels.force' is empty; expected is 'key: value' lines"),
    ("experiment: spring.pull\nchannels:\n  force: {scale: 0}\n", 3, "a factor other than 0"),
    ("experiment: spring.pull\nchannels:\n  force: {scale: true}\n", 3, "'channels.force.scale' is true"),
    ("experiment: spring.pull\nchannels:\n  force: {stamp: last}\n", 3, "'stamp' is for 'time' only"),
    ("experiment: spring.pull\nchannels:\n  force: {rate: 5 kHz}\n", 3, "Write `time: {rate: 5 kHz}`"),
    ("experiment: spring.pull\nchannels:\n  force: {offset: 5 N}\n", 3, "expected is a number"),
    ("experiment: spring.pull\nchannels:\n  force: {scale: .inf}\n", 3, "'channels.force.scale' is inf"),
    ("experiment: spring.pull\nconditions:\n  wire_diameter: .nan\n", 3, "'conditions.wire_diameter' is nan"),
    ("experiment: spring.pull\nconditions:\n  wire_diameter: true\n", 3, "is true, expected is a number in m"),
    ("experiment: spring.pull\nconditions:\n  wire_diameter: [1, 2]\n", 3, "'conditions.wire_diameter' is a list"),
    ("experiment: spring.pull\nconditions:\n  wire_diameter: 1e999\n", 3, "inf"),
    ("experiment: spring.pull\nsettings:\n  largest_extension: .nan\n", 3, "nan"),
    ("experiment: spring.pull\nsettings:\n  largest_extension: true\n", 3, "true"),
    ("experiment: spring.pull\nsettings:\n  largest_extension: 3 mm\n", 3, "It is: m; samples beyond it"),
    ('experiment: spring.pull\nfile_name: "{wire}_x"\n', 2, "Known conditions: wire_diameter"),
    ('experiment: spring.pull\nfile_name: "run"\n', 2, "names no condition"),
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


SHEAR_FAULTS = [
    ("conditions", "force_lag: 5 s", "from -0.1 to 0.1 s"),
    ("conditions", "n_pads: 2.5", "a whole number, from 1 to 100"),
    ("conditions", "n_pads: 0", "a whole number, from 1 to 100"),
    ("conditions", "moving_mass: -1 kg", "from 0 to 1000 kg"),
    ("conditions", "preload: -200 N", "from 0"),
    ("conditions", "frequency: -1 Hz", "more than 0 up to 100000 Hz"),
    ("conditions", "pad_height: 6", "more than 0 up to 1 m"),
    ("settings", "force_lag: 5", "'fit' or from -0.1 to 0.1"),
    ("settings", "force_lag: soon", "'fit' or a number"),
    ("settings", "moving_mass: -1", "from 0 to 1000"),
    ("settings", "starts: 2.5", "a whole number"),
    ("settings", "mains_frequency: -50", "greater than or equal to 0"),
    ("settings", "mains_frequency: true", "not true or false"),
]


@pytest.mark.parametrize(("section", "line", "hint"), SHEAR_FAULTS)
def test_what_an_experiment_declares_implausible_is_refused(tmp_path: Path, section: str, line: str, hint: str) -> None:
    path = written(tmp_path, f"experiment: mre.shear\n{section}:\n  {line}\n")
    with pytest.raises(InputError) as told:
        load(path)
    assert f"{path} line 3" in str(told.value)
    assert hint in str(told.value)
    assert "literal" not in str(told.value)


@pytest.mark.parametrize(
    "line", ["force_lag: 60 us", "n_pads: 2", "moving_mass: 150 g", "coil_current: -2 A", "preload: 0"]
)
def test_what_is_plausible_is_taken(tmp_path: Path, line: str) -> None:
    assert load(written(tmp_path, f"experiment: mre.shear\nconditions:\n  {line}\n")).conditions


def bomb() -> str:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        (bomb(), "aliases"),
        ("experiment: &a\n  x: {y: *a}\n", "r.yaml|spring.yaml"),
        ("a: " + "[" * 30_000, "nested deeper than 20 levels"),
        ("".join(f"{' ' * n}k{n}:\n" for n in range(300)), "nested deeper than 20 levels"),
        ("a: [" + "1, " * 60_000 + "]", "more than 10000 keys and values"),
        ("# a log\n" * 100_000, "0.8 MB"),
    ],
)
def test_a_recipe_that_would_unfold_without_end_is_refused(tmp_path: Path, text: str, hint: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=hint) as told:
        load(path)
    assert str(path) in str(told.value)


def test_a_sign_may_be_written_as_text(tmp_path: Path) -> None:
    made = load(written(tmp_path, 'experiment: spring.pull\nchannels: {force: {channel: F, sign: "-1"}}\n'))
    assert made.channels["force"].sign == -1


def test_calibrations_are_read_in_si(tmp_path: Path) -> None:
    recipe = load(
        written(
            tmp_path,
            "experiment: spring.pull\nchannels:\n"
            "  force: {gain_u: 0.5 %, offset_u: 0.002 kN}\n"
            "  extension: {channel: Weg, gain_u: 0.01, offset_u: 3um}\n",
        )
    )
    assert recipe.calibration["force"].gain_u == pytest.approx(0.005)
    assert recipe.calibration["force"].offset_u == pytest.approx(2.0)
    assert recipe.calibration["extension"].gain_u == 0.01
    assert recipe.calibration["extension"].offset_u == pytest.approx(3e-6)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("force: {gain_u: 80 %}", "from 0 up to 50 %"),
        ("force: {gain_u: -0.1 %}", "from 0 up to 50 %"),
        ("force: {gain_u: true}", "from 0 up to 50 %"),
        ("force: {gain_u: good}", "not a number with a unit"),
        ("force: {gain_u: 2 N}", "does not measure the same"),
        ("force: {offset_u: 2}", "'2 N'"),
        ("force: {offset_u: -2 N}", "'2 N'"),
        ("force: {offset_u: 2 mm}", "does not measure the same"),
        ("force: {offset_u: .inf N}", "'2 N'"),
        ("time: {gain_u: 1 %}", "'time' does not"),
    ],
)
def test_a_calibration_that_can_not_be_is_refused_with_its_line(tmp_path: Path, entry: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        load(written(tmp_path, f"experiment: spring.pull\nchannels:\n  {entry}\n"))
    assert "line 3" in str(caught.value)
    assert said in str(caught.value)
