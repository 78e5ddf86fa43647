"""`rap.pressures`: runs of steps with all the dirt of device and bench; and what is itself a statistic of that dirt.

In "standard" nothing of the rig is the same twice: constants of circuit and sensors, clocks, gains. Bias, limits of
agreement and coherence have no truth there; in "statistics" only the dirt is drawn anew, and their mean over the
campaigns is taken for true.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.coverage.dirt import coloured
from benchmarks.coverage.rap_logs import BENCH_U, METER_U, UNEVEN, label, lossy, meters_off, pressure_noise, varied
from benchmarks.coverage.study import OVER_SEEDS, Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.rigs.rap.conditions import TAPS
from pipeline.rigs.rap.pressures.declaration import PRESSURES
from pipeline.rigs.rap.synthetic import rig
from pipeline.rigs.rap.synthetic.truth import PressuresTruth, truth_of

CASES = {
    "standard": Case(
        "another circuit, other sensors and clocks in each campaign; white and coloured noise, converter steps, jitter of 2 ms "
        f"on both clocks, lost samples; bench off by {100 * BENCH_U:g} %, meter by {100 * METER_U:g} % (1 sigma, stated)"
    ),
    "statistics": Case("one rig with gains as stated: the same noise, jitter and lost samples; what measures these"),
}
STATISTICS = ("bias", "limit_lower", "limit_upper", "coherence")


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of R1 and what is true of them."""
    rng = np.random.default_rng((seed, 91))
    overrides: dict[str, Any] = dict(UNEVEN)
    if case == "standard":
        overrides |= varied(rng, PressuresTruth())
        overrides |= meters_off(rng, "flowmeter_gain_u", "bench_gain_u")
    else:
        overrides["told"] = {"flowmeter_gain_u": 0.0, "bench_gain_u": 0.0}
    recordings = coloured(rig.synthesize_pressures(overrides, seed), rng, pressure_noise(), memory=2.0)
    recordings = lossy(recordings, rng, "device", "bench")
    if case == "standard":
        return Campaign(recordings, known(overrides), label=label)
    return Campaign(recordings, lambda p: OVER_SEEDS if p.name in STATISTICS else None, label=label)


def known(overrides: Mapping[str, Any]) -> Callable[[Parameter], float | None]:
    """Return what tells the truth of a parameter; None where it has none of its own."""
    t = truth_of(PressuresTruth(), overrides)
    rho = 1e-6 * (t.device_ppm - t.bench_ppm)
    middle = 0.5 * (t.device_lag + t.duration)
    values = {
        "lag": t.device_lag + rho * middle, "clock_rate": rho, "r_access": t.R_a, "r_filter": t.R_f, "r_return": t.R_r,
        "c_return": t.C_2, "l_return": t.L_r, "c_uf": t.C_u, "k_uf": t.K_uf,
    }  # fmt: skip

    def truth(p: Parameter) -> float | None:
        sensor = {"gain": "gain", "offset": "offset", "sensor_pole": "pole"}.get(p.name)
        tap = p.at.get("channel", TAPS[1])
        return values.get(p.name) if sensor is None else float(getattr(t, f"{sensor}_{tap}"))

    return truth


STUDY = Study(PRESSURES, CASES, campaign)
