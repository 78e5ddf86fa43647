"""The verdict on rich records, with its reasons and what to measure next.

rejected  the model misses more than 5 % of the force of a record, and noise does not explain it, or has an impossible sign.
warning   something is not determined, at a bound, left out or doubted, or records contradict the assumption that only
          k_MR and s_MR depend on the current (which leaves each record's own numbers untouched, so it is told only).
ok        none of these. The online filter never changes the verdict: nothing is reported from it.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import listing
from pipeline.rigs.in_words import chance
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.mre.rich.agreement import say_gain
from pipeline.rigs.mre.rich.comparison import Comparison, symbol
from pipeline.rigs.mre.rich.excitation import advice_for
from pipeline.rigs.mre.rich.fits import RichFit
from pipeline.rigs.mre.rich.noise import expected_residual
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.mre.shear.verdict import PREDICTION_REJECTED, PREDICTION_WARNED

_TOLD = 4
_NOISE_EXPLAINS = 3.0  # times what the sensors' noise leaves


def judge(runs: SortedRuns, fits: Sequence[RichFit], doubts: Sequence[str], agreement: Comparison | None) -> Judgement:
    """Weigh what was found."""
    said = Judgement()
    for fit in fits:
        _record(said, fit)
    left = list(runs.left_out.items())
    for run, reason in left[:_TOLD]:
        said.warn(f"Run {run} is left out: {reason}.")
    if len(left) > _TOLD:
        said.warn(f"{len(left) - _TOLD} more runs are left out: {listing((run for run, _ in left[_TOLD:]), 8)}.")
    for doubt in doubts:
        said.warn(doubt)
    gain = say_gain(agreement)
    if gain:
        said.warn(gain)
    elif agreement is not None and not agreement.agrees:
        said.reasons.append(
            f"{listing(map(symbol, agreement.apart), 6)} differ between the currents beyond chance (differences "
            f"as large by chance: {chance(agreement.p_value)}): the field changes more than k_MR and s_MR. Each record's own numbers hold."
        )
    said.advice = list(dict.fromkeys(said.advice))
    return said


def _record(said: Judgement, fit: RichFit) -> None:
    batch = fit.batch
    share = batch.nrmse_second_half
    sentence = (
        f"Run {fit.run}: fitted to the first half of the record the model predicts the second half to within {100 * share:.3g} % "
        f"of the force (rms); the first half itself is met to {100 * batch.nrmse_first_half:.3g} %."
    )
    unexplained = batch.rms_residual > _NOISE_EXPLAINS * expected_residual(fit)
    if batch.nrmse > PREDICTION_WARNED and (unexplained or not share < PREDICTION_REJECTED):
        said.reject(f"{sentence} The model does not describe this device.")
        return
    if share > PREDICTION_WARNED or share > 2 * batch.nrmse_first_half:
        said.warn(sentence)
    else:
        said.reasons.append(sentence)
    if batch.inadmissible:
        said.reject(
            f"Run {fit.run}: impossible sign of {', '.join(batch.inadmissible)}; the model is no description of this record."
        )
        return
    if fit.linear:
        said.warn(
            f"Run {fit.run}: a spring and a damper alone meet the record; the model's branches are not determined."
        )
    elif batch.undetermined:
        said.warn(f"Run {fit.run}: not determined: {', '.join(batch.undetermined)}.")
        said.advice += advice_for(batch, fit.reach)
    for name in batch.at_bound:
        said.warn(f"Run {fit.run}: {name} lies at the edge of what is admissible.")
