"""How each role looks, everywhere: colour, marker, dash. One table for figures, legends and the page's CSS.

Figures are drawn in the light colours; `css_colour` turns each into a CSS variable, so the page's
dark mode recolours them. All stand 4.5:1 against the page, light and dark, and apart from each
other by hue and lightness also for colour-blind eyes; markers and direct labels say it twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline.findings.figures import Role

PAPER = ("#ffffff", "#171b22")
INK = ("#1b1f24", "#e8ebef")
QUIET = ("#565e68", "#a7afba")
GRID = ("#dfe3e8", "#333a45")


@dataclass(frozen=True)
class Style:
    """A role's look: CSS variable, colour on light and on dark, matplotlib marker, its SVG path, line width.

    `hollow` markers and dashed lines tell the ninth to sixteenth series from the first eight.
    """

    variable: str
    light: str
    dark: str
    marker: str
    marker_path: str
    width: float = 1.6
    hollow: bool = False


# Paths fill a square from -4 to 4.
_CIRCLE = "M-3.4 0a3.4 3.4 0 1 0 6.8 0a3.4 3.4 0 1 0-6.8 0z"
_SQUARE = "M-3-3H3V3H-3z"
_UP = "M0-3.8L3.8 3.2H-3.8z"
_DOWN = "M0 3.8L3.8-3.2H-3.8z"
_DIAMOND = "M0-4.2L4.2 0 0 4.2-4.2 0z"
_CROSS = "M-4-2.4L-2.4-4 0-1.6 2.4-4 4-2.4 1.6 0 4 2.4 2.4 4 0 1.6-2.4 4-4 2.4-1.6 0z"
_PLUS = "M-1.2-4H1.2V-1.2H4V1.2H1.2V4H-1.2V1.2H-4V-1.2H-1.2z"
_PENTAGON = "M0-4L3.8-1.2 2.4 3.2H-2.4L-3.8-1.2z"

_ROLES = {
    "measured": Style("measured", "#0067a5", "#5bb4ea", "o", _CIRCLE, 2.0),
    "model": Style("model", "#c24400", "#ff9559", "s", _SQUARE, 1.5),
    "reference": Style("reference", "#6a6f76", "#a0a7b0", "D", _DIAMOND, 1.2),
    "residual": Style("residual", "#0f5a3e", "#adf2c7", "v", _DOWN, 1.2),
    "fault": Style("fault", "#8a0072", "#e040fb", "X", _CROSS, 2.4),
}
_SERIES = tuple(
    Style(f"series-{number}", light, dark, marker, path)
    for number, (light, dark, marker, path) in enumerate(
        (
            ("#0067a5", "#5bb4ea", "o", _CIRCLE),
            ("#c24400", "#ff9559", "s", _SQUARE),
            ("#138741", "#83ffb5", "^", _UP),
            ("#b1507c", "#fb3aae", "D", _DIAMOND),
            ("#4c3f02", "#e2e11c", "v", _DOWN),
            ("#5c2ea9", "#9976fa", "P", _PLUS),
            ("#0a4246", "#c8e4e9", "X", _CROSS),
            ("#632522", "#bf957a", "p", _PENTAGON),
        )
    )
)


def style(role: Role) -> Style:
    """Return the look of a role; series repeat after eight with hollow markers, after sixteen as they are."""
    if not isinstance(role, int):
        return _ROLES[role]
    look = _SERIES[role % len(_SERIES)]
    return replace(look, hollow=True) if role // len(_SERIES) % 2 else look


def all_styles() -> tuple[Style, ...]:
    """Return the look of every role and series."""
    return (*_ROLES.values(), *_SERIES)


def css_variables(dark: bool) -> str:
    """Return the colours as CSS custom properties."""
    named = {"paper": PAPER, "ink": INK, "quiet": QUIET, "grid": GRID}
    named |= {look.variable: (look.light, look.dark) for look in all_styles()}
    return "".join(f"--{name}:{pair[dark]};" for name, pair in named.items())


# Roles and the first series share colours; either variable gives the same.
_VARIABLES = {pair[0]: name for name, pair in {"paper": PAPER, "ink": INK, "quiet": QUIET, "grid": GRID}.items()}
_VARIABLES |= {look.light: look.variable for look in reversed(all_styles())}


def css_colour(light: str) -> str:
    """Return ``var(--name)`` for a colour of the light palette, any other colour unchanged."""
    return f"var(--{_VARIABLES[light]})" if light in _VARIABLES else light
