"""What Breglio et al. (2019) print, and what follows from it by arithmetic alone (tire.md, section 4). No logs here."""

from __future__ import annotations

import math

from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Published
from pipeline.rigs.tire.tire_size import tire_size

G0 = 9.80665
KMH = 1.0 / 3.6
MAH = 3.6  # C
SAMPLE_RATE, ADC_BITS, CHANNELS = 12e3, 12, 2
ADC_REFERENCE = 3.3
# Sections 2.1, 3 and 4: "70 mV per 50 kg", charges with and without the sleep mode, "33.4 %", stand-by, battery.
SENSITIVITY = 70e-3 / (50.0 * G0)
CHARGE_ALWAYS, CHARGE_GATED = 564.0 * MAH, 169.0 * MAH
SAVING = 0.334
STANDBY = 0.46e-6
BATTERY = 500.0 * MAH
VOLTAGE_TEXT, VOLTAGE_CAPTION = 3.7, 3.3
SPEED_TEST_LOAD = 2000.0
LOAD_SWEEP_SPEED, TOP_SPEED = 10.0 * KMH, 20.0 * KMH
LOADS = 3
TIRE = "245/40R18"
# The radio's data sheet: rates of the nRF24L01 (bit/s), its current while powered down (A).
_RATES = (250e3, 1e6, 2e6)
_POWER_DOWN = 0.9e-6
_YEAR = 365.25 * 86400.0


def paper_alone() -> list[Published]:
    """Return the checks of the paper that need no logs."""
    return [*_energy(), *_radio(), *_sensitivity(), *_words()]


def life(charge: float, time_base: float) -> float:
    """Return how long (s) the battery lasts when `charge` (C) is used in `time_base` (s)."""
    return BATTERY / charge * time_base


def _row(
    name: str, published: float | str | None, found: float | str | None, unit: str, where: str, agrees: bool | None, remark: str
) -> Published:  # fmt: skip
    return Published(
        name=name, published=published, found=found, unit=unit, where=where, agrees=agrees, remark=remark, basis="paper"
    )


def _energy() -> list[Published]:
    saved = 1.0 - CHARGE_GATED / CHARGE_ALWAYS
    factor = CHARGE_ALWAYS / CHARGE_GATED
    left = (1.0 - SAVING) * CHARGE_ALWAYS
    hours = [life(charge, 1.0) for charge in (CHARGE_ALWAYS, CHARGE_GATED)]
    standby = BATTERY / STANDBY
    energy = [BATTERY / MAH * 1e-3 * volts for volts in (VOLTAGE_TEXT, VOLTAGE_CAPTION)]
    return [
        _row(
            "energy saved by the sleep mode", SAVING, saved, "%", "sections 2.1 and 4", abs(saved - SAVING) < 5e-4,
            f"from {CHARGE_ALWAYS / MAH:.0f} to {CHARGE_GATED / MAH:.0f} mAh is a cut of {100 * saved:.1f} %, a factor of "
            f"{factor:.2f}: {100 * SAVING:.1f} is probably that factor with its point moved. A cut of {100 * SAVING:.1f} % would leave "
            f"{left / MAH:.1f} mAh",
        ),
        _row(
            "time for which the stated charges last", None, None, "s", "section 2.1", None,
            f"mAh is a charge and the paper gives no time for it. Were it per hour, {BATTERY / MAH:.0f} mAh would last {hours[0]:.2f} h "
            f"without and {hours[1]:.2f} h with the sleep mode; a mean current of {CHARGE_GATED / MAH:.0f} mA is more than this radio and a "
            "microcontroller draw. No battery life follows without a time base",
        ),
        _row(
            "stand-by, as a mean current", f"{STANDBY * 1e6:.2f} uAh", f"{standby / _YEAR:.0f} years", "1", "section 2.1", None,
            f"{STANDBY * 1e6:.2f} uAh read as {STANDBY * 1e6:.2f} uA empties the battery in {standby / 3.6e9:.2f} million hours; "
            f"the radio alone, powered down, draws {_POWER_DOWN * 1e6:.1f} uA by its data sheet. Self-discharge sets the shelf life",
        ),
        _row(
            "voltage of the battery", VOLTAGE_TEXT, VOLTAGE_CAPTION, "V", "section 2.1; Fig. 2", False,
            f"the text has {VOLTAGE_TEXT} V ({energy[0]:.2f} W h), the caption {VOLTAGE_CAPTION} V ({energy[1]:.2f} W h), presumably the "
            "regulated supply",
        ),
    ]  # fmt: skip


def _radio() -> list[Published]:
    rate = SAMPLE_RATE * CHANNELS * ADC_BITS
    fits = [one for one in _RATES if one > rate]
    return [
        _row(
            "data rate of two channels", f"up to {_RATES[0] / 1e3:.0f} kbit/s", f"{rate / 1e3:.0f} kbit/s", "1", "section 2; data sheet", rate < _RATES[0],
            f"{SAMPLE_RATE / 1e3:g} kHz times {CHANNELS} channels of {ADC_BITS} bit are {rate / 1e3:.0f} kbit/s: the radio's slowest mode (by its data sheet, left) does "
            f"not carry them, {' or '.join(f'{one / 1e6:g}' for one in fits)} Mbit/s does",
        ),
        _row(
            "kind of radio", "Bluetooth", "nRF24L01", "1", "section 2", False,
            "the paper names both for one link; the nRF24L01 has a protocol of its own at 2.4 GHz and no Bluetooth",
        ),
    ]  # fmt: skip


def _sensitivity() -> list[Published]:
    step = ADC_REFERENCE / 2**ADC_BITS
    circumference = math.pi * tire_size(TIRE).diameter
    turns = [circumference / speed for speed in (LOAD_SWEEP_SPEED, TOP_SPEED)]
    return [
        _row(
            "sensitivity of the peak, in SI", "70 mV per 50 kg", SENSITIVITY, "V/N", "section 3", None,
            f"{1.0 / SENSITIVITY:.0f} N/V; one step of a {ADC_BITS} bit converter at {ADC_REFERENCE} V is {step / SENSITIVITY:.2f} N = "
            f"{step / SENSITIVITY / G0:.3f} kg",
        ),
        _row(
            "load of the speed test", f"{SPEED_TEST_LOAD:.0f} N", f"{SPEED_TEST_LOAD / G0:.0f} kg", "1", "section 3", None,
            "as a mass, to be held against the sensitivity per 50 kg",
        ),
        _row(
            "degrees of freedom of a line through the paper's loads", None, float(LOADS - 2), "1", "Fig. 8", None,
            f"{LOADS} loads leave one: Student's t is {t_quantile(LOADS - 2):.1f} instead of 2. Measure at five loads or more",
        ),
        _row(
            "time of one revolution at 10 km/h", None, turns[0], "s", "section 3, tire size", None,
            f"{turns[1]:.3f} s at 20 km/h, with the nominal circumference {circumference:.4f} m of {TIRE}; the values of Figs 8 and 9 are lost",
        ),
    ]  # fmt: skip


def _words() -> list[Published]:
    radius = tire_size(TIRE).radius
    return [
        _row(
            "curvature in the contact patch", "decreases to a minimum", f"k = 1/R - kappa = {1.0 / radius:+.2f} 1/m on a flat spot", "1",
            "sections 2.2 and 3, eq. (2)", True,
            "the paper's k is minus the change of curvature: the curvature's minimum is the maximum of k, hence positive peaks",
        ),
        _row(
            "radial displacement", "-w", "+w outward", "1", "section 2.2, eq. (1)", False,
            "with -w an inextensible belt would have w = dv/dtheta; eqs (1) and (2) hold for w outward",
        ),
        _row(
            "flex and PVDF", "a change of flex is a slope of PVDF", "PVDF follows the slope of flex", "1", "section 3", False,
            "the readout passes the derivative of strain, and flex measures strain itself",
        ),
        _row(
            "Fig. 2a", "a picture of the PVDF film", "a block diagram", "1", "section 2", False,
            "cited as both",
        ),
    ]  # fmt: skip
