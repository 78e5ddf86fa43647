"""Coverage of `mre.shear_rich`: the batch fit of one record at 0 A and one at 6 A.

The online filter is switched off, since it tells no parameters. A gain error of a record cannot be seen in it and has no part
here: it scales stiffnesses and forces as they are, and is for the calibration to tell.

With a field the lag of the force acts as the field's own damping does, but for how it goes with the frequency: 30 s leave it open by
more than its size in most campaigns. It is not told then, and the verdict is a warning for that reason.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from benchmarks.coverage.dirt import coloured
from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.rigs.mre.rich.declaration import SHEAR_RICH, RichSettings
from pipeline.rigs.mre.synthetic import rich_recording, rich_signals, shear_truth

_CURRENTS = (0.0, 6.0)
_TRUTH = shear_truth({"duration": 30.0})
_COLOUR = {"displacement": 1e-6, "force": 0.7}
_signals = cache(lambda current: rich_signals(_TRUTH, current))


def campaign(_case: str, seed: int) -> Campaign:
    """Return the records of one campaign."""
    logs = [rich_recording(_TRUTH, current, 2 * seed + i, _signals(current)) for i, current in enumerate(_CURRENTS)]
    dirty = coloured(logs, np.random.default_rng([seed, 1]), _COLOUR, memory=0.01)
    return Campaign(dirty, truth, settings=RichSettings(online=False), label=label)


def label(parameter: Parameter) -> str:
    """Return the name with the current."""
    return f"{parameter.name} {float(parameter.at['coil_current']):.0f} A"


def truth(parameter: Parameter) -> float:
    """Return what a parameter should be; k2 holds k_MR."""
    current = float(parameter.at["coil_current"])
    k2 = _TRUTH.k2 + _TRUTH.k_mr_at(current)
    derived = {
        "tau": _TRUTH.s1 / _TRUTH.k1,
        "k2": k2,
        "s_mr": _TRUTH.s_mr_at(current),
        "k1_plus_k2": _TRUTH.k1 + k2,
        "k2_plus_alpha_rho": k2 + _TRUTH.alpha_bw * _TRUTH.rho,
    }
    return derived[parameter.name] if parameter.name in derived else float(getattr(_TRUTH, parameter.name))


STUDY = Study(
    SHEAR_RICH,
    {
        "standard": Case(
            "30 s of a chirp from 3 to 17 Hz with amplitudes from 0.1 to 0.6 mm at 0 A and at 6 A; white noise of 1 N and 1.5 um, "
            "first-order noise of 0.7 N and 1 um with 10 ms memory, mains hum of 0.3 N, clock jitter of 5 us, samples lost, force 60 us late."
        )
    },
    campaign,
)
