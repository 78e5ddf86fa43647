"""An experiment's declaration as a page of Markdown: what a run must carry, what may be set, what is found, by which equations.

Everything on these pages stands in the code; nothing is written here a second time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from markupsafe import escape
from settings_words import what_it_may_be

from pipeline.campaign.project import recipe_template
from pipeline.report.citation import citation
from pipeline.report.equations import mathml
from pipeline.report.symbols import symbols_in
from pipeline.rigs.experiment import ConditionSpec, Equation, Experiment, Later, Range
from pipeline.rigs.registry import all_experiments

RECIPES = Path(__file__).parents[2] / "recipes"


def by_rig() -> Mapping[str, Sequence[Experiment]]:
    """Return the experiments of this package by rig."""
    found: dict[str, list[Experiment]] = {}
    for experiment in all_experiments().values():
        if isinstance(experiment.identify, Later) and experiment.identify.address.startswith("pipeline."):
            found.setdefault(experiment.rig, []).append(experiment)
    return found


def overview() -> str:
    """Return the page that lists all experiments."""
    rows = [
        [f'<a href="{e.id}.html"><code>{e.id}</code></a>', escape(e.title), escape(e.summary)]
        for found in by_rig().values()
        for e in found
    ]
    return "\n".join(
        [
            "# Experiments",
            "",
            "An experiment is one kind of test on a rig. Each page says what a run must carry, what a recipe may set, which",
            "parameters are found and by which equations. Channels, conditions and parameters are in SI; logs and recipes may",
            "use any unit of the same dimension.",
            "",
            *_table(["Experiment", "What it is", "What is identified"], rows),
        ]
    )


def page(experiment: Experiment) -> str:
    """Return the page of an experiment."""
    parts = [
        f"# {experiment.id}",
        "",
        f"**{experiment.title}.** {experiment.summary}",
        "",
        *_abilities(experiment),
        "## Channels",
        "",
        *_channels(experiment),
        "## Conditions",
        "",
        *_conditions(experiment.conditions),
        "## Settings",
        "",
        *_settings(experiment),
        "## Equations of the model",
        "",
        *(line for equation in experiment.equations for line in _equation(equation)),
        "## Parameters",
        "",
        *_parameters(experiment),
        "## Operating points",
        "",
        *_operating(experiment),
        "## A recipe to begin with",
        "",
        f"`rigfit new {experiment.id} my-campaign` writes it; channels that bear the experiment's own names need no entry.",
        "",
        "```yaml",
        recipe_template(experiment, "my-campaign").rstrip(),
        "```",
        "",
        *_example(experiment),
        "## References",
        "",
        *(f"{number}. {escape(citation(source))}" for number, source in enumerate(experiment.references, 1)),
        "",
    ]
    return "\n".join(parts)


def _abilities(e: Experiment) -> Iterable[str]:
    builds = ", ".join(f"[`{id_}`]({id_}.md)" for id_ in e.builds_on)
    yield f"- Makes logs of its synthetic rig: `rigfit synthesize {e.id} --out DIR`"
    yield f"- Checks logs by the rig's physics before anything is run: `rigfit check -e {e.id} LOG...`"
    if e.live:
        yield f"- Follows a record while it comes in: `rigfit run {e.id} LOG --out DIR --live`"
    if e.advise:
        yield "- Says which further runs would tell most: `rigfit advise CAMPAIGN`"
    if builds:
        yield f"- Can build on the findings of {builds}: `uses: [CAMPAIGN]` in the recipe, `--with FINDINGS` of `rigfit run`"
    if e.signals:
        yield "- Hands on what was measured and modelled over time, for Foxglove and PlotJuggler: `rigfit export CAMPAIGN --to mcap`"
    if e.reads_blocks:
        yield "- Holds only blocks of a record in memory, whatever its length"
    yield ""


def _channels(e: Experiment) -> Iterable[str]:
    rows = [
        [
            f"<code>{c.name}</code>",
            escape(c.unit or "text"),
            "required" if c.required else "optional",
            escape(c.description) + ("; may rest" if c.may_rest else ""),
            "" if c.limit is None else f"{c.limit:g}",
        ]
        for c in e.channels
    ]
    yield from _table(["Channel", "Unit", "Needed", "What it is", "Largest plausible size"], rows)


def _conditions(specs: Sequence[ConditionSpec]) -> Iterable[str]:
    if not specs:
        yield from ("None.", "")
        return
    rows = [
        [
            f"<code>{c.name}</code>",
            escape(c.unit or "text"),
            "required" if c.required else "optional",
            escape(c.description),
            "" if c.range == Range() or not c.unit else escape(c.range.told(c.unit)),
            "" if c.default is None else escape(str(c.default)),
        ]
        for c in specs
    ]
    yield from _table(["Condition", "Unit", "Needed", "What it is", "What it may be", "Default"], rows)
    yield from (
        "They come from `runs.csv`, the log itself, its file name or the recipe: [how](../logs.md#conditions).",
        "",
    )


def _settings(e: Experiment) -> Iterable[str]:
    fields = e.settings.model_fields
    if not fields:
        yield from ("None.", "")
        return
    rows = [
        [f"<code>{name}</code>", escape(what_it_may_be(field)), f"<code>{_written(field.get_default(call_default_factory=True))}</code>",
         escape(field.description or "")]
        for name, field in fields.items()
    ]  # fmt: skip
    yield from _table(["Setting", "What it may be", "Default", "What it sets"], rows)


def _written(value: object) -> str:
    """Return a default as a recipe would write it."""
    words = {None: "none", True: "true", False: "false"}
    return escape(words[value] if value is None or isinstance(value, bool) else str(value))


def _equation(equation: Equation) -> Iterable[str]:
    source = f" <small>({escape(equation.source)})</small>" if equation.source else ""
    yield f'<div class="equation" tabindex="0">{mathml(equation.latex)}</div>'
    yield f'<p class="told">{escape(symbols_in(equation.about))}{source}</p>'
    yield ""


def _example(e: Experiment) -> Iterable[str]:
    """Yield the recipe of the first example campaign of this experiment."""
    for path in sorted(RECIPES.glob("*.yaml")):
        text = path.read_text(encoding="utf-8")
        if f"experiment: {e.id}\n" in text:
            yield from (f"That of the example campaign `{path.stem}`, which `make reports` runs:", "")
            yield from ("```yaml", text.rstrip(), "```", "")
            return


def _parameters(e: Experiment) -> Iterable[str]:
    rows = [
        [
            f"<code>{p.name}</code>",
            mathml(p.symbol, display=False),
            escape(p.unit) + (f" <small>(read in {escape(p.read_as)})</small>" if p.read_as else ""),
            escape(p.description) + (" <strong>key</strong>" if p.key or p.key_at else ""),
            escape(p.source),
        ]
        for p in e.parameters
    ]
    yield from _table(["Parameter", "Symbol", "Unit", "What it is", "Source"], rows)
    yield from ("*Key* parameters stand on top of the report.", "")


def _operating(e: Experiment) -> Iterable[str]:
    if e.operating:
        rows = [[f"<code>{c.name}</code>", escape(c.unit or "text"), escape(c.description)] for c in e.operating]
        yield "What a parameter is told at, besides conditions and channels of the run:"
        yield ""
        yield from _table(["Name", "Unit", "What it is"], rows)
    else:
        yield from ("Parameters are told at conditions and channels of the run, or for the campaign as a whole.", "")


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterable[str]:
    """Yield a table as HTML, whose cells may hold MathML; columns that are empty throughout are left out."""
    shown = [i for i, _ in enumerate(heads) if any(row[i] for row in rows)]
    yield "<table>"
    yield "<thead><tr>" + "".join(f'<th scope="col">{heads[i]}</th>' for i in shown) + "</tr></thead>"
    yield "<tbody>"
    for row in rows:
        yield "<tr>" + "".join(f"<td>{row[i]}</td>" for i in shown) + "</tr>"
    yield "</tbody></table>"
    yield ""
