"""The methods paragraphs of `tpjb.rotating`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    if "runs" not in findings.arrays:
        return []
    paragraphs = [
        _signals(findings),
        _harmonics(findings),
        _fit(findings),
        _choice(),
        _errors(),
        _limit(findings),
    ]
    if "consistency" in findings.arrays:
        paragraphs.append(_consistency())
    return paragraphs


def _signals(findings: Findings) -> str:
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    average = findings.settings.get("average")
    means = f"{average:g} s" if average else "a hundredth of a turn of the load where logs are faster than that"
    return (
        "A force vector of constant size turned slowly round the stator in its static equilibrium (Ciulli and Forte 2019). "
        "The displacement of the stator against the shaft in the middle plane is half the difference of opposed proximity "
        f"probes, interpolated between the planes. Signals were averaged over {means}. Probes that contradict the others, "
        "stuck stretches and lone wild samples were left out; a delay of the forces and a friction in them were taken out where "
        f"ramps and unrest of the load show them surely. x is horizontal, y up; forces act on the stator.{told}"
    )


def _harmonics(findings: Findings) -> str:
    least = findings.settings.get("least_turns", 3.0)
    return (
        "The true frequency of the load is the slope of its unwrapped angle. Over the turns at full load, orders 1 to 6, an "
        "offset and a drift of second degree were fitted to x, y and the forces at the recorded stamps by least squares; "
        "complex orbit harmonics Z_k turn forwards for k > 0. Their errors come from the residual's spectrum beside each "
        f"line. Fewer than {least:g} turns, uneven rotation or orbits that do not close have no harmonics."
    )


def _fit(findings: Findings) -> str:
    counts = findings.arrays["runs"].groupby("group").size().to_dict()
    shared = "; ".join(f"{group}: {counted(int(n), 'run')}" for group, n in counts.items())
    return (
        "Force and displacement from the static equilibrium were related by the quasi-static laws M1 to M5 of the paper "
        "(eqs 3, 4), M6 with mixed terms dx dy, and M3p, a quadratic law of each pad pair. Each was fitted to all ratios at "
        f"one static load with common coefficients ({shared}); every run has its own offset, which is the equilibrium, and "
        "a drift of second degree. Started by least squares of the force, the fit minimises measured less modelled "
        "displacement, solved by Newton's method at every sample, with an analytic Jacobian; noise of the force counts by "
        "its effective variance (Orear 1982). Damping is left out: at such frequencies it turns the orbit by less than 0.1 deg."
    )


def _choice() -> str:
    return (
        "The noise of the displacement was taken from what a smooth function of the force does not explain, so chi2 is known "
        "without a law: above 2 per degree of freedom no law holds, and coefficients are then taken from lower ratios where "
        "one holds there. Of the laws the one of least BIC (Schwarz 1978) was chosen, or a simpler one if it changes the orbit by "
        "less than 1 % of the 1X and leaves no more than noise: a linear one for that alone, a quadratic one if its BIC is not "
        "decisively worse."
    )


def _errors() -> str:
    return (
        "Type A is the covariance of the fit under the noise of the residual between 0.4 and 20 orders of "
        "the rotation, since only slow noise reaches the coefficients and the shaft's line is folded above. The stated "
        "gain errors of probes and load cells, which scale all coefficients alike, are added in squares (type B); intervals hold 95 %. Without a stretch "
        "at zero force and with one ratio, kxx2 + kxy2 and kyx2 + kyy2 act through the mean shift only and are not told."
    )


def _limit(findings: Findings) -> str:
    high = 100 * float(findings.settings.get("thd_nonlinear", 0.05))
    low = 100 * float(findings.settings.get("thd_linear", 0.025))
    return (
        "THD is sqrt(sum |Z_k|^2 - noise), 2 <= |k| <= 6, of d - K^-1 f over the 1X of d: what the load's own harmonics "
        f"explain is taken out. An orbit is called linear below {low:g} %, nonlinear above {high:g} %. The limit rho* is the "
        f"load ratio at which the chosen law reaches {high:g} % under a circular load; its error comes from draws of the "
        "coefficients."
    )


def _consistency() -> str:
    return (
        "Stiffness was compared with that of the dynamic test, carried to zero frequency over its tones; gains of the "
        "sensors are common to both tests and cancel. Where the stiffness is known at several static loads, kyy2 = kyy "
        "(dkyy/dW)/2, kxxy = kyy dkxx/dW and the rise of the equilibrium, the integral of dW/kyy, tie the tests together; "
        "kxxy = 2 kyx2, kyxy = 2 kxy2 and kxy = kyx hold for a conservative film."
    )
