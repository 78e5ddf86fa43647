"""Reports of very many runs: what is said often is said once, tables are summed up, the page stays small."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import numpy as np
import pytest

from pipeline.findings import Findings, ModelResult, Parameter, Quality, Run
from pipeline.findings.figures import Axis, Figure, Panel, Points, Section
from pipeline.report.accounts import logs_table, quality_table, repairs_table, runs_tables
from pipeline.report.figure import figure_view
from pipeline.report.gathered import MOST_TOLD, gathered, told
from pipeline.report.models import models_table
from pipeline.report.page import render_report
from pipeline.report.parameters import parameter_tables
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.over_runs import over_runs, trend_figure

RUNS = 1000
NAMES = [f"r{number:04d}" for number in range(RUNS)]


@pytest.fixture(scope="module")
def many() -> Findings:
    """A thousand runs of 30 numbers each, with as many remarks, fits, repairs and reasons."""
    rng = np.random.default_rng(1)
    values = 2.6e5 * (1 + 0.01 * rng.normal(size=(RUNS, 30)))
    parameters = [
        Parameter(name=f"p{number}", symbol=f"p_{{{number}}}", value=value, std_error=310.0, unit="N/m",
                  at={"run": run, "coil_current": 2.0 * (place % 4)})
        for place, run in enumerate(NAMES) for number, value in enumerate(values[place])
    ]  # fmt: skip
    parameters[7] = parameters[7].model_copy(
        update={"value": None, "std_error": None, "description": "only 3 samples are left"}
    )
    runs = [
        Run(run=run, used=place % 40 != 3, reason=f"the force is clipped at {place} N" if place % 40 == 3 else "",
            conditions={"coil_current": 2.0 * (place % 4), "frequency": 2.0 + place % 50, "operator": "A. B."},
            files=[f"logs/{run}.csv"], sha256=[f"{place:064x}"], duration=4.0, n_samples=20_000,
            repairs=[f"gap of {place} ms closed", "repeated time stamps: 3 rows dropped"])
        for place, run in enumerate(NAMES)
    ]  # fmt: skip
    quality = [Quality(level="note", run=run, channel="force", message="no unit is told; N is taken") for run in NAMES]
    quality += [
        Quality(level="warning", run=run, channel="force", span=(1.0, 1.5), message=f"{place + 300} samples are clipped")
        for place, run in enumerate(NAMES)
    ]  # fmt: skip
    quality.append(Quality(level="error", run=NAMES[5], channel="displacement", message="the channel is dead"))
    models = [
        ModelResult(name=name, family=f"run {run}", selected=name == "ks", n_parameters=3, n_data=9, nrmse=0.01, aicc=1.0)
        for run in NAMES for name in ("ks", "ka")
    ]  # fmt: skip
    return Findings(
        schema_version=1, campaign="pads", experiment="toy.pads", verdict="warning",
        reasons=[f"Run '{run}' is off by {place / 10:.1f} %." for place, run in enumerate(NAMES[:300])],
        parameters=parameters, models=models, quality=quality, runs=runs,
        advice=[f"Repeat run '{run}'." for run in NAMES[:99]],
        provenance={"logs": {run.files[0]: run.sha256[0] for run in runs}, "hosts": NAMES},
    )  # fmt: skip


def test_a_page_of_a_thousand_runs_is_small_and_paints_at_once(
    many: Findings, make_experiment: Callable[..., Experiment]
) -> None:
    html = render_report(many, make_experiment(lambda _: []), "", "rigfit run")
    assert len(html.encode()) < 2e5
    assert html.count("<") - html.count("</") < 6000
    assert "Run &#39;…&#39; is off by 0.0 … 29.9\xa0%. (300 times: r0000, r0001, r0002, r0003 and 296 more)" in html
    assert "rigfit export pads --to csv" in html


def test_a_command_of_very_many_logs_is_told_by_both_ends(
    many: Findings, make_experiment: Callable[..., Experiment]
) -> None:
    bare = many.model_copy(update={"parameters": [], "quality": [], "runs": [], "models": [], "reasons": []})
    words = ["rigfit", "run", *(f"logs/{run}.csv" for run in NAMES), "--out", "here"]
    html = render_report(bare, make_experiment(lambda _: []), "", " ".join(words))
    assert "rigfit run logs/r0000.csv" in html
    assert "… 924 more words …" in html
    assert "logs/r0999.csv --out here" in html


def test_sentences_are_gathered_by_what_they_say() -> None:
    texts = [
        "run 'a1' is late by 3 ms",
        "run 'b' is late by -0.5 ms",
        "the force of a1 is dead",
        "run 'a1' is late by 7",
    ]
    one, dead, other = gathered(texts, {"a1", "b"})
    assert (one.text, list(one.places), list(one.runs)) == ("run '…' is late by -0.5 … 3 ms", [0, 1], ["a1", "b"])
    assert (dead.text, other.text) == (texts[2], texts[3])


def test_names_that_are_numbers_count_as_names_between_quotes_only() -> None:
    one, other = gathered(["run '3': 3 samples", "run '4': 5 samples", "ai0 is 1e-3 or 2.5e+4"], {"3", "4"})
    assert one.text == "run '…': 3 … 5 samples"
    assert list(one.runs) == ["3", "4"]
    assert other.text == "ai0 is 1e-3 or 2.5e+4"


def test_what_differs_besides_keeps_sentences_apart() -> None:
    assert len(gathered(["dead", "dead"], (), ["force", "displacement"])) == 2


def test_few_sentences_stay_as_they_are() -> None:
    texts = [f"run 'r{number}' is left out" for number in range(MOST_TOLD)]
    assert told(texts, ["r1"]) == texts
    assert told([*texts, "the pad is warm"], [f"r{n}" for n in range(MOST_TOLD)])[1:] == ["the pad is warm"]


def test_more_kinds_than_can_be_listed_are_counted() -> None:
    lines = told(["sentence " + "x" * number for number in range(60)], [])
    assert len(lines) == MOST_TOLD + 1
    assert lines[-1] == "20 more sentences in findings.json."


def test_the_same_finding_of_many_runs_is_one_row_and_errors_come_first(many: Findings) -> None:
    view = quality_table(many.quality, many.runs)
    texts = [[shown.text for shown in row] for row in view.rows]
    assert [row[4] for row in texts] == [
        "the channel is dead", "300 … 1299 samples are clipped", "no unit is told; N is taken",
    ]  # fmt: skip
    assert "<summary>1000 runs: r0000, r0001, r0002, r0003 …</summary>" in texts[1][1]
    assert (texts[0][1], texts[1][3]) == ("r0005", "1 to 1.5")
    repairs = repairs_table(many.runs)
    assert repairs is not None
    assert [row[0].text for row in repairs.rows] == ["gap of 0 … 999 ms closed", "repeated time stamps: 3 rows dropped"]


def test_parameters_of_many_runs_are_summed_up_by_condition_where_few(many: Findings, experiment: Experiment) -> None:
    few = [p for p in many.parameters if p.name in ("p0", "p7")]
    (view,) = parameter_tables(many.model_copy(update={"parameters": few}), experiment)
    assert view.title == "Parameters of 1000 runs, summed up"
    assert [row[1].text for row in view.rows] == ["250"] * 4 + ["249"] + ["250"] * 3
    assert "coil current 2 A" in view.rows[1][0].text
    assert view.rows[4][1].below == "of 250"
    assert "only 3 samples are left (1)" in view.rows[4][0].below
    first = [p for p in few if p.name == "p0" and p.at["coil_current"] == 0.0]
    lowest = min(first, key=lambda p: p.value or 0.0)
    assert view.rows[0][4].below == lowest.at["run"]
    assert float(view.rows[0][2].text) == pytest.approx(np.median([p.value or 0.0 for p in first]) / 1e3, abs=0.1)


@pytest.mark.thorough
def test_of_many_quantities_conditions_are_not_told_apart(many: Findings, experiment: Experiment) -> None:
    (view,) = parameter_tables(many, experiment)
    assert len(view.rows) == 30 * 4
    wide = [
        p.model_copy(update={"at": {**p.at, "frequency": float(place % 50)}}) for place, p in enumerate(many.parameters)
    ]
    (view,) = parameter_tables(many.model_copy(update={"parameters": wide}), experiment)
    assert len(view.rows) == 30


def test_runs_left_out_and_conditions_are_told_at_a_glance(many: Findings, experiment: Experiment) -> None:
    (conditions, left_out, runs), same = runs_tables(many.runs, experiment)
    told_ = {row[0].text: row[1].text for row in conditions.rows}
    assert told_["coil current"] == "0 A (250); 2 A (250); 4 A (250); 6 A (250)"
    assert told_["frequency"] == "2 … 51 Hz; median 26.5 Hz; 50 values"
    assert [(row[0].text, row[1].text) for row in left_out.rows] == [("the force is clipped at 3 … 963 N", "25")]
    assert runs.left_out == 940
    assert "operator A. B." in same


def test_one_hash_stands_for_all_logs(many: Findings) -> None:
    view = logs_table(many)
    assert view is not None
    lines = "".join(f"{place:064x}  logs/{run}.csv\n" for place, run in enumerate(NAMES))
    assert hashlib.sha256(lines.encode()).hexdigest() in view.rows[0][1].text


def test_very_many_fits_are_counted_by_model(many: Findings) -> None:
    view = models_table(many.models)
    assert [[shown.text for shown in row][:3] for row in view.rows] == [
        ["ks", "1\u202f000", "1\u202f000"], ["ka", "1\u202f000", "0"],
    ]  # fmt: skip


def test_a_figure_of_very_many_panels_is_cut_and_says_so() -> None:
    panel = Panel([Points(np.arange(3.0), np.arange(3.0))])
    view = figure_view(Figure("loops", "Loops", "All loops.", "", [panel] * 70, columns=4), 1)
    assert len(view.grids[0][1]) == 60
    assert view.caption == "All loops. The first 60 of 70 panels are drawn."


@pytest.mark.parametrize(("runs", "most"), [(100, 90_000), (1000, 90_000), (10_000, 400_000)])
def test_a_trend_stays_small_at_any_number_of_runs(
    runs: int, most: int, many: Findings, make_experiment: Callable[..., Experiment]
) -> None:
    values = 10.0 + np.random.default_rng(2).normal(size=runs) * 0.1
    number = over_runs("stiffness", "N/m", [f"r{place}" for place in range(runs)], values, np.full(runs, 0.05))
    figure = trend_figure([number], "trend", "Stiffness over the runs", "Does it change?")
    bare = many.model_copy(update={"parameters": [], "quality": [], "runs": [], "models": [], "reasons": []})
    without = render_report(bare, make_experiment(lambda _: []), "", "")
    page = render_report(bare, make_experiment(lambda _: [Section("s", "S", [figure])]), "", "")
    assert len(page) - len(without) < most
    assert page.count("<") - without.count("<") < 1400
    assert "NaN" not in page


def test_many_points_are_one_path() -> None:
    x = np.arange(1000.0)
    panel = Panel([Points(x, np.sin(x), label="sine")], Axis("x"), Axis("y"))
    ((_, (drawn,)), *_) = figure_view(
        Figure(
            "p",
            "P",
            "",
            "",
            [
                panel,
            ],
            columns=1,
        ),
        1,
    ).grids
    assert drawn.count("<use") < 20
    assert drawn.count("h0") == 1000
    assert "stroke-linecap:round" in drawn
