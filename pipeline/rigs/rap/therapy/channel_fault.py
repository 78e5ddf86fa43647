"""A channel that is not what its name says. What makes it one stands with those who find it."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.recording import QualityFinding


@dataclass(frozen=True)
class ChannelFault:
    """A channel that is not what its name says, and why; it is left out where `unusable`."""

    channel: str
    message: str
    unusable: bool = True

    def finding(self, run: str) -> QualityFinding:
        """Return the fault as a finding on the data."""
        return QualityFinding("error" if self.unusable else "warning", self.message, run, self.channel)
