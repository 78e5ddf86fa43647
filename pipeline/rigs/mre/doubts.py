"""Doubts about a test: the verdict that only gets worse, with the quality findings and the advice that go with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.findings import Quality
from pipeline.recording import QualityFinding
from pipeline.rigs.judgement import Judgement


@dataclass
class Doubts:
    """The judgement with the quality findings that go with it."""

    said: Judgement = field(default_factory=Judgement)
    quality: list[Quality] = field(default_factory=list)

    def doubt(self, run: str | None, message: str, advice: str = "", channel: str | None = None) -> None:
        """Note a doubt: a finding, a reason, and how to mend it."""
        self.quality.append(Quality(level="warning", run=run, channel=channel, message=message))
        self.said.warn(f"Run {run}: {message}" if run else message)
        self._advise(advice)

    def reject(self, run: str | None, message: str, advice: str = "", channel: str | None = None) -> None:
        """Say that numbers are not to be used."""
        self.quality.append(Quality(level="error", run=run, channel=channel, message=message))
        self.said.reject(f"Run {run}: {message}" if run else message)
        self._advise(advice)

    def note(self, run: str | None, message: str, channel: str | None = None) -> None:
        """Note what is worth knowing and no doubt."""
        self.quality.append(Quality(level="note", run=run, channel=channel, message=message))

    def _advise(self, advice: str) -> None:
        if advice and advice not in self.said.advice:
            self.said.advice.append(advice)

    def hand_on(self, findings: Sequence[QualityFinding]) -> None:
        """Take over what was odd about a log: anything above a note leaves a doubt."""
        for finding in findings:
            if finding.level == "note":
                self.note(finding.run, finding.message, finding.channel)
            else:
                self.doubt(finding.run, finding.message, channel=finding.channel)
