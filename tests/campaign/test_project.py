"""Adding a campaign changes one line of params.yaml and leaves everything else as the user wrote it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline.campaign import recipe
from pipeline.campaign.project import Project
from pipeline.errors import InputError
from pipeline.rigs.registry import experiment

Call = Callable[..., Any]
SPRING = experiment("spring.pull")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("campaigns: []\nsynthetic: []\n", "campaigns: [new]\nsynthetic: []\n"),
        ("campaigns:\nsynthetic: []\n", "campaigns: [new]\nsynthetic: []\n"),
        ("campaigns: [a, b]  # mine\n", "campaigns: [a, b, new]  # mine\n"),
        (
            "# top\ncampaigns:\n  - a   # first\n  - b\n# below\nsynthetic:\n  - a\n",
            "# top\ncampaigns:\n  - a   # first\n  - b\n  - new\n# below\nsynthetic:\n  - a\n",
        ),
        ("campaigns:\n- a\n\nother: 1\n", "campaigns:\n- a\n- new\n\nother: 1\n"),
        ("other: 1\n", "other: 1\ncampaigns: [new]\n"),
    ],
)
def test_a_campaign_is_added_to_the_list(project: Path, before: str, after: str) -> None:
    (project / "params.yaml").write_text(before)
    Project(project).add("new", SPRING, "")
    assert (project / "params.yaml").read_text() == after
    assert Project(project).campaigns()[-1] == "new"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("datasets: {}  # elsewhere\n", 'datasets: {new: "s3://lab/new"}  # elsewhere\n'),
        ("datasets:  # elsewhere\nuses: []\n", 'datasets: {new: "s3://lab/new"}  # elsewhere\nuses: []\n'),
        ("datasets: {a: s3://lab/a}\n", 'datasets: {a: s3://lab/a, new: "s3://lab/new"}\n'),
        (
            "datasets: {\n  a: s3://lab/a  # first\n}\n",
            'datasets: {\n  a: s3://lab/a  # first\n, new: "s3://lab/new"}\n',
        ),
        (
            "datasets:\n  a: s3://lab/a  # first\n\n  # below\nuses: []\n",
            'datasets:\n  a: s3://lab/a  # first\n  new: "s3://lab/new"\n\n  # below\nuses: []\n',
        ),
        ("datasets:\n    a: >-\n      s3://lab/\n      a\nuses: []\n", None),
        ("datasets:\n  a: s3://lab/a", 'datasets:\n  a: s3://lab/a\n  new: "s3://lab/new"\n'),
        (
            "datasets:\r\n  a: s3://lab/a\r\nuses: []\r\n",
            'datasets:\r\n  a: s3://lab/a\r\n  new: "s3://lab/new"\r\nuses: []\r\n',
        ),
        ("uses: []", 'uses: []\ndatasets: {new: "s3://lab/new"}\n'),
    ],
)
def test_where_the_logs_of_a_campaign_lie_is_added_and_all_else_stays(
    project: Path, before: str, after: str | None
) -> None:
    params = project / "params.yaml"
    params.write_bytes(f"campaigns: []\n{before}".encode())
    made = Project(project)
    known = made.dataset("a") if "a: " in before else None
    made.add("new", SPRING, "", "s3://lab/new")
    text = params.read_bytes().decode()
    assert after is None or text.replace("\r\n", "\n") == f"campaigns: [new]\n{after}".replace("\r\n", "\n")
    assert made.dataset("new") == "s3://lab/new"
    assert known is None or made.dataset("a") == known


@pytest.mark.parametrize(("content", "line"), [("datasets: [a]\n", 2), ("\ndatasets:\n  - a\n", 3)])
def test_a_list_where_a_mapping_belongs_is_told_with_its_line(project: Path, content: str, line: int) -> None:
    (project / "params.yaml").write_text(f"campaigns: []\n{content}")
    with pytest.raises(InputError, match=f"line {line}: 'datasets' must be 'new: ...' lines"):
        Project(project).add("new", SPRING, "", "s3://lab/new")
    assert Project(project).campaigns() == []


def test_the_recipe_of_a_new_campaign_is_valid_and_explains_every_name(project: Path) -> None:
    campaign = Project(project).add("new", SPRING, 'Spring "7"')
    made = recipe.load(campaign.recipe)
    assert made.title == 'Spring "7"'
    text = campaign.recipe.read_text()
    for name in ("extension", "force", "wire_diameter", "largest_extension"):
        assert name in text


def test_the_commented_lines_of_a_new_recipe_are_valid_once_uncommented(project: Path) -> None:
    campaign = Project(project).add("new", SPRING, "")
    text = campaign.recipe.read_text().replace("#  force", "  force")
    campaign.recipe.write_text(text)
    assert recipe.load(campaign.recipe).channels["force"].channel == "..."


@pytest.mark.parametrize("name", ["../up", "a b", "", ".hidden", "a/b", "-x"])
def test_a_name_that_is_no_folder_name_is_refused(project: Path, name: str) -> None:
    with pytest.raises(InputError, match="cannot be a campaign's name"):
        Project(project).add(name, SPRING, "")


def test_a_project_is_found_from_a_folder_within(project: Path) -> None:
    inner = project / "datasets" / "x"
    inner.mkdir(parents=True)
    assert Project.around(inner).root == project


def test_the_recipe_of_a_new_campaign_tells_what_it_builds_on(project: Path) -> None:
    campaign = Project(project).add("drive", experiment("tire.road"), "")
    text = campaign.recipe.read_text()
    assert "Campaigns of tire.bench whose findings this one uses" in text
    campaign.recipe.write_text(text.replace("# uses: [my-other-campaign]", "uses: [bench]"))
    assert recipe.load(campaign.recipe).uses == ("bench",)
    assert "uses:" not in Project(project).add("pads", experiment("mre.shear"), "").recipe.read_text()


def test_every_setting_of_a_new_recipe_is_valid_once_uncommented(project: Path) -> None:
    campaign = Project(project).add("pads", experiment("mre.shear"), "")
    lines = campaign.recipe.read_text().splitlines()
    start = lines.index("settings:")
    campaign.recipe.write_text(
        "\n".join([*lines[: start + 1], *(line.replace("#", "", 1) for line in lines[start + 1 :])])
    )
    made = recipe.load(campaign.recipe)
    assert made.settings == experiment("mre.shear").settings()


def test_a_used_campaign_that_dvc_does_not_know_is_told_with_the_line_to_add(project: Path, rigfit: Call) -> None:
    for name in ("bench", "road"):
        assert rigfit("new", "spring.pull", name).status == 0
        assert rigfit("synthesize", name).status == 0
    recipe_of_road = project / "recipes" / "road.yaml"
    recipe_of_road.write_text(recipe_of_road.read_text() + "uses: [bench]\n")
    line = "- {campaign: road, of: bench}"
    assert line in rigfit("ingest", "road").err
    params = project / "params.yaml"
    params.write_text(params.read_text().replace("uses: []", f"uses:\n  {line}"))
    assert rigfit("ingest", "road").err == ""


def test_the_findings_to_be_used_are_noted_beside_the_recordings(project: Path, rigfit: Call) -> None:
    for name in ("bench", "road"):
        rigfit("new", "spring.pull", name)
        rigfit("synthesize", name)
    (project / "recipes/road.yaml").write_text((project / "recipes/road.yaml").read_text() + "uses: [bench]\n")
    manifests = []
    for wire in (0.1, 0.015):
        text = f"experiment: spring.pull\nsettings: {{largest_extension: {wire}}}\n"
        (project / "recipes/bench.yaml").write_text(text)
        for words in (("ingest", "bench"), ("identify", "bench"), ("ingest", "road")):
            assert rigfit(*words).status == 0
        manifests.append((project / "recordings/road/manifest.json").read_bytes())
    assert manifests[0] != manifests[1]
    rigfit("ingest", "road")
    assert (project / "recordings/road/manifest.json").read_bytes() == manifests[1]
