"""Findings on one run as they are gathered."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.recording import QualityFinding
from pipeline.recording.recording import Level


class RunFindings:
    """Findings of one run."""

    def __init__(self, run: str) -> None:
        self._run = run
        self._all: list[QualityFinding] = []

    def add(self, level: Level, message: str, channel: str, span: tuple[float, float] | None = None) -> None:
        """Add what was found in `channel`, from when to when (s)."""
        self._all.append(QualityFinding(level, message, self._run, channel, span))

    def __iter__(self) -> Iterator[QualityFinding]:
        return iter(self._all)
