"""What every experiment's advice shares: a forecast from one run says that it is a best case."""

from __future__ import annotations

import pytest

from pipeline.findings import Findings, Run
from pipeline.rigs.advice import Advice, Proposal, advice_with_caveat

_PROPOSAL = Proposal({"frequency": 5.0}, 1, "It tells the loss.", ())


def findings(*used: bool) -> Findings:
    runs = [Run(run=f"run{i}", used=one, reason="" if one else "left out") for i, one in enumerate(used)]
    return Findings(campaign="test", experiment="mre.shear", verdict="warning", runs=runs)


@pytest.mark.parametrize(("used", "warned"), [((True,), True), ((True, False), True), ((True, True), False)])
def test_a_forecast_from_one_used_run_is_called_a_best_case(used: tuple[bool, ...], warned: bool) -> None:
    advice = advice_with_caveat(lambda _: Advice([_PROPOSAL], ["As fitted."]), findings(*used))
    assert advice.remarks[0] == "As fitted."
    assert any("best case" in remark for remark in advice.remarks) == warned


def test_where_nothing_is_proposed_nothing_is_added() -> None:
    assert advice_with_caveat(lambda _: Advice((), ["Rejected."]), findings(True)).remarks == ["Rejected."]
