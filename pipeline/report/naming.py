"""Names of parameters in running text and in cells, set as the symbols of the paper: ``kxx2`` as k with an index.

Words of the language that happen to be names, such as ``clearance``, stay words.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

from markupsafe import Markup, escape

from pipeline.findings.figures import Figure, Mark, Matrix
from pipeline.report.figure import FigureView
from pipeline.report.symbols import symbol_html, symbol_text
from pipeline.report.table import TableView
from pipeline.rigs.experiment import ParameterSpec

_View = TypeVar("_View")
_NOT_SPELLED = re.compile(r"[{}\\^$\s]")
_GREEK = re.compile(r"\\[a-z]+")


class Naming:
    """Sets what is written like a symbol as that symbol.

    Parameters
    ----------
    parameters
        Those that the experiment declares.
    """

    def __init__(self, parameters: Iterable[ParameterSpec]) -> None:
        self._symbols = {text: symbol_html(spec.symbol) for spec in parameters for text in _spellings(spec)}
        words = "|".join(re.escape(text) for text in sorted(self._symbols, key=len, reverse=True))
        self._found = re.compile(rf"(?<![\w.])(?:{words})(?!\w)") if words else None

    def text(self, text: str) -> str:
        """Return `text` as `Markup` where it holds symbols; what is `Markup` already stays as it is."""
        if self._found is None or isinstance(text, Markup) or not self._found.search(text):
            return text
        parts, end = Markup(), 0
        for found in self._found.finditer(text):
            parts += escape(text[end : found.start()]) + self._symbols[found[0]]
            end = found.end()
        return parts + escape(text[end:])

    def plain(self, text: str) -> str:
        """Return `text` with symbols as signs without type, for labels in drawings: ``a_BW``, ``τ``."""
        return self._found.sub(lambda found: symbol_text(self._symbols[found[0]]), text) if self._found else text

    def drawn(self, figure: Figure) -> Figure:
        """Return a figure whose tables of numbers have symbols for the names of parameters."""
        return replace(figure, panels=[replace(one, marks=[*map(self._mark, one.marks)]) for one in figure.panels])

    def _mark(self, mark: Mark) -> Mark:
        if not isinstance(mark, Matrix):
            return mark
        return replace(mark, rows=[*map(self.plain, mark.rows)], columns=[*map(self.plain, mark.columns)])

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
                notes=[self.text(note) for note in view.notes],
            )
        return view


def _spellings(spec: ParameterSpec) -> set[str]:
    """Return how a parameter is written where there is no type for symbols: ``k_p``, ``rho*``, ``kxx2``, ``alpha_bw``."""
    plain = _NOT_SPELLED.sub("", spec.symbol)
    if not plain:
        return set()
    code = "_" in spec.name or spec.name == plain.replace("_", "")
    spelled = "_" in plain or "*" in plain or bool(_GREEK.fullmatch(spec.symbol.strip("$ ")))
    return {text for text, told in ((spec.name, code), (plain, spelled)) if told and len(text) > 1}
