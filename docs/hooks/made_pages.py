"""What MkDocs calls: one page for each experiment and the fields of findings.json, both made from the code."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import experiments as pages
import schema_fields
from mkdocs.structure.files import File, Files

FIELDS = "<!-- fields -->"


def on_config(config: Any) -> Any:
    """List the experiments' pages below 'Experiments', grouped by rig, and take the search's help for pages on disk from here."""
    config.extra["polyfills"] = [url for url in config.extra["polyfills"] if "://" not in url]
    entry = next(item for item in config.nav if "Experiments" in item)
    entry["Experiments"] = [
        "experiments/index.md",
        *({rig: [{e.id: f"experiments/{e.id}.md"} for e in found]} for rig, found in pages.by_rig().items()),
    ]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made here."""
    files.append(File.generated(config, "experiments/index.md", content=pages.overview()))
    for found in pages.by_rig().values():
        for experiment in found:
            files.append(File.generated(config, f"experiments/{experiment.id}.md", content=pages.page(experiment)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the fields of findings.json where the page asks for them."""
    del page
    return markdown.replace(FIELDS, schema_fields.tables()) if FIELDS in markdown else markdown
