"""The paper's therapy numbers held against each other (rap.md, section 4, rows 1-4, 6, 7, 12, 13): no log enters.

What the paper prints stands in `Printed`; everything else is computed from it, here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.findings import Published

ML, MINUTE, HOUR, DAY, WH = 1e-6, 60.0, 3600.0, 86400.0, 3600.0
ML_MIN, ML_H = ML / MINUTE, ML / HOUR
CELSIUS = 273.15


@dataclass(frozen=True)
class Printed:
    """Numbers that stand in the text of RAP 2019, SI (temperatures K, shares 1, heparin in IU)."""

    battery_energy: float = 75.5 * WH
    power: float = 13.9
    runtime: float = 5.0 * HOUR
    trial: float = 312.0 * MINUTE
    uf_trial: float = 5.0 * HOUR
    uf_rate: float = 5.0 * ML_MIN
    uf_need: tuple[float, float] = (1.5e-3, 2.0e-3)
    tank: float = 2.2e-3
    heparin_dose: tuple[float, float] = (500.0 / HOUR, 1500.0 / HOUR)
    heparin_concentration: float = 500.0 / ML
    heparin_flow: tuple[float, float] = (1.0 * ML_H, 2.5 * ML_H)
    temperature_first: float = 25.0 + CELSIUS
    temperature_stable: float = 30.0 + CELSIUS
    room: float = 25.5 + CELSIUS
    temperature_error: float = 0.05
    temperature_step: float = 10.0 * MINUTE
    cytotoxicity: float = 6.0 * HOUR
    medium: float = 500.0 * ML
    blood_flow: tuple[float, float] = (60.0 * ML_MIN, 100.0 * ML_MIN)
    stagnation: float = 120.0


PRINTED = Printed()
# Voltage and capacity of cells that would give the printed energy (a guess that the numbers invite, not printed).
_CELL_VOLTAGE = 3.7
_EFFICIENCIES = (0.90, 0.85)


def heparin_flow(paper: Printed = PRINTED) -> tuple[float, float]:
    """Return the flow that the printed doses need at the printed concentration, m^3/s, least and most."""
    low, high = paper.heparin_dose
    return low / paper.heparin_concentration, high / paper.heparin_concentration


def paper_alone() -> list[Published]:
    """Return the checks of the paper's own therapy numbers."""
    return [*_battery(), *_need(), *_trial(), *_heparin(), *_temperature(), *_cytotoxicity(), _hemolysis()]


def row(name: str, published: str, found: str, agrees: bool | None, remark: str, where: str) -> Published:
    """Return a row that was computed from the paper alone."""
    return Published(
        name=name, published=published, found=found, agrees=agrees, remark=remark, where=where, basis="paper"
    )


def _battery() -> list[Published]:
    p = PRINTED
    runtime = p.battery_energy / p.power
    five, trial = p.power * p.runtime, p.power * p.trial
    derated = ", ".join(f"{n:.2f}: {n * runtime / HOUR:.2f} h" for n in _EFFICIENCIES)
    below = all(n * runtime < p.runtime for n in _EFFICIENCIES)
    short = f", which is less than {p.runtime / HOUR:g} h" if below else ""
    share = trial / p.battery_energy
    day = p.power * DAY
    return [
        row(
            "battery runtime", f"{p.battery_energy / WH:g} Wh, {p.power:g} W, up to {p.runtime / HOUR:g} h",
            f"{runtime / HOUR:.3f} h ({runtime / MINUTE:.1f} min)", runtime >= p.runtime,
            f"{p.runtime / HOUR:g} h use {five / WH:.1f} Wh, {100 * five / p.battery_energy:.1f} % of the battery: 'up to' is rounded "
            f"down. A converter takes its part, with an efficiency of {derated}{short}",
            "row 1",
        ),
        row(
            f"{p.trial / MINUTE:g} min trial on one battery", f"{p.battery_energy / WH:g} Wh",
            f"{trial / WH:.2f} Wh, {100 * share:.1f} %", None,
            f"possible only with an efficiency of {share:.3f} or more; {p.battery_energy / WH:g} Wh are "
            f"{p.battery_energy / WH / _CELL_VOLTAGE:.1f} Ah at {_CELL_VOLTAGE:g} V, which looks like a rating of the cells. The paper "
            "does not say whether the trial ran on the battery",
            "row 1",
        ),
        row(
            "use 24 h a day", "intended", f"{day / WH:.1f} Wh, {day / p.battery_energy:.2f} batteries a day", None,
            "rests on changing batteries under way or on the mains", "row 2",
        ),
    ]  # fmt: skip


def _need() -> list[Published]:
    low, high = (volume / DAY for volume in PRINTED.uf_need)
    return [
        row(
            "ultrafiltration that a patient needs",
            "{:g} to {:g} L in 24 h".format(*(1e3 * volume for volume in PRINTED.uf_need)),
            f"{low / ML_MIN:.3f} to {high / ML_MIN:.3f} mL/min",
            None,
            f"the trial ran at {PRINTED.uf_rate / ML_MIN:g} mL/min; regulation at the low rate was not tested",
            "row 3",
        )
    ]


def _trial() -> list[Published]:
    p = PRINTED
    delivered, whole, day = p.uf_rate * p.uf_trial, p.uf_rate * p.trial, p.uf_rate * DAY
    low, high = p.uf_need
    battery = p.battery_energy / p.power
    slow, fast = high / DAY, low / DAY
    return [
        row(
            "accelerated ultrafiltration", f"{p.uf_rate / ML_MIN:g} mL/min, {p.uf_trial / HOUR:g} h, tank {1e3 * p.tank:g} L",
            f"{1e3 * delivered:.2f} L ({p.trial / MINUTE:g} min: {1e3 * whole:.2f} L); 24 h would be {1e3 * day:.1f} L", True,
            f"{day / high:.1f} to {day / low:.1f} times the daily need, no contradiction but an accelerated test: "
            f"{p.uf_trial / HOUR:g} h give the lower need; {1e3 * high:g} L take {high / p.uf_rate / HOUR:.2f} h, more than the battery's "
            f"{battery / HOUR:.2f} h, which end at {1e3 * battery * p.uf_rate:.2f} L. The tank is full after "
            f"{p.tank / p.uf_rate / HOUR:.2f} h; a day fills it {day / p.tank:.2f} times. At the need of {fast / ML_MIN:.2f} to "
            f"{slow / ML_MIN:.2f} mL/min it lasts {p.tank / fast / HOUR:.1f} to {p.tank / slow / HOUR:.1f} h",
            "row 4",
        )
    ]  # fmt: skip


def _heparin() -> list[Published]:
    p = PRINTED
    low, high = heparin_flow()
    dose = p.heparin_flow[1] * p.heparin_concentration * HOUR
    other = p.heparin_dose[1] / p.heparin_flow[1] * ML
    shares = [[100 * flow / uf for flow in (low, high)] for uf in (p.uf_rate, *(v / DAY for v in p.uf_need))]
    trial, least, most = shares
    return [
        row(
            "heparin flow", "{:g} to {:g} mL/h".format(*(flow / ML_H for flow in p.heparin_flow)),
            f"{low / ML_H:g} to {high / ML_H:g} mL/h", abs(high - p.heparin_flow[1]) < 0.01 * high,
            "from {:g} to {:g} IU/h at {:g} IU/mL. ".format(*(d * HOUR for d in p.heparin_dose), p.heparin_concentration * ML)
            + f"{p.heparin_flow[1] / ML_H:g} mL/h are {dose:g} IU/h, or need {other:.0f} IU/mL, with which the lower end is "
            f"{p.heparin_dose[0] / other * ML / ML_H:.2f} mL/h. Heparin adds {trial[0]:.2g} to {trial[1]:.2g} % to the balance at "
            f"{p.uf_rate / ML_H:g} mL/h, {most[0]:.2g} to {least[1]:.2g} % at the need",
            "row 6",
        )
    ]  # fmt: skip


def _temperature() -> list[Published]:
    p = PRINTED
    cold, warm = (p.temperature_error * (t - CELSIUS) for t in (p.temperature_first, p.temperature_stable))
    rise = p.temperature_stable - p.temperature_first
    samples = int(p.trial // p.temperature_step) + 1
    return [
        row(
            "largest temperature error", f"{100 * p.temperature_error:g} %",
            f"{cold:.2f} K at {p.temperature_first - CELSIUS:g} °C, {warm:.2f} K at {p.temperature_stable - CELSIUS:g} °C", None,
            f"a share of degrees Celsius, no ratio scale: of kelvin it would be {p.temperature_error * p.temperature_stable:.0f} K. It is "
            f"{100 * cold / rise:.0f} to {100 * warm / rise:.0f} % of the rise of {rise:g} K",
            "row 7",
        ),
        row(
            "start of the temperature run", f"{p.temperature_first - CELSIUS:g} °C in a room of {p.room - CELSIUS:g} °C",
            f"{p.room - p.temperature_first:.1f} K below the room", None,
            f"a sensor's offset or a cooler start. Every {p.temperature_step / MINUTE:g} min of {p.trial / MINUTE:g} min are {samples} "
            f"samples and the last one, {samples + 1} in all",
            "row 7",
        ),
    ]  # fmt: skip


def _cytotoxicity() -> list[Published]:
    p = PRINTED
    slow, fast = (flow * p.cytotoxicity / p.medium for flow in p.blood_flow)
    battery = p.battery_energy / p.power
    return [
        row(
            "passes of the culture medium in the cytotoxicity test", f"{p.medium / ML:g} mL, {p.cytotoxicity / HOUR:g} h",
            f"{fast:g} at {p.blood_flow[1] / ML_MIN:g} mL/min, {slow:.1f} at {p.blood_flow[0] / ML_MIN:g} mL/min", None,
            f"{p.cytotoxicity / HOUR:g} h are more than the battery's {battery / HOUR:.2f} h: it was changed or the device ran on the "
            "mains. The flow is not stated",
            "row 12",
        )
    ]  # fmt: skip


def _hemolysis() -> Published:
    return row(
        "low hemolysis", "claimed in the conclusions", "no test, no number", None,
        "the text describes no test of hemolysis and no data of one; nothing is reported here", "row 13",
    )  # fmt: skip


def set_point_notes(blood_flow: float | None, uf_rate: float | None, heparin: float | None) -> list[str]:
    """Return what the paper's numbers mean at the set-points of a run (rows 4 and 6).

    Parameters
    ----------
    blood_flow, uf_rate, heparin
        Set-points, m^3/s; None where the log has none.
    """
    p = PRINTED
    low, high = p.uf_need
    notes = []
    if uf_rate is not None and uf_rate > 0:
        battery = p.battery_energy / p.power
        notes.append(
            f"Ultrafiltration of {uf_rate / ML_MIN:.3g} mL/min is {uf_rate * DAY / high:.2g} to {uf_rate * DAY / low:.2g} times the need "
            f"of {1e3 * low:g} to {1e3 * high:g} L a day: 24 h would be {1e3 * uf_rate * DAY:.3g} L. The tank of {1e3 * p.tank:g} L is full "
            f"after {p.tank / uf_rate / HOUR:.3g} h; {1e3 * high:g} L take {high / uf_rate / HOUR:.3g} h, the paper's battery lasts "
            f"{battery / HOUR:.2f} h ({1e3 * battery * uf_rate:.3g} L)."
        )
    least, most = heparin_flow()
    text = (
        f"Heparin: {p.heparin_dose[0] * HOUR:g} to {p.heparin_dose[1] * HOUR:g} IU/h at {p.heparin_concentration * ML:g} IU/mL are "
        f"{least / ML_H:g} to {most / ML_H:g} mL/h, not the {p.heparin_flow[0] / ML_H:g} to {p.heparin_flow[1] / ML_H:g} mL/h that are "
        "printed."
    )
    if heparin is not None and heparin > 0:
        outside = "" if 0.999 * least <= heparin <= 1.001 * most else ", outside that range"
        text += f" Set here: {heparin / ML_H:.3g} mL/h ({heparin * p.heparin_concentration * HOUR:.0f} IU/h){outside}"
        text += f", {100 * heparin / uf_rate:.2g} % of the ultrafiltration." if uf_rate else "."
    elif uf_rate:
        text += f" It would add {100 * least / uf_rate:.2g} to {100 * most / uf_rate:.2g} % to the balance at this rate; the log has none."
    notes.append(text)
    if blood_flow is not None and uf_rate and blood_flow > 0:
        notes.append(
            f"A flow meter on the return line would read {100 * uf_rate / blood_flow:.2f} % less than the blood flow of "
            f"{blood_flow / ML_MIN:.3g} mL/min."
        )
    return notes
