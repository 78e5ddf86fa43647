"""What the checks of section 5.8 give away, in words; the numbers are `misfit`'s."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.conditions import TAP_NAMES, TAPS, pressure
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.pressures.misfit import Misfit

_RESISTANCES = {"r_access": "access line (R_a)", "r_filter": "filter (R_f)", "r_return": "return line (R_r)"}
_OF_STROKES = ("residual_line", "pulsation_gain")
# The meter's step with ultrafiltration: about -1 on the return line, 0 on the access line; in between it tells nothing.
_HALF, _SURE = -0.5, 3.0


def misfit_faults(
    run: str, checks: Sequence[Misfit], location: str | None, told: Collection[str] = ()
) -> list[QualityFinding]:
    """Return a warning for each check that is beyond its limit and beyond chance.

    Parameters
    ----------
    location
        Where the run says that the flow meter sits.
    told
        Taps whose pulsation is told elsewhere with its cause, or is too weak to judge.
    """
    found = []
    for check in checks:
        if check.name == "meter_step":
            found += _meter(run, check, location)
        elif check.exceeds and not (check.name in _OF_STROKES and check.channel in told):
            channel = pressure(check.channel, "rap") if check.channel in TAPS else None
            found.append(QualityFinding("warning", _told(check), run, channel))
    return found


def _told(check: Misfit) -> str:
    where = TAP_NAMES.get(check.channel or "", check.channel or "")
    percent = f"{100 * check.value:+.1f} ± {196 * check.std_error:.1f} %"
    circuit = _RESISTANCES.get(check.channel or "", where)
    if check.name == "resistance_trend" and check.channel == "k_uf":
        return (
            f"ultrafiltration coefficient K_uf changes by {percent} from start to end of the ultrafiltration: saline has no protein, so temperature (about 2 %/K), trapped air, "
            "an offset that drifts or a wrong UF rate; with blood or medium a clogging membrane. One number does not hold for the run, see rap.therapy"
        )
    words = {
        "residual_line": f"residual pulsation after alignment: {abs(100 * check.value):.1f} % of the {where} stroke is left in device less bench: lag, pole or gain of that "
        "tap are not what was found, or it has air",
        "drift": f"residual drifts: {where} device less bench changes by {check.value:+.0f} Pa ({check.value / MMHG:+.2f} mmHg) an hour: a zero that moves with temperature or "
        "time. Zero at both ends of the run",
        "curvature": f"the {where} sensor's gain depends on the pressure: {percent} from the middle to the ends of its range: one gain and offset do not describe it",
        "pulsation_gain": f"the {where} pulsation is {percent} off what the means' gain lets expect: amplitude-dependent gain, or something soft at the transducer; E2 invalid",
        "resistance_trend": f"resistance of the {circuit} changes by {percent} within the run at equal flow: clotting, a kink, temperature (about 2 %/K) or a meter that drifts; one "
        "number does not hold for the run",
        "resistance_over_flow": f"resistance of the {circuit} changes by {percent} from the lowest to the highest flow: a zero left over, turbulence, or the flow meter's zero; the "
        "line through the origin is a mean",
    }  # fmt: skip
    return words[check.name]


def _meter(run: str, check: Misfit, location: str | None) -> list[QualityFinding]:
    """Hold what the meter does when ultrafiltration comes on against where it is said to sit."""
    if abs(check.value - _HALF) < _SURE * check.std_error:
        return []
    seen = "return" if check.value < _HALF else "access"
    step = f"its reading changes by {check.value:+.2f} ± {1.96 * check.std_error:.2f} of the ultrafiltration rate when that comes on"
    if location is None and seen == "return":
        text = f"meter reads Q_b - Q_uf: {step}, as on the return line; flowmeter_location is not stated. State it: flow before the filter then uses the UF rate"
        return [QualityFinding("warning", text, run, "blood_flow_bench")]
    if location is not None and location != seen:
        meant = "meter reads Q_b - Q_uf" if seen == "return" else "meter reads Q_b"
        text = f"{meant}: {step}, as on the {seen} line, but flowmeter_location says '{location}'. Resistances are off by the share of the ultrafiltration until one is mended"
        return [QualityFinding("warning", text, run, "blood_flow_bench")]
    return []
