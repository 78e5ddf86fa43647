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
    """Return a command that says whether logs and used findings are those that were read, '' where none are known."""
    files = [*_files(findings, "uses").items(), *_logs(findings).items()][:_MOST_LOGS]
    told = "".join(f"{digest}  {clean(path)}\n" for path, digest in files)
    return f"sha256sum --check <<'END'\n{told}END" if told else ""


def versions(findings: Findings, revision: str = "") -> str:
    """Return the commands that get the code and the libraries and show which rigfit is there, '' where they are unknown.

    Parameters
    ----------
    revision
        Of the code, as Git calls it; '' where it is unknown.
    """
    libraries = findings.provenance.get("libraries")
    code = findings.provenance.get("code_sha256")
    if not isinstance(libraries, Mapping) or not code:
        return ""
    pinned = " ".join(f"{clean(str(name))}=={clean(str(number))}" for name, number in libraries.items())
    told = f"rigfit {findings.provenance.get('rigfit')}, code {code}"
    fetched = f"git checkout {revision}  # in a clone of rigfit\n" if revision else ""
    return f"{fetched}pip install {pinned}\nrigfit --version  # says: {clean(told)}"


def _logs(findings: Findings) -> dict[str, str]:
    return _files(findings, "logs")


def _files(findings: Findings, kind: str) -> dict[str, str]:
    """Return the hashes of files by their paths."""
    files = findings.provenance.get(kind)
    return {str(path): str(digest) for path, digest in files.items()} if isinstance(files, Mapping) else {}
