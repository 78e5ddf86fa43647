"""Which code made the numbers: a version says too little while the code lies in the same folder as the campaigns."""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from pathlib import Path

import pipeline

FLOORS = ("estimation", "findings", "rigs", "signals")
"""The folders on which the stage `identify` depends in dvc.yaml: what changes elsewhere leaves findings as they are."""


@cache
def code_digest() -> str:
    """Return the SHA-256 over paths and contents of the modules that turn recordings into findings.

    It is the same in every clone of one state, whatever the clone's line ends.
    """
    root = Path(pipeline.__file__).parent
    digest = hashlib.sha256()
    for floor in FLOORS:
        for module in sorted((root / floor).rglob("*.py")):
            content = module.read_bytes().replace(b"\r\n", b"\n")
            digest.update(f"{module.relative_to(root).as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


@cache
def code_revision() -> str:
    """Return the last commit that changed this code, '' where it is not under Git, or changed since that commit."""
    root = Path(pipeline.__file__).parent
    try:
        if _git(root, "status", "--porcelain", "--", *FLOORS):
            return ""
        return _git(root, "log", "-1", "--format=%H", "--", *FLOORS)
    except (OSError, subprocess.SubprocessError):
        return ""


def _git(folder: Path, *words: str) -> str:
    done = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True, timeout=20)
    return done.stdout.strip()
