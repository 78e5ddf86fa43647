"""A verdict while it is made: it only gets worse, and every step has its reason."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.findings import Verdict


@dataclass
class Judgement:
    """Verdict, reasons, advice."""

    verdict: Verdict = "ok"
    reasons: list[str] = field(default_factory=list)
    advice: list[str] = field(default_factory=list)

    def reject(self, reason: str) -> None:
        """Reject, for that reason."""
        self.verdict = "rejected"
        self.reasons.append(reason)

    def warn(self, reason: str) -> None:
        """Warn, for that reason."""
        if self.verdict == "ok":
            self.verdict = "warning"
        self.reasons.append(reason)
