"""Findings and what their experiment declares -> one HTML file that needs nothing else."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from pipeline.errors import counted
from pipeline.findings import Findings
from pipeline.report.accounts import quality_counts
from pipeline.report.chapters import Chapter, chapters
from pipeline.report.citation import citation
from pipeline.report.figure import FigureView
from pipeline.report.gathered import told
from pipeline.report.naming import naming_of
from pipeline.report.palette import css_variables
from pipeline.report.words import clean, harmless, shortened
from pipeline.report.zoom import Zoom, zoom
from pipeline.rigs.experiment import Experiment

if TYPE_CHECKING:
    from jinja2 import Environment

_LONGEST_NAME = 30.0  # of a log, in widths of an m
VERDICTS = {
    "ok": ("OK", "The numbers below can be used with the intervals given."),
    "warning": ("Warning", "The numbers below can be used, with reservations."),
    "rejected": ("Rejected", "The numbers below are not to be used."),
}


def render_report(findings: Findings, experiment: Experiment, title: str, command: str, revision: str = "") -> str:
    """Return the report of one campaign as the text of an HTML file.

    The same arguments give the same text, byte for byte.

    Parameters
    ----------
    findings
        What was identified, with its arrays.
    experiment
        The declaration of the experiment that the findings are of.
    title
        Heading of the report; the experiment's title where empty. The logs are named below it.
    command
        What was typed to get here, shown for whoever repeats it.
    revision
        Of the code that made the findings, as Git calls it; '' where it is unknown.
    """
    made = chapters(findings, experiment, command, revision)
    naming = naming_of(findings, experiment)
    long = _long_signals(made)
    return page(
        "report.html.j2",
        long.scripts,
        long.styles,
        title=title or experiment.title,
        logs=_logs(findings),
        findings=findings,
        experiment=experiment,
        source=citation(experiment.references[0]) if experiment.references else "",
        verdict=VERDICTS[findings.verdict],
        reasons=[naming.text(text) for text in told(findings.reasons, (run.run for run in findings.runs))],
        facts=_facts(findings),
        chapters=made,
        zoom=long.data,
    )


def _long_signals(made: Sequence[Chapter]) -> Zoom:
    views = [view for chapter in made for view in chapter.blocks if isinstance(view, FigureView)]
    drawn = sum(len(drawing) for view in views for _, grid in view.grids for drawing in grid)
    return zoom((signal for view in views for signal in view.signals), drawn)


def page(template: str, scripts: Sequence[str] = (), styles: Sequence[str] = (), **content: Any) -> str:
    """Render a template with the style sheet of all pages, `styles` and `scripts` inlined; the page runs no other ones."""
    allowed = " ".join(f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" for script in scripts)
    return (
        _environment()
        .get_template(template)
        .render(
            style=Markup("\n").join([*map(Markup, styles), _style()]),
            scripts=[Markup(script) for script in scripts],
            script_source=Markup(allowed or "'none'"),
            **content,
        )
    )


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: harmless(value) if type(value) is str else value,
    )


@cache
def _style() -> Markup:
    light, dark = css_variables(dark=False), css_variables(dark=True)
    rules = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
    return Markup(f":root{{{light}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n{rules}")


def _logs(findings: Findings) -> str:
    """Name the logs: one or two by their names, more by their number, the first and the last."""
    files = (PurePath(clean(path)).name for run in findings.runs for path in run.files)
    names = list(dict.fromkeys(shortened(name, _LONGEST_NAME, 1.0) for name in files))
    return " and ".join(names) if len(names) < 3 else f"{len(names)} logs, {names[0]} to {names[-1]}"


def _facts(findings: Findings) -> list[str]:
    """Return what a glance should tell: how many runs, how many of them used, what the data's quality was."""
    used = sum(run.used for run in findings.runs)
    runs = counted(len(findings.runs), "run")
    undetermined = sum(parameter.value is None for parameter in findings.parameters)
    facts = [f"{runs}, {'all' if used == len(findings.runs) else used} used" if findings.runs else "no run is listed"]
    noticed = [counted(n, level) for level, n in quality_counts(findings.quality).items() if n]
    facts += [f"{', '.join(noticed)} on the data"] if noticed else []
    facts += [f"{undetermined} of {len(findings.parameters)} parameters not determined"] if undetermined else []
    return facts
