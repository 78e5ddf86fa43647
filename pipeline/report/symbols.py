r"""Symbols of the papers, ``k_{MR}`` or ``\dot{x}``, as HTML. Knows the little LaTeX that symbols need.

What it does not understand is shown as it stands, escaped.
"""

from __future__ import annotations

import re
from collections.abc import Collection

from markupsafe import Markup, escape

from pipeline.report.words import clean

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "varepsilon": "ε", "zeta": "ζ", "eta": "η",
    "theta": "θ", "vartheta": "ϑ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ",
    "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "φ", "varphi": "ϕ", "chi": "χ",
    "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π",
    "Sigma": "Σ", "Upsilon": "Υ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω",
}  # fmt: skip
_SIGNS = {
    "cdot": "·", "times": "×", "pm": "±", "infty": "∞", "circ": "°", "degree": "°", "prime": "′", "partial": "∂",
    "ell": "ℓ", "perp": "⊥", "parallel": "∥", "approx": "≈", "le": "≤", "leq": "≤", "ge": "≥", "geq": "≥", "to": "→",
    "rightarrow": "→", "ast": "∗", "star": "⋆", "ldots": "…", "dots": "…", "langle": "⟨", "rangle": "⟩", "nabla": "∇",
    "left": "", "right": "", "quad": " ", "%": "%", "_": "_", "&": "&", "#": "#", "$": "$", "{": "{", "}": "}",
    "|": "‖", ",": "\u202f", ";": " ", ":": " ", " ": " ", "!": "",
}  # fmt: skip
_ACCENTS = {
    "dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "widehat": "\u0302", "bar": "\u0304", "overline": "\u0305",
    "tilde": "\u0303", "vec": "\u20d7",
}  # fmt: skip
_UPRIGHT = {"mathrm", "text", "textrm", "operatorname", "rm"}
_AS_IT_IS = {"mathit", "mathsf", "mathcal", "boldsymbol", "mathbf", "bf"}
# A letter with an index, as papers write it where there is no type: k_xx, Δp_f, T_C2. Names of channels and files are longer or quoted.
_INDEXED = (
    r"(?<![\w.'\"])(?P<base>Δ?[A-Za-zΑ-Ωα-ω]\d?)_(?P<index>[A-Za-z0-9]{1,3}(?:,[A-Za-z0-9]{1,2})?)(?![\w'\"]|\.\w)"
)
_RAISED = r"(?<=[\w)])\^(?P<power>[-−]?\d+(?:\.\d+)?)(?![\w]|\.\d)"
_WRITTEN = re.compile(f"{_INDEXED}|{_RAISED}")
_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|[A-Za-z]+|\d+(?:\.\d+)?|\s+|.", re.DOTALL)
_DEEPEST = 12


class _OddSymbolError(ValueError):
    pass


class _Symbol:
    """Reads tokens from left to right into HTML."""

    def __init__(self, text: str) -> None:
        self.tokens = _TOKEN.findall(text)
        self.place = 0

    def peek(self) -> str:
        return self.tokens[self.place] if self.place < len(self.tokens) else ""

    def take(self) -> str:
        token = self.peek()
        if not token:
            raise _OddSymbolError
        self.place += 1
        return token

    def row(self, depth: int, end: str = "", upright: bool = False) -> Markup:
        """Read until `end` (a closing brace, or the end of the text)."""
        if depth > _DEEPEST:
            raise _OddSymbolError
        parts = Markup()
        while self.peek() != end:
            parts += self.atom(depth, upright)
        if end:
            self.take()
        return parts

    def argument(self, depth: int, upright: bool = False) -> Markup:
        """Read ``{...}``, or the one token without braces; ``k_MR`` is read as the ``k_{MR}`` that is meant."""
        while self.peek().isspace():
            self.take()
        if self.peek() == "{":
            self.take()
            return self.row(depth + 1, "}", upright)
        return self.atom(depth + 1, upright)

    def script(self, depth: int, tag: str) -> Markup:
        """Read a sub- or superscript; a word there is a name and stands upright."""
        content = self.argument(depth)
        word = re.fullmatch(r"<var>(\w{2,})</var>(\d*)", content)
        return Markup("<{0}>{1}</{0}>").format(tag, Markup(word[1] + word[2]) if word else content)

    def atom(self, depth: int, upright: bool) -> Markup:
        token = self.take()
        if token == "{":
            return self.row(depth + 1, "}", upright)
        if token == "}":
            raise _OddSymbolError
        if token in "_^":
            return self.script(depth, "sub" if token == "_" else "sup")
        if token[0] == "\\":
            return self.command(token[1:], depth, upright)
        if token[0].isalpha() and not upright:
            return Markup("<var>{}</var>").format(token)
        if token.isspace():
            return escape(" ") if upright else Markup()
        return escape({"-": "−", "'": "′", "~": "\u00a0", "*": "∗"}.get(token, token))

    def command(self, name: str, depth: int, upright: bool) -> Markup:
        if name in _GREEK:
            return Markup("<var>{}</var>").format(_GREEK[name])
        if name in _SIGNS:
            return escape(_SIGNS[name])
        if name in _UPRIGHT:
            return self.argument(depth, upright=True)
        if name in _AS_IT_IS:
            content = self.argument(depth, upright)
            return Markup("<b>{}</b>").format(content) if name in ("mathbf", "boldsymbol", "bf") else content
        if name in _ACCENTS:
            content = self.argument(depth, upright)
            # the accent follows the letter that it stands over, inside the element of that letter
            return Markup(re.sub(r"(\w)(</var>)?$", rf"\1{_ACCENTS[name]}\2", str(content), count=1))
        if name in ("frac", "tfrac", "dfrac"):
            above, below = self.argument(depth), self.argument(depth)
            return Markup("{}/{}").format(above, below)
        if name == "sqrt":
            return Markup("√({})").format(self.argument(depth))
        if name.isalpha():  # \max, \log: a name, upright
            return escape(name)
        raise _OddSymbolError


def symbols_in(text: str, names: Collection[str] = ()) -> str:
    """Return running text with its symbols and powers set as such, as `Markup` where it holds any; `names` are none.

    Examples
    --------
    >>> str(symbols_in("L_c & N/s^1.5 of flex_voltage"))
    '<var>L</var><sub>c</sub> &amp; N/s<sup>1.5</sup> of flex_voltage'
    """
    if isinstance(text, Markup):
        return text
    parts, end = Markup(), 0
    for found in _WRITTEN.finditer(text):
        if found[0] in names:
            continue
        parts += escape(text[end : found.start()])
        if found["base"]:
            parts += Markup("<var>{}</var><sub>{}</sub>").format(found["base"], found["index"])
        else:
            parts += Markup("<sup>{}</sup>").format(found["power"].replace("-", "−"))
        end = found.end()
    return parts + escape(text[end:]) if end else text


def symbol_text(symbol: Markup) -> str:
    """Return what `symbol_html` made as text without type.

    Examples
    --------
    >>> symbol_text(symbol_html("k_{MR}"))
    'k_MR'
    """
    return Markup(str(symbol).replace("<sub>", "_").replace("<sup>", "^")).striptags()


def symbol_html(latex: str) -> Markup:
    r"""Return a symbol as HTML with ``<var>``, ``<sub>`` and ``<sup>``; anything odd escaped as it stands.

    Examples
    --------
    >>> str(symbol_html("k_{MR}"))
    '<var>k</var><sub>MR</sub>'
    >>> str(symbol_html(r"\alpha"))
    '<var>α</var>'
    """
    latex = clean(latex)
    text = latex.removeprefix("$").removesuffix("$").strip()
    try:
        return _Symbol(text).row(0)
    except _OddSymbolError:
        return escape(latex)
