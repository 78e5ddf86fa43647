"""`rigfit export`: findings of a campaign in a form that other programs read."""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.cli.findings_of import findings_of
from pipeline.cli.saying import say
from pipeline.errors import InputError, counted
from pipeline.findings.export import as_csv, bearing_tables
from pipeline.recording.storage import whole_or_not


def export(campaign: str, form: str, out: Path | None) -> None:
    """Write the findings of a campaign, or of a findings.json, as `form` into the folder `out`."""
    findings, results = findings_of(campaign)
    if not re.fullmatch(r"[^./\\:\0][^/\\:\0]*", findings.campaign):
        raise InputError(
            f"{results / 'findings.json'}: its campaign is called '{findings.campaign}', which cannot be a file's name."
        )
    folder = out or results / "export"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, not a folder; name another folder with --out.")
    if form == "csv":
        _write(folder / f"{findings.campaign}.csv", as_csv(findings).encode())
        return
    for table in bearing_tables(findings):
        _write(folder / f"{table.name}.toml", table.toml().encode())
        _write(folder / f"{table.name}.xlsx", table.sheet())
        if table.skipped:
            say(
                f"{table.name}: {counted(len(table.skipped), 'row')} left out, where a coefficient is not told "
                f"({', '.join(f'{row:.4g}' for row in table.skipped)} rad/s).",
                err=True,
            )


def _write(path: Path, content: bytes) -> None:
    with whole_or_not(path) as partial:
        partial.write_bytes(content)
    say(str(path))
