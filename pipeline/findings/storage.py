"""Findings on disk: ``findings.json`` and, beside it, ``arrays/<name>.parquet``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pyarrow import ArrowException
from pydantic import ValidationError

from pipeline import __version__
from pipeline.errors import InputError
from pipeline.findings.findings import SCHEMA_VERSION, Findings
from pipeline.findings.together import together

_ANEW = "Identify that campaign again: 'rigfit identify' with its name in a project, 'rigfit run' elsewhere."


def write(findings: Findings, folder: Path) -> None:
    """Write findings into `folder`: the arrays and the JSON appear together, or what was there stays."""
    with together(folder) as fresh:
        (fresh / "arrays").mkdir()
        for name, table in findings.arrays.items():
            table.to_parquet(fresh / "arrays" / f"{name}.parquet", index=False, compression="zstd")
        with (fresh / "findings.json").open("w", encoding="utf-8") as file:
            file.writelines(_json_parts(findings))


def to_json(findings: Findings) -> str:
    """Return the text of findings.json."""
    return "".join(_json_parts(findings))


def _json_parts(findings: Findings) -> Iterator[str]:
    """Yield the text of findings.json piece by piece: that of 10 000 runs is never in memory as a whole."""
    content = findings.model_dump(mode="json", by_alias=True)
    yield from json.JSONEncoder(indent=1, ensure_ascii=False, allow_nan=False).iterencode(content)
    yield "\n"


def read(path: Path) -> Findings:
    """Read a findings.json (or the folder that holds one) with the arrays beside it.

    Raises
    ------
    InputError
        If there is none, it is not as `docs/findings.schema.json` says, or an array beside it is damaged;
        names the first fault.
    """
    path = path / "findings.json" if path.is_dir() else path
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a findings.json or its folder.") from error
    findings = parse(content, str(path))
    for file in sorted((path.parent / "arrays").glob("*.parquet")):
        import pandas as pd

        try:
            findings.arrays[file.stem] = pd.read_parquet(file)
        except (ArrowException, OSError, ValueError) as error:
            raise InputError(f"{file}: damaged, it cannot be read ({error}). {_ANEW}") from error
    return findings


def parse(content: bytes | str, shown_as: str) -> Findings:
    """Return the findings that the text of a findings.json holds, without arrays; `shown_as` is its place for messages.

    Raises
    ------
    InputError
        If it is of another schema, or not as `docs/findings.schema.json` says; names the first fault.
    """
    try:
        findings = Findings.model_validate_json(content)
    except ValidationError as error:
        _refuse_other_schema(_schema_of(content), shown_as)
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the file"
        raise InputError(f"{shown_as}: not findings as rigfit writes them: {place}: {first['msg']}. {_ANEW}") from error
    _refuse_other_schema(findings.schema_version, shown_as)
    return findings


def _schema_of(content: bytes | str) -> object:
    try:
        told = json.loads(content)
    except (ValueError, RecursionError):
        return None
    return told.get("schema") if isinstance(told, dict) else None


def _refuse_other_schema(schema: object, shown_as: str) -> None:
    if isinstance(schema, int) and schema != SCHEMA_VERSION:
        raise InputError(
            f"{shown_as}: findings of schema {schema}; this rigfit ({__version__}) reads schema {SCHEMA_VERSION}. Read them with "
            f"the version that wrote them. {_ANEW}"
        )


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of findings.json."""
    schema = Findings.model_json_schema(by_alias=True, mode="serialization")
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return schema


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=1, ensure_ascii=False))
