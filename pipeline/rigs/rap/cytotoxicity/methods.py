"""The methods paragraphs of `rap.cytotoxicity`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    margins = ", ".join(
        f"{100 * float(findings.settings.get(f'margin_{name}', usual)):g} points for {name}"
        for name, usual in (("viability", 0.10), ("necrosis", 0.05), ("apoptosis", 0.05))
    )
    outcomes = findings.arrays.get("outcomes")
    control = str(outcomes["control"].iloc[0]) if outcomes is not None and len(outcomes) else "none"
    words = {
        "once": "One control stands for all times.",
        "each": "Each time has a control of its own.",
        "some": "Times without a control of their own are held against the mean of all control cultures.",
        "none": "There was no control, so no difference was formed.",
    }[control]
    return [
        f"Shares of cells were compared with those of the control at each time by two one-sided tests at 5 % (Schuirmann 1987), with margins of {margins}; "
        f"ISO 10993-5 calls a loss of viability of more than 30 % cytotoxic. {words} The variance was pooled over all groups and times (analysis of variance within "
        "groups). A row that stands for several cultures enters with their number and standard deviation; repeats of one culture enter with their mean.",
        "Equivalence is claimed only if the 90 % interval lies within the margins at every time of the protocol; since all tests must pass, several times need no "
        "correction (intersection-union). Different is said where an interval lies beyond the margin as a whole, at 5 % for all times together (Bonferroni). Anything "
        "else is inconclusive, which is not the same as similar. Parameters carry 95 % intervals like all others of this report; the 90 % interval of the "
        "test is told beside them.",
        "The slope of the difference over time is a weighted line; its p value is that of no change. Power was found by simulating the same test with the pooled "
        "standard deviation found and no true difference. Viability, necrosis and apoptosis sum to all cells where the classes exclude each other: at most two of the "
        "three tests are then independent.",
    ]
