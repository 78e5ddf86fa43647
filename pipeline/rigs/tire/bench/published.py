"""Published numbers and claims beside what these logs give (tire.md, section 4); the paper's own arithmetic stands in `paper`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.findings import Parameter, Published
from pipeline.rigs.tire.bench.bench_run import BenchRun
from pipeline.rigs.tire.bench.paper import BATTERY, CHARGE_ALWAYS, CHARGE_GATED, G0, MAH, SENSITIVITY, life, paper_alone
from pipeline.rigs.tire.bench.same_tire import Tire

# "In the order of": another circuit, sensor and tire give another number of the same order.
_SAME_ORDER = 3.0
# ETRTO: rolling circumference over nominal diameter (our recollection of the convention).
_ETRTO = 3.05


def published(parameters: Sequence[Parameter], runs: Sequence[BenchRun], tire: Tire) -> list[Published]:
    """Return what the logs say of the paper's numbers and claims, then the checks of the paper alone."""
    return [
        *_sensitivity(parameters),
        *_radius(parameters, tire),
        *_peaks(runs),
        *_lengths(parameters, tire),
        *_film(parameters),
        *_battery(runs),
        *paper_alone(),
    ]


def _one(parameters: Sequence[Parameter], name: str) -> Parameter | None:
    return next((p for p in parameters if p.name == name and p.value is not None), None)


def _sensitivity(parameters: Sequence[Parameter]) -> list[Published]:
    found = _one(parameters, "load_sensitivity")
    if found is None or found.value is None:
        return []
    ratio = found.value / SENSITIVITY
    return [
        Published(
            name="sensitivity of the peak", published=SENSITIVITY, found=found.value, unit="V/N", where="section 3: 70 mV per 50 kg",
            agrees=1.0 / _SAME_ORDER < ratio < _SAME_ORDER,
            remark=f"{found.value * 50e3 * G0:.1f} mV per 50 kg at mid-range; the paper says 'in the order of' and gives neither circuit nor "
            "pressure, and the slope falls with load",
        )
    ]  # fmt: skip


def _radius(parameters: Sequence[Parameter], tire: Tire) -> list[Published]:
    found = _one(parameters, "rolling_radius")
    if found is None or found.value is None or tire.free_radius is None:
        return []
    expected = _ETRTO * tire.free_radius / np.pi
    return [
        Published(
            name="effective rolling radius", published=None, found=found.value, unit="m", where="Fig. 9b, lost", agrees=None,
            remark=f"{100 * found.value / tire.free_radius:.2f} % of the free radius {1e3 * tire.free_radius:.1f} mm; rolling circumferences of "
            f"3.05 nominal diameters would give {1e3 * expected:.1f} mm",
        )
    ]  # fmt: skip


def _peaks(runs: Sequence[BenchRun]) -> list[Published]:
    if not runs:
        return []
    skewness = [run.waveform.skewness for run in runs]
    up = sum(value > 0 for value in skewness)
    return [
        Published(
            name="one positive peak in the patch, two lower ones beside it", published="positive peaks", found=f"skewness {min(skewness):.2g} to {max(skewness):.2g}",
            where="sections 2.2 and 3, Fig. 4c", agrees=up == len(runs),
            remark="R2 over the angle, sensor mounted so that flattening raises it; the two lower peaks are dips below the mean",
        )
    ]  # fmt: skip


def _lengths(parameters: Sequence[Parameter], tire: Tire) -> list[Published]:
    by = {(p.name, p.at.get("load"), p.at.get("speed")): p.value for p in parameters if p.value is not None}
    points = [(load, speed) for name, load, speed in by if name == "contact_length"]
    ratios = [
        (slope / contact, bent / contact)
        for point in points
        if (slope := by.get(("slope_length", *point))) is not None
        and (bent := by.get(("deformation_length", *point))) is not None
        and (contact := by["contact_length", *point])
    ]  # fmt: skip
    if not ratios:
        return []
    low, high = min(r[0] for r in ratios), max(r[0] for r in ratios)
    length = f" of {1e3 * tire.sensor_length:.0f} mm" if tire.sensor_length else ""
    return [
        Published(
            name="contact length from the slopes of the signal", published="slope length = Lc", found=f"slope length/Lc = {low:.2f} to {high:.2f}",
            where="section 3", agrees=low > 0.95 and high < 1.05,
            remark=f"a sensor{length} longer than the contact pins the slope length at its own length; Lc comes from the ring fit",
        ),
        Published(
            name="deformation length over contact length", published=None,
            found=f"{min(r[1] for r in ratios):.2f} to {max(r[1] for r in ratios):.2f}", where="Fig. 4b, lost", agrees=None,
            remark="Ld from dip to dip: the paper's definitions are lost, these are ours",
        ),
    ]  # fmt: skip


def _film(parameters: Sequence[Parameter]) -> list[Published]:
    values = [p.value for p in parameters if p.name == "pvdf_nrmse" and p.value is not None]
    if not values:
        return []
    return [
        Published(
            name="PVDF is what flex is, differentiated", published="qualitative", found=f"NRMSE {100 * min(values):.2g} to {100 * max(values):.2g} %",
            where="section 3", agrees=max(values) < 0.1,
            remark="predicted from flex with one gain and one time constant; a pure derivative holds for low orders only",
        )
    ]  # fmt: skip


def _battery(runs: Sequence[BenchRun]) -> list[Published]:
    base = next((value for run in runs if (value := run.told("time_base")) is not None), None)
    if base is None:
        return []
    lives = [life(charge, base) / 3600.0 for charge in (CHARGE_ALWAYS, CHARGE_GATED)]
    return [
        Published(
            name="battery life with the time base of these runs", published=None, found=lives[1] * 3600.0, unit="s", where="section 2.1", agrees=None,
            remark=f"{lives[0]:.3g} h without the sleep mode; {BATTERY / MAH:.0f} mAh and the paper's charges, each used in {base / 3600.0:.3g} h",
        )
    ]  # fmt: skip
