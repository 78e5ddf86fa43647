"""What is noticed while messages are read, and how it is told."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from pipeline.errors import counted
from pipeline.ingest.mcap_log.batches import Messages
from pipeline.recording import Level, QualityFinding


@dataclass
class Tally:
    """What was noticed in one pass over a topic; times in s, from the start of the log.

    Attributes
    ----------
    messages, malformed, first_malformed
        Messages read, those left out, and when the first of these was logged.
    backward
        Messages logged before the one that stands before them.
    misfits
        By channel, the values that are no numbers.
    unknown
        By field that no surveyed message had, when it turned up.
    ragged
        Lists shorter than others of their message.
    too_wide
        When messages began to have thousands of fields.
    """

    messages: int = 0
    malformed: int = 0
    first_malformed: float | None = None
    backward: int = 0
    misfits: dict[str, int] = field(default_factory=dict)
    unknown: dict[str, float] = field(default_factory=dict)
    ragged: int = 0
    too_wide: float | None = None

    def told(self, has_time: bool, has_blocks: bool, gaps: int) -> Iterator[tuple[Level, str]]:
        """Yield levels and sentences; `gaps` is the number of blocks of samples that a gap follows."""
        if self.malformed:
            told = counted(self.messages + self.malformed, "message")
            first = f"{self.first_malformed:.6g} s" if self.first_malformed is not None else "the start"
            yield "warning", f"{self.malformed} of {told} malformed and left out, the first at {first}."
        for name, count in self.misfits.items():
            told = counted(count, "value")
            yield "warning", f"'{name}' is a number in most messages but not in {told}, which became NaN."
        for name, time in self.unknown.items():
            told = f"the field '{name}' turned up at about {time:.6g} s only"
            yield "warning", f"{told}, was in none of the messages looked at before, and was left out."
        if self.too_wide is not None:
            yield "warning", f"messages from {self.too_wide:.6g} s on have thousands of fields and were left out."
        if self.ragged:
            told = counted(self.ragged, "list")
            yield "warning", f"{told} shorter than others of the same message, filled up with NaN."
        if self.backward:
            told = counted(self.backward, "message")
            yield "note", f"{told} logged after a later one, in the order of the file."
        if gaps:
            told = counted(gaps, "block")
            yield "note", f"{told} of samples followed by a gap, timed with the step of the block before."
        if not has_time and has_blocks and self.messages == 1:
            yield "note", "one message alone holds a block of samples, and nothing in it tells their rate."
        elif not has_time:
            yield "note", "all messages bear the same time stamp, so it cannot serve as the time."


def loss_notes(messages: Messages, zero: int, told_before: Collection[int] = ()) -> list[QualityFinding]:
    """Return what could not be used of chunks; `zero` (ns) is second zero, `told_before` are offsets."""
    notes = []
    for loss in messages.losses.values():
        if loss.offset in told_before:
            continue
        span = ((loss.start_time - zero) / 1e9, (loss.end_time - zero) / 1e9) if loss.start_time >= zero else None
        when = f" ({span[0]:.6g} s to {span[1]:.6g} s)" if span else ""
        how = "left out" if loss.left_out else "read in part"
        text = f"a chunk at byte {loss.offset}{when} was {how}: {loss.reason}."
        notes.append(QualityFinding("warning", text, span=span))
    return notes
