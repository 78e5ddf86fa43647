"""matplotlib's SVG made fit to stand inside a page: no outside names, theme colours, fewer bytes.

Works on the parsed tree, so nothing that stands in a text can be taken for markup.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from xml.etree import ElementTree

from markupsafe import Markup

from pipeline.report.palette import css_colour
from pipeline.report.symbols import symbols_in

_COLOURED = ("fill", "stroke")
_DROPPED_STYLES = ("font-family", "stroke-linejoin", "stroke-linecap", "font-style")
_DOT = re.compile(r"M([^ ]+ [^ ]+) \1(?=M|$)")
_PIECE = re.compile(r"(?:<(var|sub|sup)>)?([^<]+)(?:</\w+>)?")
# How a piece of a text is drawn, and how far below the line, in the size of the text.
_PIECES: Mapping[str, tuple[Mapping[str, str], float]] = {
    "": ({}, 0.0),
    "var": ({"font-style": "italic"}, 0.0),
    "sub": ({"font-size": ".75em"}, 0.24),
    "sup": ({"font-size": ".75em"}, -0.36),
}
_NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")


def inline(svg: str, title: str = "", description: str = "", name: str = "") -> Markup:
    """Return the drawing as an ``<svg class="panel">`` that scales with its box.

    With a `title` it is an image with that name and `description`, under ids made of `name`, which is
    unique in the page; without, it is silent to screen readers. Ids of groups are dropped; those that
    are referred to depend on ``svg.hashsalt``, which the caller sets to something unique as well.
    """
    root = ElementTree.fromstring(svg)
    view = root.get("viewBox", "")
    _strip(root)
    _lighten(root)
    for written in root.iter("text"):
        _set_symbols(written)
    root.attrib = {"class": "panel", "viewBox": view, "focusable": "false"}
    if title:
        root.attrib |= {"role": "img", "aria-labelledby": f"{name}-title", "aria-describedby": f"{name}-desc"}
        for place, (tag, text) in enumerate((("title", title), ("desc", description))):
            told = ElementTree.Element(tag, {"id": f"{name}-{tag}"})
            told.text = text
            root.insert(place, told)
    else:
        root.attrib["aria-hidden"] = "true"
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _strip(element: ElementTree.Element) -> None:
    """Remove namespaces, metadata, style sheets and ids that nothing refers to."""
    element.tag = element.tag.rpartition("}")[2]
    element.attrib = {name.rpartition("}")[2]: value for name, value in element.attrib.items()}
    if element.tag != "text":
        element.text = None
    element.tail = None
    if element.tag == "g":
        element.attrib.pop("id", None)
    for child in list(element):
        if child.tag.rpartition("}")[2] in ("metadata", "style"):
            element.remove(child)
        else:
            _strip(child)


def _lighten(element: ElementTree.Element) -> None:
    for child in list(element):
        _lighten(child)
    _shorten_attributes(element)
    if element.tag == "g":
        _share_style(element)
    children: list[ElementTree.Element] = []
    for child in element:
        if child.tag == "g" and not child.attrib:
            children.extend(child)
        elif len(child) or child.tag not in ("g", "defs"):
            children.append(child)
    element[:] = children


def _set_symbols(element: ElementTree.Element) -> None:
    """Set symbols and powers in a text as such: the letter slanted, its index small and lower."""
    written = symbols_in(element.text or "")
    if not isinstance(written, Markup):
        return
    element.text, drop = "", 0.0
    for tag, plain in _PIECE.findall(written):
        attributes, shift = dict(_PIECES[tag][0]), _PIECES[tag][1]
        size = float(attributes.get("font-size", "1em").removesuffix("em"))
        if shift != drop:
            attributes["dy"] = f"{(shift - drop) / size:.2f}em"
            drop = shift
        piece = ElementTree.SubElement(element, "tspan", attributes)
        piece.text = Markup(plain).unescape()


def _shorten_attributes(element: ElementTree.Element) -> None:
    attributes = element.attrib
    if "style" in attributes:
        attributes["style"] = _style(attributes["style"])
    if "d" in attributes:
        attributes["d"] = _path(attributes["d"])
    if attributes.get("transform", "").startswith(("rotate(-0 ", "rotate(0 ")):
        del attributes["transform"]
    for name in ("x", "y", "width", "height", "transform"):
        if name in attributes:
            attributes[name] = _NUMBER.sub(_two_decimals, attributes[name])


def _style(text: str) -> str:
    kept = []
    for entry in text.split(";"):
        name, _, value = (part.strip() for part in entry.partition(":"))
        if name and (name not in _DROPPED_STYLES or (name == "stroke-linecap" and value == "round")):
            kept.append(f"{name}:{css_colour(value) if name in _COLOURED else value}")
    return ";".join(kept)


def _path(text: str) -> str:
    """Return path data to a tenth of a point, straight segments without their letter."""
    short = " ".join(_NUMBER.sub(_one_decimal, text).split())
    if "C" not in short and "Q" not in short:
        short = short.replace("L ", "")
    short = re.sub(r" ?([MCQzL]) ?", r"\1", short)
    return _DOT.sub(r"M\1h0", short)


def _one_decimal(number: re.Match[str]) -> str:
    return f"{float(number[0]):.1f}".removesuffix(".0")


def _two_decimals(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def _share_style(group: ElementTree.Element) -> None:
    """Move a style that all markers of a group repeat to the group."""
    markers = [child for child in group if child.tag == "use"]
    styles = {marker.get("style", "") for marker in markers}
    if len(markers) > 1 and len(styles) == 1 and len(markers) + len(group.findall("defs")) == len(group):
        group.set("style", ";".join(filter(None, (group.get("style", ""), *styles))))
        for marker in markers:
            marker.attrib.pop("style", None)
