"""The verdict on a campaign of cultures: what the tests say, what stands against them, what to do next."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.rigs.judgement import Judgement
from pipeline.rigs.rap.cytotoxicity.analysis import Culture, Outcome, ordered
from pipeline.rigs.rap.cytotoxicity.declaration import OUTCOMES
from pipeline.rigs.rap.cytotoxicity.power import cultures_needed


def judge(cultures: Sequence[Culture]) -> Judgement:
    """Return verdict, reasons and advice."""
    said = Judgement()
    for culture in cultures:
        of_run = f"Run {culture.run}: " if len(cultures) > 1 else ""
        for problem in culture.problems:
            if problem.level != "note":
                said.warn(f"Run {culture.run}: {problem.message}")
        if culture.control == "none":
            said.reject(f"{of_run}There is no control, so nothing can be said of the device.")
            said.advise(
                "Keep cells of the same passage in fluid that did not go round, count them with the others, call these rows 'control', and give them a time "
                "(0 will do): rows without a time are left out."
            )
            continue
        for outcome in ordered(culture):
            _judge_outcome(outcome, culture.control == "each", of_run, said)
        missing = [name for name in OUTCOMES if name not in culture.outcomes]
        if missing:
            said.warn(
                f"{of_run}{' and '.join(missing).capitalize()} {'is' if len(missing) == 1 else 'are'} not in the log."
            )
    return said


def _judge_outcome(outcome: Outcome, control_each: bool, of_run: str, said: Judgement) -> None:
    name = outcome.name.capitalize()
    if outcome.verdict == "equivalence":
        said.reasons.append(f"{of_run}{name} is equivalent to the control: {outcome.reason}.")
        return
    if outcome.verdict == "different":
        said.warn(f"{of_run}{name} is different from the control: {outcome.reason}.")
        said.advise(
            "A difference beyond the margin is a finding, not a fault of the log: repeat it with fresh fluid and another filter before blaming the device."
        )
        return
    said.warn(f"{of_run}{name} is inconclusive: {outcome.reason}. That is not the same as similar.")
    if outcome.found is None:
        said.advise("Draw at least three cultures of each group at each time.")
    elif not outcome.undetermined:
        needed = cultures_needed(outcome.found.deviation, outcome.margin, outcome.times.size, control_each=control_each)
        said.advise(
            f"{name}: with the scatter found ({100 * outcome.found.deviation:.2g} points), {needed} cultures of each group and time show equivalence in 9 of 10 "
            "trials if there is no difference."
            if needed is not None
            else f"{name}: with the scatter found ({100 * outcome.found.deviation:.2g} points) more than 24 cultures of each group and time would be needed; count more cells in each."
        )
    else:
        said.advise(
            "Draw samples at all times of the protocol, or say in the recipe which times are due (setting 'times')."
        )
