"""What commands print. Texts come from logs and their names too: no sign of theirs may move the cursor or colour the terminal."""

from __future__ import annotations

import click

from pipeline.report.words import harmless


def say(text: object = "", *, err: bool = False) -> None:
    """Print `text`, without control signs and those that turn the reading direction; to stderr with `err`."""
    click.echo(harmless(str(text)), err=err)
