"""What pydantic finds wrong in a recipe, in the words of whoever wrote it: line, key, what it is, what it should be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from pipeline.campaign import yaml_text
from pipeline.errors import listing, nearest

_LINES = "'key: value' lines or {key: value}"
# By pydantic's name of the fault, what was expected; what is not here begins with "Input should be".
_EXPECTED = {
    "model_type": _LINES,
    "dict_type": _LINES,
    "list_type": "a list such as [a, b]",
    "string_type": "text",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
}
# Faults that say more than that the value is of another kind.
_TELLING = {"value_error", "greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number"}


def first_fault(
    error: ValidationError, content: Any, path: str, model: type[BaseModel], above: tuple[str, ...] = ()
) -> str:
    """Say the first fault of `content` (as `yaml_text.load` gives it), which is of `model` below the keys `above`."""
    faults = [(_place(fault, content, above), fault) for fault in error.errors()]
    place, first = faults[0]
    line = yaml_text.line_of(content, place)
    at = f"{path} line {line}" if line else path
    key = ".".join(str(part) for part in place)
    if first["type"] == "extra_forbidden":
        known = _known_keys(model, place[len(above) : -1])
        hint = nearest(str(place[-1]), known)
        return f"{at}: unknown key '{place[-1]}'.{hint} Known keys here: {listing(known, 40)}."
    if first["type"] == "missing":
        return f"{at}: the key '{key}' is missing; add '{place[-1]}: ...'."
    same = [fault for other, fault in faults if other == place]
    if any(fault["type"] in _TELLING for fault in same):
        same = [fault for fault in same if fault["type"] in {*_TELLING, "literal_error"}]
    expected = " or ".join(dict.fromkeys(_expected(fault) for fault in same))
    meaning = _meaning(model, place[len(above) :])
    return f"{at}: '{key}' is {_shown(same[0]['input'])}; expected is {expected}.{meaning}"


def _place(fault: ErrorDetails, content: Any, above: tuple[str, ...]) -> tuple[str | int, ...]:
    """Return the place of a fault without the steps that pydantic adds for kinds of value."""
    place: list[str | int] = []
    inside = yaml_text.plain(content)
    steps = [*above, *fault["loc"]]
    for number, step in enumerate(steps):
        there = step in inside if isinstance(inside, dict) else isinstance(inside, list) and isinstance(step, int)
        if there:
            place.append(step)
            inside = inside[step]
        elif fault["type"] == "missing" and number == len(steps) - 1:
            place.append(step)
    return tuple(place)


def _expected(fault: ErrorDetails) -> str:
    if fault["type"] == "literal_error":
        return str(fault.get("ctx", {}).get("expected", ""))
    said = _EXPECTED.get(fault["type"]) or str(fault["msg"])
    for opening in ("Value error, ", "Input should be "):
        said = said.removeprefix(opening)
    return said[:1].lower() + said[1:]


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return "made of 'key: value' lines"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    return "empty" if value is None else f"'{value}'"


def _meaning(model: type[BaseModel], place: Sequence[str | int]) -> str:
    """Return what a key means, where its model says so."""
    field = model.model_fields.get(str(place[0])) if len(place) == 1 else None
    return f" It is: {field.description}." if field is not None and field.description else ""


def _known_keys(model: type[BaseModel], place: Sequence[str | int]) -> list[str]:
    """Return the keys that `model` knows at a nested place, following the models inside it."""
    inner: Any = model
    for step in place:
        if isinstance(inner, type) and issubclass(inner, BaseModel) and step in inner.model_fields:
            inner = inner.model_fields[str(step)].annotation
        models = _models_in(inner)
        if models:
            inner = models[0]
    return list(inner.model_fields) if isinstance(inner, type) and issubclass(inner, BaseModel) else []


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for argument in getattr(annotation, "__args__", ()) for m in _models_in(argument)]
