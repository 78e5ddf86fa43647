"""What names a mark: a word at its end where it runs from left to right, else an entry of the figure's key."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.findings.figures import Band, Figure, Line, Mark, Outline, Panel, Points, Role, Stems
from pipeline.report.scale import extent
from pipeline.report.words import clean, text_width

# A word at a line's end must leave the panel to the data.
_MOST_DIRECT = 6
_LONGEST_DIRECT = 15
_PANELS_WITH_REPEATED_WORDS = 2
_FAR_FROM_THE_EDGE = 0.3  # of the width

Named = Line | Points | Outline | Stems | Band
_Curve = Line | Points | Outline | Stems  # named by their role where they bear no label


@dataclass(frozen=True)
class Key:
    """One entry of a figure's key: what it is called and all that is drawn under that name."""

    label: str
    role: Role
    line: bool = False
    dashed: bool = False
    points: bool = False
    band: bool = False
    stems: bool = False

    def also(self, mark: Named) -> Key:
        """Return the entry with the look of `mark` added."""
        if isinstance(mark, Line):
            return replace(self, line=True, dashed=self.dashed or mark.dashed)
        if isinstance(mark, Outline):
            return replace(self, line=True, band=True)
        if isinstance(mark, Stems):
            return replace(self, stems=True)
        return replace(self, points=True) if isinstance(mark, Points) else replace(self, band=True)


def label_of(mark: Named, named_by_role: bool) -> str:
    """Return a mark's label; without one, a role that speaks for itself; '' of texts that stand on their points."""
    if _bare(mark):
        return ""
    return clean(mark.label) or (mark.role if named_by_role and isinstance(mark.role, str) else "")


def _bare(mark: Mark) -> bool:
    return isinstance(mark, Points) and mark.bare


def _roles_differ(panel: Panel) -> bool:
    """Tell whether marks of several roles (measured, model, ...) need telling apart."""
    roles = {mark.role for mark in panel.marks if isinstance(mark, _Curve) and not _bare(mark)}
    return len({role for role in roles if isinstance(role, str)}) > 1


def _labels(panel: Panel) -> set[str]:
    by_role = _roles_differ(panel)
    return {label_of(mark, by_role) for mark in panel.marks if isinstance(mark, _Curve)}


def _runs_to_the_right(mark: Named) -> bool:
    x = np.asarray(mark.x, float)
    x = x[np.isfinite(x)]
    return x.size > 0 and bool(np.all(np.diff(x) >= 0))


def _reaches_the_right(mark: Named, panel: Panel) -> bool:
    """Tell whether a mark ends near the right edge, so that a word there is taken for its name."""
    own, all_of_them = extent([mark], "x", log=False), extent(panel.marks, "x", log=False)
    if own is None or all_of_them is None:
        return False
    low, high = all_of_them
    return own[1] >= high - _FAR_FROM_THE_EDGE * (high - low)


def ends(figure: Figure, panel: Panel, columns: int) -> Mapping[str, Line | Points]:
    """Return the marks that are named at their right end, by label; the rest belongs to `keys`."""
    by_role = _roles_differ(panel)
    drawn = [mark for mark in panel.marks if isinstance(mark, Line | Points) and label_of(mark, by_role)]
    near = [mark for mark in drawn if _reaches_the_right(mark, panel)]
    if any(isinstance(m, Points) and not _reaches_the_right(m, panel) for m in drawn):
        near = [mark for mark in near if not isinstance(mark, Points)]  # points beside points are named in one place
    drawn = near
    if any(isinstance(mark, Outline | Stems) or (isinstance(mark, Line) and mark.closed) for mark in panel.marks):
        return {}
    if columns > 2 or not all(_runs_to_the_right(mark) for mark in drawn):
        return {}
    panels_with = Counter(label for other in figure.panels for label in _labels(other))
    crowded = len(figure.panels) > _PANELS_WITH_REPEATED_WORDS
    found: dict[str, Line | Points] = {}
    roles: dict[str, set[Role]] = {}
    for mark in drawn:
        label = label_of(mark, by_role)
        roles.setdefault(label, set()).add(mark.role)
        if (crowded and panels_with[label] > 1) or text_width(label, 1.0) > 0.58 * _LONGEST_DIRECT:
            return {}
        if not isinstance(found.get(label), Line):  # the end of a curve says more than its last point
            found[label] = mark
    ambiguous = any(len(shared) > 1 for shared in roles.values())
    return {} if ambiguous or len(found) > _MOST_DIRECT else found


def keys(figure: Figure, columns: int) -> list[Key]:
    """Return the key of a figure: every label that is neither at its mark nor the title of its panel, once."""
    found: dict[tuple[str, Role], Key] = {}
    for panel in figure.panels:
        by_role = _roles_differ(panel)
        at_ends = ends(figure, panel, columns)
        for mark in panel.marks:
            if not isinstance(mark, Named):
                continue
            label = clean(mark.label) if isinstance(mark, Band) else label_of(mark, by_role)
            if label and label not in at_ends and label != clean(panel.title):
                known = found.get((label, mark.role), Key(label, mark.role))
                found[label, mark.role] = known.also(mark)
    return list(found.values())
