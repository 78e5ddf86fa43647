"""What RAP 2019 says of pressures and circuit beside what these logs give; the paper's own arithmetic stands in `paper`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.findings import Parameter, Published
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.pressures.paper import ML, ML_MIN, PRINTED, TUBES, paper_alone, tube_inertance
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers

# A log's rate is the paper's within that share.
_SAME = 0.05


def published(runs: Sequence[RunNumbers], parameters: Sequence[Parameter]) -> list[Published]:
    """Return what the logs say of the paper's numbers and claims, then the checks of the paper alone."""
    return [*_sampling(runs), *_agreement(runs), *_set_points(runs), *_inertance(parameters), *paper_alone()]


def _sampling(runs: Sequence[RunNumbers]) -> list[Published]:
    rates = {
        reader: next(iter(run.record.sources[reader].taps.values())).rate
        for run in runs[:1]
        for reader in ("rap", "bench")
        if reader in run.record.sources
    }
    words = {"rap": "device", "bench": "bench"}
    return [
        Published(
            name=f"sampling of the {words[reader]}'s pressures", published=PRINTED.sampling, found=rate, unit="Hz", where="test of the pressures",
            agrees=abs(rate / PRINTED.sampling - 1.0) < _SAME,
            remark="by its own stamps; harmonics of the pump above half of it fold back",
        )
        for reader, rate in rates.items() if math.isfinite(rate)
    ]  # fmt: skip


def _agreement(runs: Sequence[RunNumbers]) -> list[Published]:
    rows = []
    for run in runs:
        for tap, numbers in run.taps.items():
            half = numbers.half_width
            if half is None:
                continue
            bias = numbers.agreement.samples.bias.value
            rows.append(
                Published(
                    name=f"{TAP_NAMES[tap]} pressure agrees with the bench" + (f", run {run.name}" if len(runs) > 1 else ""),
                    published="good agreement (return shown, the others said to be alike)",
                    found=f"bias {bias / MMHG:+.2f} mmHg, limits ±{half / MMHG:.2f} mmHg about it" if bias is not None else f"limits ±{half / MMHG:.2f} mmHg",
                    where="test of the pressures, figure lost", agrees=None,
                    remark="the paper gives no statistic and no limit to hold this against",
                )
            )  # fmt: skip
    return rows


def _set_points(runs: Sequence[RunNumbers]) -> list[Published]:
    flows = sorted(
        {round(level.flow_set / ML_MIN, 2) for run in runs for level in run.levels if level.flow_set and level.steady}
    )
    if not flows:
        return []
    paper = [round(flow / ML_MIN, 2) for flow in PRINTED.flows]
    return [
        Published(
            name="set-points of the blood flow", published=" / ".join(f"{flow:g}" for flow in paper) + " mL/min",
            found=" / ".join(f"{flow:g}" for flow in flows) + " mL/min", where="tests of pressures and flow", agrees=flows == paper,
            remark="other set-points are no fault; the notes on rows 4 and 6 stand beside the set-points used",
        )
    ]  # fmt: skip


def _inertance(parameters: Sequence[Parameter]) -> list[Published]:
    """Hold the return line's inertance against the tubing that the priming volumes leave."""
    found = next((p for p in parameters if p.name == "l_return" and p.value is not None), None)
    if found is None or found.value is None:
        return []
    tubing = PRINTED.priming - PRINTED.filter_priming
    bore = TUBES[0]
    length = found.value / tube_inertance(1.0, bore)
    volume = length * 0.25 * math.pi * bore**2
    return [
        Published(
            name="tubing behind the filter", published=f"{tubing / ML:.0f} mL in all lines", found=f"{volume / ML:.1f} mL",
            where="priming volumes", agrees=None,
            remark=f"the inertance of the return line is that of {length:.2f} m of {1e3 * bore:g} mm tube; a catheter's lumen adds inertance without much volume. "
            + ("It fits into the paper's tubing" if volume < tubing else "It is more than the paper's tubing: another set, or narrower parts"),
        )
    ]  # fmt: skip
