"""What the paper says of the cells beside what these logs say, and what follows from its numbers alone (rap.md, 4)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Published
from pipeline.rigs.rap.cytotoxicity.analysis import Culture, ordered

_VOLUME, _DURATION = 500e-6, 6 * 3600.0
_FLOWS = (100e-6 / 60.0, 60e-6 / 60.0)
_BATTERY, _POWER = 75.5 * 3600.0, 13.9


def published(cultures: Sequence[Culture]) -> list[Published]:
    """Return the rows of the logs and those of the paper alone."""
    rows = []
    for culture in cultures:
        name = f", run {culture.run}" if len(cultures) > 1 else ""
        for outcome in ordered(culture):
            rows.append(
                Published(
                    name=f"{outcome.name} beside the control{name}",
                    published="similar to the control",
                    found=f"{outcome.verdict}: {outcome.reason}",
                    where="cytotoxicity test",
                    agrees={"equivalence": True, "different": False}.get(outcome.verdict),
                    remark="the paper's percentages, controls and numbers of cultures are lost; the margin is ours",
                )
            )
    return [*rows, *paper_alone()]


def paper_alone() -> list[Published]:
    """Return what the paper's own numbers say of its test."""
    passes, fewer = (flow * _DURATION / _VOLUME for flow in _FLOWS)
    hours, needed = _BATTERY / _POWER / 3600.0, _DURATION / 3600.0
    return [
        Published(
            name="passes of the medium through the device in 6 h",
            published=None,
            found=passes,
            where="cytotoxicity test",
            basis="paper",
            remark=f"500 mL at 100 mL/min; {fewer:.1f} at 60 mL/min. The flow of the test is not given",
        ),
        Published(
            name="duration of the cell test against the battery",
            published=_DURATION,
            found=hours * 3600.0,
            unit="s",
            where="cytotoxicity test; battery",
            agrees=hours >= needed,
            basis="paper",
            remark=f"{needed:g} h of test, 75.5 Wh at 13.9 W last {hours:.2f} h: mains or a change of battery must have been used",
        ),
        Published(
            name="haemolysis",
            published="low rate",
            found="no test and no data in the text",
            where="conclusions",
            agrees=None,
            basis="paper",
            remark="not reported here: nothing was measured",
        ),
    ]
