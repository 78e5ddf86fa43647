"""Coverage of `tpjb.dynamic`: coefficients at eight tones and at shaft speed, with the stator weighed by a baseline test.

Synchronous damping is told with errors up to a fifth too large where the coefficients do not go with frequency: the error
allows for slopes that chi-square misses (`laws.choice_error`). No bound is given.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.coverage import dirt
from benchmarks.coverage.study import Campaign, Case, Study
from benchmarks.coverage.tpjb_logs import as_logged
from pipeline.findings import Parameter
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb import truth as rig
from pipeline.rigs.tpjb.baseline.declaration import BASELINE, BaselineSettings
from pipeline.rigs.tpjb.dynamic.declaration import DYNAMIC
from pipeline.rigs.tpjb.probes import GAPS

_DIRT = (
    "runout of the shaft with a wandering speed, planes that pitch by 3 %, white noise of all channels and "
    "beside it noise with a memory of 20 ms of the probes (50 nm) and the load cells (3 N), 0.1 % of the rows lost, 10 us of "
    "jitter, gains of probes off by 1 % and of load cells by 0.5 %"
)
_BEARINGS = {"standard": ("4pad-L1", "4pad-L2"), "gains known": ("4pad-L1", "4pad-L2"), "5pad": ("5pad-L3",)}


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of a campaign, its baseline campaign, and what is true of them."""
    gains = case == "standard"
    rng = np.random.default_rng((seed, 5))
    recordings = DYNAMIC.synthesize({"bearings": list(_BEARINGS[case])}, seed)
    recordings = dirt.coloured(recordings, rng, dict.fromkeys(GAPS, 5e-8) | {"force_u": 3.0, "force_v": 3.0}, 0.02)
    weighed = dirt.coloured(BASELINE.synthesize({}, seed), rng, {"force_u": 3.0, "force_v": 3.0}, 0.02)
    baseline = BASELINE.identify(as_logged(weighed, seed, gains=gains), BaselineSettings(), Context("baseline", {}))
    return Campaign(as_logged(recordings, seed, gains=gains), _truth(case), uses={"baseline": baseline}, label=_label)


def _truth(case: str) -> Callable[[Parameter], float | None]:
    bearings = {rig.bearing(name).static_load: rig.bearing(name) for name in _BEARINGS[case]}

    def truth(parameter: Parameter) -> float | None:
        made = bearings[float(parameter.at["static_load"])]
        synchronous = "synchronous" in parameter.at
        frequency = rig.SHAFT_SPEED / (2 * np.pi) if synchronous else float(parameter.at["frequency"])
        H = made.impedance(frequency)["xy".index(parameter.name[1]), "xy".index(parameter.name[2])]
        return float(H.real if parameter.name[0] == "k" else H.imag / (2 * np.pi * frequency))

    return truth


def _label(parameter: Parameter) -> str:
    return f"{parameter.name} synchronous" if "synchronous" in parameter.at else parameter.name


STUDY = Study(
    DYNAMIC,
    {
        "standard": Case(f"four-pad bearing at two static loads: {_DIRT}"),
        "gains known": Case("the same with all gains right: type A alone"),
        "5pad": Case("five-pad bearing, whose coefficients go with frequency; the same dirt, gains right"),
    },
    campaign,
)
