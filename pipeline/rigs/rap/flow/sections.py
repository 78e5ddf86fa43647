"""What the report of `rap.flow` shows."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings
from pipeline.findings.figures import Section


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    return []
