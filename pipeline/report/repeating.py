"""What to type to get the same findings again, and how to see that one starts from the same bytes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath

from pipeline.findings import Findings
from pipeline.report.words import clean

_MOST_LOGS = 40  # of the check; the hashes of more stand in findings.json


def steps(findings: Findings) -> str:
    """Return the commands that lead from recipe and logs to these findings, '' where no recipe was used.

    They are for a folder that holds the recipe, and the logs unless a synthetic rig made them.
    """
    recipe, logs = str(findings.provenance.get("recipe") or ""), _logs(findings)
    if not recipe or PurePosixPath(recipe).stem != findings.campaign:
        return ""
    name = clean(findings.campaign)
    synthetic = bool(logs) and all(PurePosixPath(path).parent.name == "synthetic" for path in logs)
    lines = [f"rigfit synthesize {name}"] if synthetic else []
    lines += [check(findings), *(f"rigfit {stage} {name}" for stage in ("ingest", "identify", "report"))]
    return "\n".join(line for line in lines if line)


def check(findings: Findings) -> str:
    """Return a command that says whether the logs are those that were read, '' where nothing is known of them."""
    files = list(_logs(findings).items())[:_MOST_LOGS]
    told = "".join(f"{digest}  {clean(path)}\n" for path, digest in files)
    return f"sha256sum --check <<'END'\n{told}END" if told else ""


def _logs(findings: Findings) -> dict[str, str]:
    logs = findings.provenance.get("logs")
    return {str(path): str(digest) for path, digest in logs.items()} if isinstance(logs, Mapping) else {}
