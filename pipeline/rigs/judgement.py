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

    def warn(self, reason: str) -> None:
        """Warn, for that reason."""
        self.verdict = "warning" if self.verdict == "ok" else self.verdict
        self.reasons.append(reason)

    def reject(self, reason: str) -> None:
        """Reject, for that reason, which comes first."""
        self.verdict = "rejected"
        self.reasons.insert(0, reason)

    def advise(self, text: str) -> None:
        """Give advice once."""
        if text not in self.advice:
            self.advice.append(text)
