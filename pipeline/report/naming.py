"""Names of parameters in running text and in cells, set as the symbols of the paper: ``kxx2`` as k with an index.

Words of the language that happen to be names, such as ``clearance``, stay words.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

from markupsafe import Markup, escape

from pipeline.findings import Findings
from pipeline.findings.figures import Figure, Mark, Matrix
from pipeline.report.figure import FigureView
from pipeline.report.symbols import symbol_html, symbol_text, symbols_in
from pipeline.report.table import TableView
from pipeline.rigs.experiment import Experiment, ParameterSpec

_View = TypeVar("_View")
_NOT_SPELLED = re.compile(r"[{}\\^$\s]")
_GREEK = re.compile(r"\\[a-z]+")
_BEFORE_PERCENT = re.compile(r"(?<=\d) (?=%)")
_NO_BREAK = "\u00a0"
_NO_INDEX = "\u2060"  # a joiner without width


class Naming:
    """Sets what is written like a symbol as that symbol.

    Parameters
    ----------
    parameters
        Those that the experiment declares.
    names
        What is none although it may be written like one: the runs.
    """

    def __init__(self, parameters: Iterable[ParameterSpec], names: Iterable[str] = ()) -> None:
        self._names = frozenset(names)
        self._odd = _any_of(name for name in self._names if isinstance(symbols_in(name), Markup))
        self._symbols = {text: symbol_html(spec.symbol) for spec in parameters for text in _spellings(spec)}
        self._found = _any_of(self._symbols)

    def text(self, text: str) -> str:
        """Return `text` as `Markup` where it holds symbols; what is `Markup` already stays. No line ends before '%'."""
        if isinstance(text, Markup):
            return text
        parts, end = Markup(), 0
        for found in self._found.finditer(text) if self._found else ():
            if found[0] not in self._names:
                parts += escape(self._symbols_in(text[end : found.start()])) + self._symbols[found[0]]
                end = found.end()
        rest = self._symbols_in(text[end:])
        return parts + escape(rest) if end else rest

    def _symbols_in(self, text: str) -> str:
        return symbols_in(_BEFORE_PERCENT.sub(_NO_BREAK, text), self._names)

    def plain(self, text: str) -> str:
        """Return `text` with symbols as signs without type, for labels in drawings: ``a_BW``, ``τ``."""
        return self._found.sub(lambda found: symbol_text(self._symbols[found[0]]), text) if self._found else text

    def drawn(self, figure: Figure) -> Figure:
        """Return a figure whose tables of numbers have symbols for the names of parameters, and whose names are no symbols."""
        panels = [replace(p, title=self._kept(p.title), marks=[*map(self._mark, p.marks)]) for p in figure.panels]
        return replace(figure, panels=panels)

    def _mark(self, mark: Mark) -> Mark:
        if isinstance(mark, Matrix):
            return replace(mark, rows=[*map(self.plain, mark.rows)], columns=[*map(self.plain, mark.columns)])
        return replace(mark, label=self._kept(mark.label)) if mark.label else mark

    def _kept(self, text: str) -> str:
        """Return `text` with the names in it that look like symbols, ``r_1``, so written that they are not set as such."""
        return self._odd.sub(lambda found: found[0].replace("_", f"_{_NO_INDEX}"), text) if self._odd else text

    def view(self, view: _View) -> _View:
        """Return a figure or a table with symbols in its words; any other view as it is."""
        if isinstance(view, FigureView):
            return replace(view, title=self.text(view.title), caption=self.text(view.caption))
        if isinstance(view, TableView):
            return replace(
                view,
                title=self.text(view.title),
                caption=self.text(view.caption),
                heads=[replace(head, text=self.text(head.text)) for head in view.heads],
                rows=[
                    [replace(one, text=self.text(one.text), below=self.text(one.below)) for one in row]
                    for row in view.rows
                ],
                notes=[replace(note, text=self.text(note.text)) for note in view.notes],
            )
        return view


def naming_of(findings: Findings, experiment: Experiment) -> Naming:
    """Return what sets the symbols of one campaign's report."""
    return Naming(experiment.parameters, (run.run for run in findings.runs))


def _any_of(words: Iterable[str]) -> re.Pattern[str] | None:
    any_word = "|".join(re.escape(text) for text in sorted(words, key=len, reverse=True))
    return re.compile(rf"(?<![\w.])(?:{any_word})(?!\w)") if any_word else None


def _spellings(spec: ParameterSpec) -> set[str]:
    """Return how a parameter is written where there is no type for symbols: ``k_p``, ``rho*``, ``kxx2``, ``alpha_bw``."""
    plain = _NOT_SPELLED.sub("", spec.symbol)
    if not plain:
        return set()
    code = "_" in spec.name or spec.name == plain.replace("_", "")
    spelled = "_" in plain or "*" in plain or bool(_GREEK.fullmatch(spec.symbol.strip("$ ")))
    return {text for text, told in ((spec.name, code), (plain, spelled)) if told and len(text) > 1}
