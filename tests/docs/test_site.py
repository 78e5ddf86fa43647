"""The documentation site: built without a warning, complete, nothing fetched from elsewhere, searchable from disk."""

from __future__ import annotations

import re
import shutil
import types
from collections.abc import Iterator
from pathlib import Path

import pytest
from told_blocks import ROOT, fenced

from pipeline.campaign.project import recipe_template
from pipeline.campaign.recipe import load
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import all_experiments

OURS = [e for e in all_experiments().values() if e.identify.__class__.__name__ == "Later"]
CHROMIUM = shutil.which("chromium") or ""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as `make docs` builds it; a warning fails."""
    import os

    os.environ["NO_MKDOCS_2_WARNING"] = "1"
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    folder = tmp_path_factory.mktemp("site")
    config = load_config(str(ROOT / "mkdocs.yml"), site_dir=str(folder))
    config.plugins.run_event("startup", command="build", dirty=False)
    build(config)
    return folder


@pytest.mark.parametrize("experiment", OURS, ids=lambda e: e.id)
def test_an_experiment_has_a_page_with_all_that_it_declares(site: Path, experiment: Experiment) -> None:
    page = (site / "experiments" / f"{experiment.id}.html").read_text(encoding="utf-8")
    for spec in (*experiment.channels, *experiment.conditions, *experiment.parameters):
        assert f"<code>{spec.name}</code>" in page
    assert all(f"<code>{name}</code>" in page for name in experiment.settings.model_fields)
    assert page.count('<div class="equation" tabindex="0">') == len(experiment.equations) > 0
    mathml = " ".join(re.findall(r"<math.*?</math>", page, re.DOTALL))
    assert "\\" not in mathml


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        fetched = re.findall(r'<(?:script|img|iframe|source)\b[^>]*\bsrc="?([^" >]+)', text)
        fetched += re.findall(r'<link\b(?![^>]*rel="?canonical)[^>]*\bhref="?([^" >]+)', text)
        assert not [address for address in fetched if "//" in address], page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(https?:)?//", sheet.read_text(encoding="utf-8")), sheet


@pytest.mark.parametrize("experiment", OURS, ids=lambda e: e.id)
def test_the_recipes_of_the_pages_load(experiment: Experiment, tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(recipe_template(experiment, "my-campaign"), encoding="utf-8")
    assert load(recipe).experiment.id == experiment.id
    examples = [
        p for p in (ROOT / "recipes").glob("*.yaml") if f"experiment: {experiment.id}\n" in p.read_text("utf-8")
    ]
    assert [load(example).experiment.id for example in examples[:1]] == [experiment.id]


def test_the_example_reader_reads_its_log(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "add-a-format.md").read_text(encoding="utf-8")
    code, log = (next(b for b in fenced(page) if b.title == name) for name in ("lab.py", "press.lab"))
    module = types.ModuleType("lab")
    exec(compile(code.text, "lab.py", "exec"), module.__dict__)
    path = tmp_path / "press.lab"
    path.write_text(log.text, encoding="utf-8")
    assert module.READER.recognises(path.read_bytes(), ".lab")
    table = module.READER.open(path).tables[0]
    assert [(c.name, c.unit) for c in table.channels] == [("t", "s"), ("pos", "mm"), ("force", "kN")]
    (block,) = table.blocks(["force"])
    assert block["force"].tolist() == [0.0, 0.011, 0.019]
    assert list(block) == ["force"]


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    if not CHROMIUM:
        pytest.skip("no Chromium here; install the package 'chromium' to look at pages")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        found = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


def test_search_works_from_disk_and_pages_stay_within_a_phone(site: Path, browser: object) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 800})
    faults: list[str] = []
    page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    for name in ("index.html", "tutorial.html", "experiments/mre.shear.html", "findings.html"):
        page.goto((site / name).as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
    page.set_viewport_size({"width": 1300, "height": 900})
    page.goto((site / "index.html").as_uri())
    page.fill("input[name=query]", "Maxwell branch")
    page.wait_for_selector(".md-search-result__link", timeout=10_000)
    assert "experiments/" in " ".join(
        a.get_attribute("href") for a in page.query_selector_all(".md-search-result__link")
    )
    assert not faults


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_serve_screen_readers_and_keyboards(site: Path, browser: object, scheme: str) -> None:
    from axe_playwright_python.sync_playwright import Axe

    page = browser.new_page(viewport={"width": 1300, "height": 900}, color_scheme=scheme)
    for name in ("index.html", "tutorial.html", "experiments/mre.shear.html"):
        page.goto((site / name).as_uri())
        found = Axe().run(page).response["violations"]
        grave = [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in ("serious", "critical")]
        assert not grave, name
