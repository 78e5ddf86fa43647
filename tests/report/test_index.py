"""The index: rigs, ages, what goes from campaign to campaign, search with and without script."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from pipeline.findings import Findings, Parameter
from pipeline.report.index import IndexEntry, index_entry, render_index
from pipeline.report.index_trend import day, followed, trend
from pipeline.rigs.experiment import Experiment

CHROMIUM = next((path for name in ("chromium", "chromium-browser") if (path := shutil.which(name))), "")


def at(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


def campaign(findings: Findings, name: str, k1: float, begins: Sequence[float | None] = ()) -> Findings:
    """The findings as another campaign's: with another k1, its runs begun at these moments."""
    runs = [run.model_copy(update={"begins": moment}) for run, moment in zip(findings.runs, begins, strict=False)]
    parameters = [
        p.model_copy(update={"value": k1, "std_error": 100.0, "ci95": (k1 - 200.0, k1 + 200.0)}) if p.name == "k1" else p
        for p in findings.parameters
    ]  # fmt: skip
    return findings.model_copy(update={"campaign": name, "runs": runs or findings.runs, "parameters": parameters})


@pytest.fixture
def entries(findings: Findings, experiment: Experiment) -> list[IndexEntry]:
    """Three campaigns of the experiment, listed in another order than they were recorded in, and one of another rig."""
    dates = {"second": "2024-03-09", "first": "2024-03-02", "third": "2024-05-01"}
    made = [
        index_entry(
            campaign(findings, name, 6e4 + 1000 * place, [at(date), at(date) + 3600.0]),
            experiment,
            "Pads",
            f"{name}/report.html",
        )
        for place, (name, date) in enumerate(dates.items())
    ]
    other = replace(
        made[0], name="pull", experiment="spring.pull", recorded=[], undated=2, followed=[], link="pull/report.html"
    )
    return [IndexEntry(**json.loads(json.dumps(asdict(entry)))) for entry in (*made, other)]


def test_campaigns_stand_by_rig_with_the_days_of_their_logs(entries):
    html = render_index(entries)
    assert html == render_index(entries)
    assert html.index('id="rig-1-title">toy ') < html.index('id="rig-2-title">spring ')
    assert '<time datetime="2024-03-09" data-age>2024-03-09</time>' in html
    assert "The logs bear no date" in html
    assert "script-src 'sha256-" in html


def test_days_that_differ_are_both_told_and_runs_without_a_date_counted(findings, experiment):
    begins = [at("2024-03-02"), None, at("2024-03-05T23:00")]
    html = render_index([index_entry(campaign(findings, "a", 6e4, begins), experiment, "", "a/report.html")])
    assert 'Recorded 2024-03-02 to <time datetime="2024-03-05" data-age>2024-03-05</time>; 1 run without a date' in html
    assert day(0.0) == "1970-01-01"


def test_a_trend_stands_over_time_and_says_which_numbers_are_apart(findings, experiment):
    told = [
        (name, recorded, followed(campaign(findings, name, k1), experiment))
        for name, recorded, k1 in (("late", 86_400.0 * 20, 6.1e4), ("early", 86_400.0 * 10, 6e4))
    ]
    figure = trend("toy.pads", "Pads", told)
    assert figure is not None
    panel = next(panel for panel in figure.panels if panel.y.label == "k1")
    (points,) = panel.marks
    assert points.x.tolist() == [0.0, 10.0]
    assert points.y.tolist() == [6e4, 6.1e4]
    assert points.low.tolist() == [6e4 - 200, 6.1e4 - 200]
    assert "early 1970-01-11, late 1970-01-21." in figure.caption
    assert panel.x.label == "days since 1970-01-11"
    assert "Beyond their 95 % intervals: k1." in figure.caption


def test_campaigns_without_dates_stand_as_they_are_listed(findings, experiment):
    numbers = followed(findings, experiment)
    figure = trend("toy.pads", "Pads", [("b", None, numbers), ("a", 5.0, numbers)])
    assert figure is not None
    assert figure.panels[0].marks[0].x.tolist() == [1.0, 2.0]
    assert "None by more than the 95 % intervals allow" in figure.caption
    assert "Their logs bear no dates; as listed: 1 b, 2 a." in figure.caption


def test_a_number_that_one_campaign_alone_tells_has_no_trend(findings, experiment):
    numbers = followed(findings, experiment)
    assert trend("toy.pads", "Pads", [("a", None, numbers)]) is None
    assert trend("toy.pads", "Pads", [("a", None, numbers), ("b", None, [])]) is None


def test_operating_points_are_held_against_each_other_to_two_digits(experiment):
    def key(current: float) -> str:
        parameter = Parameter(name="k_mr", symbol="k", value=1.0, unit="N/m", at={"coil_current": current})
        found = Findings(campaign="a", experiment="toy.pads", verdict="ok", parameters=[parameter])
        return followed(found, experiment)[0]["key"]

    assert key(2.0) == key(2.004) != key(2.2)


def test_an_entry_of_an_earlier_version_is_still_shown(entries):
    old = {name: value for name, value in asdict(entries[0]).items() if name not in ("recorded", "undated", "followed")}
    assert "second" in render_index([IndexEntry(**old)])


@pytest.mark.skipif(not CHROMIUM, reason="no Chromium here; install the package 'chromium' to look at pages")
def test_the_search_shows_what_was_looked_for_and_ages_are_told(entries, tmp_path: Path):
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    page_file = tmp_path / "index.html"
    page_file.write_text(render_index(entries), encoding="utf-8")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(page_file.as_uri())

        def shown() -> list[str]:
            return page.locator(".card:visible h3").all_inner_texts()

        assert shown() == ["second", "first", "third", "pull"]
        assert page.locator(".age").first.inner_text().endswith("ago)")
        page.get_by_label("Search").fill("SPRING")
        assert shown() == ["pull"]
        assert page.locator("#found").inner_text() == "1 of 4 shown"
        assert page.locator("#rig-1").is_hidden()
        page.get_by_label("Search").fill("toy third")
        assert shown() == ["third"]
        page.keyboard.press("Escape")
        assert len(shown()) == 4
        assert page.locator(".trend figure").first.is_visible()
        without = browser.new_context(java_script_enabled=False).new_page()
        without.goto(page_file.as_uri())
        assert without.locator(".card:visible").count() == 4
        assert without.locator("#search").is_hidden()
        browser.close()
    assert said == []
