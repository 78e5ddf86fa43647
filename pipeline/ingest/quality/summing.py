"""Findings that differ in the channel and its numbers only, summed up where there are many of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from pipeline.errors import listing
from pipeline.recording import QualityFinding

# As many alike are told one by one.
MOST_ALIKE = 8
_NAMED = 5
_NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[-+]?\d+)?|\bnan\b|\binf\b")


def summed(findings: Sequence[QualityFinding]) -> list[QualityFinding]:
    """Return findings with each kind of which there are more than `MOST_ALIKE` as one, where the first of them stood.

    Examples
    --------
    >>> dead = [QualityFinding("note", f"c{k} is {k} N in every sample.", channel=f"c{k}") for k in range(3000)]
    >>> [finding.message for finding in summed(dead)]
    ['of 3000 channels alike (c0, c1, c2, c3, c4 and 2995 more) the first: c0 is 0 N in every sample.']
    """
    kinds: dict[tuple[str, str], list[QualityFinding]] = {}
    for finding in findings:
        kinds.setdefault(_kind(finding), []).append(finding)
    result = []
    for finding in findings:
        alike = kinds[_kind(finding)]
        if len(alike) <= MOST_ALIKE:
            result.append(finding)
        elif finding is alike[0]:
            result.append(_sum(alike))
    return result


def _kind(finding: QualityFinding) -> tuple[str, str]:
    message = finding.message if finding.channel is None else finding.message.replace(finding.channel, "\0")
    return finding.level, _NUMBER.sub("#", message)


def _sum(alike: Sequence[QualityFinding]) -> QualityFinding:
    names = list(dict.fromkeys(finding.channel for finding in alike if finding.channel is not None))
    if len(names) > 1:
        told = f"of {len(names)} channels alike ({listing(names, _NAMED)}) the first: {alike[0].message}"
    else:
        told = f"{alike[0].message} The same holds {len(alike) - 1} times more."
    return replace(alike[0], message=told, channel=names[0] if len(names) == 1 else None, span=None)
