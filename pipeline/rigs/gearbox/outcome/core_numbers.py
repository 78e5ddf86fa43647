"""The numbers for which a run of the load exchange is made, and which of them a report lacks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Parameter

# (name, stage) of a run; a report without one of them, or without its interval, is not whole.
OF_RUN = (
    ("torque_in_nominal", "fos"),
    ("torque_out_nominal", "fos"),
    ("torque_in_nominal", "sos"),
    ("torque_out_nominal", "sos"),
    ("torque_in_peak", "brake"),
    ("torque_out_peak", "brake"),
    ("efficiency_fos", None),
    ("torque_ratio_sos", None),
    ("power_dissipated_sos", None),
    ("speed_in_sos", None),
    ("lock_torque", None),
    ("slip_torque", None),
    ("inertia_load", None),
)
_Without = tuple[list[str], list[str]]
# Reasons told one by one.
_FEW = 8
OF_CAMPAIGN = ("inertia_load", "drag_coulomb", "torque_transfer_slope")


def missing(parameters: Sequence[Parameter], many: bool = False) -> list[str]:
    """Return a sentence for each reason for which core numbers lack a value or an interval.

    Parameters
    ----------
    parameters
        Of the findings.
    many
        Reasons that differ in their numbers only are one, however few they are.

    Notes
    -----
    Of the inertia, that of the campaign counts; a run of its own may be too short to tell it.
    """
    without: dict[str, tuple[list[str], list[str]]] = {}
    for one in parameters:
        run = one.at.get("run")
        core = (
            (one.name, one.at.get("stage")) in OF_RUN and "phase" not in one.at
            if run
            else one.name in OF_CAMPAIGN and not one.at
        )
        if not core or (one.value is not None and one.ci95 is not None):
            continue
        stage = one.at.get("stage")
        name = f"{one.name} ({stage})" if stage else one.name
        reason = one.description.split(";")[0].rstrip(".") if one.value is None else f"no interval: {_why(one)}"
        names, runs = without.setdefault(reason, ([], []))
        if name not in names:
            names.append(name)
        if run and str(run) not in runs:
            runs.append(str(run))
    order = {str(one.at["run"]): place for place, one in reversed(list(enumerate(parameters))) if "run" in one.at}
    return [
        f"Missing {'in ' + _some(runs) if runs else 'in the campaign'}: {listing(names, 16)} ({reason})."
        for reason, (names, runs) in (_alike(without, order) if many or len(without) > _FEW else without).items()
    ]


def _alike(without: Mapping[str, _Without], order: Mapping[str, int]) -> Mapping[str, _Without]:
    """Put reasons together that differ in their numbers only; the first one's words stand for all, and say so."""
    kinds: dict[str, list[str]] = {}
    for reason in without:
        kinds.setdefault(kind_of(reason), []).append(reason)
    found: dict[str, _Without] = {}
    for reasons in kinds.values():
        told = f"{reasons[0]}; so in the first, numbers differ" if len(reasons) > 1 else reasons[0]
        names = [name for reason in reasons for name in without[reason][0]]
        runs = sorted((run for reason in reasons for run in without[reason][1]), key=order.__getitem__)
        found[told] = (list(dict.fromkeys(names)), list(dict.fromkeys(runs)))
    return found


def kind_of(sentence: str) -> str:
    """Return a sentence without its numbers: those that say the same of several runs are one kind.

    Examples
    --------
    >>> kind_of("stage 'fos' lasts 0.53 s: too short")
    "stage 'fos' lasts # s: too short"
    """
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", sentence)


def _why(one: Parameter) -> str:
    """Return what the description says about the missing interval: what stands behind the quantity's own words."""
    told = [part.strip() for part in one.description.split(";")[1:]]
    return next((part for part in told if part), "it is not known").rstrip(".")


def _some(runs: Sequence[str]) -> str:
    return f"run {runs[0]}" if len(runs) == 1 else f"{counted(len(runs), 'run')} ({listing(runs, 8)})"
