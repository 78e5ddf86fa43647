"""The verdict on a campaign of drives, its reasons in plain words, what to do next (tire.md, 7).

rejected  no drive gives a number.
warning   drives left out, loads or forces withheld, or any warning of data, bench and filter.
ok        none of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.errors import counted
from pipeline.recording import QualityFinding
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.tire.road.faults import FAR_ABOVE, OTHER_RATIO
from pipeline.rigs.tire.road.handed_over import Chosen
from pipeline.rigs.tire.road.run_numbers import RunNumbers

_TOLD = 5


def judge(
    runs: Sequence[RunNumbers], choice: Chosen, left_out: Mapping[str, str], quality: Sequence[QualityFinding]
) -> Judgement:
    """Weigh what was found."""
    said = Judgement()
    with_forces = [run for run in runs if run.has_forces and run.forces.fits.any()]
    if choice.bench is None:
        said.warn(f"Speed only, no load and no force: {choice.reason}")
        said.advice.append(
            "Identify a tire.bench campaign of this tire with this sensor and name it under 'uses' in the recipe."
        )
    for run in with_forces:
        _told(said, run)
    for name, reason in list(left_out.items())[:_TOLD]:
        said.warn(f"Run {name} is left out: {_ended(reason)}")
    if len(left_out) > _TOLD:
        said.warn(f"{counted(len(left_out) - _TOLD, 'more run')} are left out, see the quality findings.")
    grave = [q for q in quality if q.level != "note" and q.run not in left_out]
    for finding in grave[:_TOLD]:
        said.warn(
            _ended(
                f"Run {finding.run}: {finding.message}"
                if finding.run
                else finding.message[:1].upper() + finding.message[1:]
            )
        )
    if len(grave) > _TOLD:
        said.warn(f"{counted(len(grave) - _TOLD, 'more warning')} stand among the quality findings.")
    _advise(said, with_forces)
    return said


def _told(said: Judgement, run: RunNumbers) -> None:
    """Say of one drive what an engineer asks first."""
    tire = run.carried.tire
    if tire is None:
        return
    forces = run.forces
    outside = float(forces.extrapolated[forces.fits].mean())
    least, most = tire.bench.loads
    low, high = np.percentile(forces.load[forces.fits], [0.5, 99.5])
    range_ = f"{low:.0f} to {high:.0f} N on the road, {least:.0f} to {most:.0f} N on the bench"
    if high > most:
        range_ += f": up to {high / most:.2f} times its highest load, the ring model bears {FAR_ABOVE:g}"
    said.reasons.append(
        f"Run {run.run}: load is extrapolated in {100 * outside:.0f} % of the revolutions ({range_})."
        if outside > 0.0
        else f"Run {run.run}: load is not extrapolated ({range_})."
    )
    if run.bonding is None:
        said.reasons.append(f"Run {run.run}: whether the sensor is still bonded cannot be told without a PVDF film.")
    elif run.bonding.ok and not abs(run.bonding.mean - 1.0) > OTHER_RATIO:
        said.reasons.append(f"Run {run.run}: bonding ok: flex sensor and film keep their ratio.")


def _advise(said: Judgement, runs: Sequence[RunNumbers]) -> None:
    for run in runs:
        tire = run.carried.tire
        if tire is None:
            continue
        load = run.forces.load[run.forces.fits]
        if run.forces.extrapolated[run.forces.fits].mean() > 0.2:
            high = float(np.ceil(np.percentile(load, 99.5) / 500.0) * 500.0)
            said.advice.append(
                f"Calibrate on the bench up to {high:.0f} N: most of the bench's loads lie below those of the road."
            )
            break
    if runs and not any(run.references.get("vertical_load") for run in runs):
        said.advice.append(
            "Log a reference (wheel force transducer, or load from suspension travel) on one drive to check load and force."
        )


def _ended(text: str) -> str:
    return text if text.endswith((".", "?", "!")) else f"{text}."
