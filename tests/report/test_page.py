"""The report as a page: what stands in it, that it needs nothing else, that nothing from a log becomes markup."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import asdict, replace
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest

from pipeline.findings import Findings, ModelResult, Parameter, Published, Quality, Run
from pipeline.findings.figures import Axis, Column, Figure, Line, Panel, Section, Table, Text, Value
from pipeline.report.accounts import published_table
from pipeline.report.budget import budget_table
from pipeline.report.chapters import chapters
from pipeline.report.citation import bibtex, citation
from pipeline.report.index import IndexEntry, index_entry, render_index
from pipeline.report.models import models_table
from pipeline.report.page import render_report
from pipeline.report.parameters import key_table, parameter_tables
from pipeline.report.table import table_view
from pipeline.rigs.experiment import Experiment, ParameterSpec, Reference

HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>'\" & $x$ \x00"
VOID = {"meta", "link", "br", "hr", "img", "input"}


class Page(HTMLParser):
    """Collects what a page holds and whether its elements close in order."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", "".join(self.words))

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def html(findings: Findings, experiment: Experiment) -> str:
    return render_report(findings, experiment, "Pads of batch 7", "rigfit run toy.pads a.csv --out out")


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def test_the_page_is_well_formed(page):
    assert page.open == []
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))


def test_the_page_needs_nothing_from_outside(page, html):
    for tag, attributes in page.tags:
        assert tag not in ("iframe", "object", "embed", "base")
        assert tag != "script" or set(attributes) in (set(), {"type", "id"})  # inline, or data
        for name in ("src", "href", "data", "action"):
            assert attributes.get(name, "#").startswith(("#", "data:")), (tag, attributes)
        assert not [name for name in attributes if name.startswith("on")]
    assert "url(http" not in html
    assert "@import" not in html
    assert any("default-src 'none'" in attributes.get("content", "") for attributes in page.all("meta"))


def test_the_same_findings_give_the_same_bytes(html, findings, experiment):
    assert render_report(findings, experiment, "Pads of batch 7", "rigfit run toy.pads a.csv --out out") == html


@pytest.mark.parametrize(
    "said",
    [
        "Pads of batch 7", "Campaign pads-2024", "toy.pads", "Warning", "One run of twelve is left out",
        "12 runs, 11 used", "1 error, 1 warning, 1 note on the data", "60.042", "kN/m", "59.938 … 60.145", "µs",
        "not determined: no run with field was recorded", "range over 12 operating points", "Add a run at 2 Hz",
        "Does the model follow every loop?", "Table 1.", "Figure 1.", "selected", "agrees", "contradicts",
        "not checkable", "1.25 to 1.31", "the force is clipped", "The same in all runs: pad height 6 mm; operator A. B.",
        "repeated time stamps: 3 rows dropped", "sh_000, sh_001", "fitted by variable projection",
        "@article{brancati2019,", "413--432", "rigfit run toy.pads a.csv --out out", "numpy 2.4.6", "ab" * 32,
        "mains_frequency", "000000000003", "Signature", "Remarks",
    ],
)  # fmt: skip
def test_the_page_says(page, said):
    assert said in page.text


def test_links_of_the_contents_lead_somewhere(page):
    ids = {attributes["id"] for _, attributes in page.tags if "id" in attributes}
    links = [attributes["href"][1:] for attributes in page.all("a")]
    assert len(links) > 8
    assert set(links) <= ids


def test_screen_readers_find_their_way(page):
    tags = [tag for tag, _ in page.tags]
    assert page.all("html") == [{"lang": "en"}]
    assert [tags.count(tag) for tag in ("main", "nav", "h1", "header", "footer")] == [1, 1, 1, 1, 1]
    pictures = [attributes for attributes in page.all("div") if attributes.get("class") == "drawing"]
    assert len(pictures) == len(page.all("figure")) == tags.count("figcaption") == 6
    assert all(len(attributes["aria-label"]) > 10 for attributes in pictures)
    named = [attributes for attributes in page.all("svg") if attributes.get("role") == "img"]
    silent = [attributes for attributes in page.all("svg") if attributes.get("aria-hidden") == "true"]
    assert len(named) + len(silent) == len(page.all("svg"))
    known = {attributes["id"] for _, attributes in page.tags if "id" in attributes}
    assert all({a["aria-labelledby"], a["aria-describedby"]} <= known for a in named)
    assert "stiffness" in page.text
    assert all(attributes.get("scope") in ("col", "row") for attributes in page.all("th"))
    assert tags.count("caption") == tags.count("table")
    assert all(attributes.get("scope") in ("row", "col") for attributes in page.all("th"))
    scrolling = [a for a in page.all("div") + page.all("pre") if "scroll" in a.get("class", "").split()]
    assert all(attributes.get("tabindex") == "0" for attributes in scrolling)
    headings = [int(tag[1]) for tag in tags if re.fullmatch(r"h[1-6]", tag)]
    assert headings[0] == 1
    assert all(later - earlier <= 1 for earlier, later in pairwise(headings))


@pytest.mark.parametrize(
    ("second", "unit", "cells"),
    [("m", "nm", ["120", "340"]), ("N/m", "", ["120 nm", "2 kN/m"])],
)
def test_residuals_of_models_are_told_with_their_units(second: str, unit: str, cells: list[str]) -> None:
    models = [
        ModelResult(name="bump", n_parameters=5, n_data=100, rms_residual=1.2e-7, unit="m"),
        ModelResult(
            name="other", n_parameters=2, n_data=80, rms_residual=3.4e-7 if second == "m" else 2e3, unit=second
        ),
    ]
    view = models_table(models)
    place = [head.text for head in view.heads].index("rms residual")
    assert view.heads[place].unit == unit
    assert [str(row[place].text).strip() for row in view.rows] == cells


def test_the_caption_names_the_model_that_is_taken_and_by_how_much() -> None:
    best = ModelResult(name="two lags", family="rise", selected=True, n_parameters=3, n_data=9, aicc=-20.0)
    others = [ModelResult(name="one lag", family=of, n_parameters=2, n_data=9, aicc=-7.0) for of in ("rise", "fall")]
    assert models_table([best, *others]).caption.startswith(
        "Which model do the data support? For rise “two lags”, its AICc 13 below the next. ΔAICc"
    )
    simple = ModelResult(name="simple", family="rise", n_parameters=1, n_data=9, aicc=-24.5)
    assert "although the AICc of another is 4.5 less" in models_table([best, simple]).caption
    assert "two lags" not in models_table([best.model_copy(update={"selected": False}), simple]).caption
    by_bic = [one.model_copy(update={"aicc": None, "bic": -bic}) for one, bic in ((best, 30.0), (simple, 9.0))]
    assert "its BIC 21 below the next" in models_table(by_bic).caption


def test_the_caption_counts_which_published_values_hold() -> None:
    told = [Published(name="k", published=1.0, found=1.0, agrees=agrees) for agrees in (True, True, False, None)]
    view = published_table(told)
    assert view is not None
    assert view.caption.endswith("? 2 agree, 1 contradicts what was found, 1 cannot be checked.")


def hostile_findings() -> Findings:
    return Findings(
        schema=1, campaign=HOSTILE, experiment=HOSTILE, verdict="rejected", reasons=[HOSTILE], advice=[HOSTILE],
        parameters=[
            Parameter(name=HOSTILE, symbol=HOSTILE, value=1.0, unit=HOSTILE, description=HOSTILE, source=HOSTILE),
            Parameter(name="k1", symbol="k_1", value=None, unit="N/m", description=HOSTILE),
            Parameter(name="k1", symbol="k_1", value=2.0, unit="N/m", at={HOSTILE: HOSTILE, "run": HOSTILE}),
        ],
        models=[ModelResult(name=HOSTILE, selected=True, n_parameters=1, n_data=1, description=HOSTILE)],
        published=[Published(name=HOSTILE, published=HOSTILE, found=None, unit=HOSTILE, where=HOSTILE, remark=HOSTILE)],
        quality=[Quality(level="error", run=HOSTILE, channel=HOSTILE, message=HOSTILE)],
        runs=[Run(run=HOSTILE, used=False, reason=HOSTILE, conditions={HOSTILE: HOSTILE}, files=[HOSTILE],
                  sha256=[HOSTILE], repairs=[HOSTILE])],
        settings={HOSTILE: [HOSTILE]}, provenance={HOSTILE: {HOSTILE: HOSTILE}, "logs": {HOSTILE: HOSTILE}, "x": None},
    )  # fmt: skip


def hostile_sections(_: Findings) -> list[Section]:
    x = np.arange(3.0)
    panel = Panel([Line(x, x, 1, HOSTILE)], Axis(HOSTILE, "m"), Axis(HOSTILE, "N"), HOSTILE)
    table = Table(
        HOSTILE,
        HOSTILE,
        HOSTILE,
        [Column(HOSTILE, "m"), Column(HOSTILE)],
        [[1.0, HOSTILE], [Value(None, note=HOSTILE), HOSTILE]],
    )
    return [Section(HOSTILE, HOSTILE, [Text([HOSTILE]), Figure(HOSTILE, HOSTILE, HOSTILE, HOSTILE, [panel]), table])]


def test_nothing_from_a_log_becomes_markup(make_experiment):
    experiment = replace(make_experiment(hostile_sections), summary=HOSTILE, title=HOSTILE)
    html = render_report(hostile_findings(), experiment, HOSTILE, HOSTILE)
    entry = index_entry(hostile_findings(), experiment, HOSTILE, "x/report.html")
    for text in (html, render_index([entry])):
        page = Page(text)
        assert page.open == []
        assert not page.all("script")
        assert not page.all("img")
        assert not [name for _, attributes in page.tags for name in attributes if name.startswith("on")]
        assert "\x00" not in text
        assert "<script>alert(1)</script>" in page.text  # shown as it stands


def test_empty_findings_make_a_page(make_experiment):
    bare = Findings(schema=1, campaign="none", experiment="toy.pads", verdict="rejected")
    page = Page(render_report(bare, make_experiment(lambda _: []), "", ""))
    assert "No number was identified." in page.text
    assert "Rejected" in page.text


def test_a_thousand_runs_stay_small(make_findings, experiment):
    html = render_report(make_findings(1000), experiment, "", "rigfit run")
    assert len(html.encode()) < 5e6
    assert "940 more rows in findings.json" in html
    assert "the force is clipped" in html  # runs left out are shown before those that are cut off


def test_what_varies_stands_in_one_table_with_the_unit_in_its_heading(findings, experiment):
    views = {
        view.name: view
        for chapter in chapters(findings, experiment, "x")
        for view in chapter.blocks
        if view.kind == "table"
    }
    view = views["parameters-run-coil_current-frequency"]
    assert [(re.sub("<.*?>", "", head.text), head.unit) for head in view.heads] == [
        ("run", ""), ("coil current", "A"), ("frequency", "Hz"), ("K′", "kN/m"), ("η", ""),
    ]  # fmt: skip
    assert len(view.rows) == 12
    assert view.rows[0][3].text.endswith("± 0.31")
    assert "…" in view.rows[0][3].below


def test_figures_and_tables_are_numbered_through(findings, experiment):
    views = [view for chapter in chapters(findings, experiment, "x") for view in chapter.blocks]
    for kind in ("figure", "table"):
        numbers = [view.number for view in views if view.kind == kind]
        assert numbers == list(range(1, len(numbers) + 1))


def test_a_table_takes_any_cell():
    table = Table("t", "T", "", [Column("a", "m"), Column("b"), Column("n", "1"), Column("c", "Pa")],
                  [[1e-3, "x", 12000, True], [Value(2e-3, 1e-5), None, 3, None], ["words", "y", None, float("nan")],
                   [None, "z", 7, 2e6]])  # fmt: skip
    view = table_view(table)
    assert [head.unit for head in view.heads] == ["mm", "", "", "MPa"]
    assert [row[0].text.strip("\u2007\u2008\u00a0") for row in view.rows] == ["1", "2.000 ± 0.010", "words", "–"]
    assert [row[2].text for row in view.rows] == ["12\u202f000", "3", "–", "7"]
    assert [row[3].text for row in view.rows] == ["yes", "–", "–", "2"]


def test_a_ratio_may_be_read_in_percent():
    view = table_view(Table("t", "T", "", [Column("misfit", "%")], [[Value(0.0123, 0.00042)], [0.5]]))
    assert view.heads[0].unit == "%"
    assert [row[0].text.strip("\u2007\u2008\u00a0") for row in view.rows] == ["1.230 ± 0.042", "50"]


def test_short_rows_and_too_many_rows_are_laid_out():
    view = table_view(Table("t", "T", "", [Column("a"), Column("b")], [["x"]] * 300))
    assert (len(view.rows), view.left_out) == (200, 100)
    assert view.rows[0][1].text == "–"


def test_references_read_and_paste_well():
    reference = Reference(
        "a2020", "A. B. Ünal and C. D", "On 5 % & more", "J. Test", 2020, "3", "1-9", "10.1/x_y", "in print"
    )
    assert citation(reference) == "A. B. Ünal and C. D: On 5 % & more. J. Test 3, 1-9 (2020). doi:10.1/x_y. In print."
    entry = bibtex([reference])
    assert r"title = {{On 5 \% \& more}}" in entry
    assert "pages = {1--9}" in entry
    assert "doi = {10.1/x_y}" in entry
    assert entry.count("{") == entry.count("}")


def test_the_index_survives_a_way_through_json(findings, experiment):
    entry = index_entry(findings, experiment, "", "pads-2024/report.html")
    again = IndexEntry(**json.loads(json.dumps(asdict(entry))))
    assert render_index([again]) == render_index([entry])
    assert entry.title == experiment.title


def test_the_index_shows_every_campaign(findings, experiment):
    entry = index_entry(findings, experiment, "Pads", "pads-2024/report.html")
    html = render_index([entry, replace(entry, name="other", verdict="ok", picture="", link="other/report.html")])
    page = Page(html)
    assert page.open == []
    for said in (
        "2 campaigns · 1 OK · 1 Warning",
        "pads-2024",
        "11 of 12 runs used",
        "60.042 ± 0.052 kN/m",
        "76 … 228 kN/m",
    ):
        assert said in page.text
    assert [a["href"] for a in page.all("a")[1:]] == ["pads-2024/report.html", "other/report.html"]
    assert "There is no report yet" in render_index([])


def test_the_report_imports_matplotlib_only_to_draw(run_python: Callable[[str], str]):
    code = "import sys, pipeline.report.page, pipeline.report.index; print('matplotlib' in sys.modules)"
    assert run_python(code).strip() == "False"


def test_where_no_key_number_was_looked_for_the_others_stand_in(findings, experiment):
    others = findings.model_copy(update={"parameters": [p for p in findings.parameters if p.name == "loss_factor"]})
    declared = replace(
        experiment, parameters=[*experiment.parameters, ParameterSpec("loss_factor", r"\eta", "1", "loss factor")]
    )
    table = key_table(others, declared)
    assert "range over 12 operating points" in table.rows[0][0].below
    assert not table.caption, "a range has no ±"


def test_the_key_table_says_what_its_plus_minus_is(findings, experiment):
    table = key_table(findings, experiment)
    assert any("±" in str(row[1].text) for row in table.rows)
    assert "one standard error" in table.caption


def test_a_reason_repeats_neither_the_meaning_nor_that_there_is_no_value(findings, experiment):
    def below(description: str) -> str:
        lost = Parameter(name="k1", symbol="k_1", value=None, unit="N/m", description=description)
        return key_table(findings.model_copy(update={"parameters": [lost]}), experiment).rows[0][0].below

    meaning = "stiffness of the Maxwell branch"
    assert below("k1 is not determined: its error would be 17 %") == f"{meaning}; its error would be 17 %"
    assert below(f"{meaning}; not determined: one frequency only") == f"{meaning}; one frequency only"
    assert below("Stiffness of the Maxwell branch: one frequency only.") == f"{meaning}; one frequency only"
    assert below("k1 is not determined") == meaning
    assert below("needs k1 and tau; k1 not determined") == f"{meaning}; needs k1 and tau; k1 not determined"


def test_the_page_names_its_logs(findings, experiment):
    def title(found: Findings, given: str = "") -> str:
        return re.search("<title>(.*?)</title>", render_report(found, experiment, given, "c"))[1]

    one = findings.model_copy(update={"runs": findings.runs[:1]})
    assert title(one) == "Shear of elastomer pads: sh_000.csv – rigfit"
    assert title(findings, "Batch 7") == "Batch 7: 12 logs, sh_000.csv to sh_011.csv – rigfit"


def test_many_quantities_of_one_run_stand_in_tables_that_fit_a_page(experiment):
    at = {"run": "a", "coil_current": 2.0, "frequency": 5.0, "pad_height": 6e-3}
    many = [Parameter(name=f"q{n}", symbol=f"q_{n}", value=1.0 + n, unit="1", at=at) for n in range(7)]
    empty = Findings(schema=1, campaign="c", experiment="toy.pads", verdict="ok", parameters=many)
    views = parameter_tables(empty, experiment)
    assert [len(view.heads) for view in views] == [8, 7]
    assert all(len(view.rows) == 1 for view in views)


def test_the_budget_speaks_as_the_paper_and_in_units_for_reading(findings, experiment):
    one = next(p for p in findings.parameters if p.name == "k_mr" and p.at == {"coil_current": 2.0})
    told = one.model_copy(update={"std_error": 500.0, "type_b": 300.0, "value": 50e3})
    view = budget_table(findings.model_copy(update={"parameters": [told]}), experiment)
    assert [cell.text for cell in view.rows[0]] == ["<var>k</var><sub>MR</sub>", "coil current 2 A", "1", "0.8", "0.6"]
    assert [head.unit for head in view.heads] == ["", "", "%", "%", "%"]
