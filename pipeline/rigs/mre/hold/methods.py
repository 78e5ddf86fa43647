"""The methods paragraphs of `mre.hold`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    settle = findings.settings.get("settle", 3.0)
    paragraphs = [
        "Holds were found from the measured coil current alone: stretches in which the means of a quarter of a second before and after a "
        f"sample do not differ by more than its noise. The first {settle:g} s of each hold, at most half of it, do not enter; lone samples more than six robust "
        "standard deviations off are left out."
    ]
    state = findings.arrays.get("state")
    if state is not None:
        paragraphs += [_law(findings), _limit()]
    if "field" in findings.arrays:
        paragraphs.append(
            "The flux density was fitted by the same law, from the slope s_0 at 0 A to the limit B_s, with one remanence b for each sweep direction, to the "
            "means of the holds, the scatter of the holds about the law setting the errors. Flux density of a saturation that the sweep only begins to show is not told."
        )
    return paragraphs


def _law(findings: Findings) -> str:
    state = findings.arrays["state"].iloc[0]
    ways = "both sweep directions" if state["both_ways"] else "one sweep direction"
    blank = f" The pull of the poles measured in run {state['blank']} was taken off first." if state["blank"] else ""
    return (
        f"The law F(I, t) = F_0 (1 + a S(I/I_s; p)) (1 − r log10(t/t_0)) with S as below, t from the start of the log and t_0 = 10 s, was fitted to {state['holds']} holds of "
        f"{ways}.{blank} Two numbers of each hold enter: the mean force, and its creep against log10(t/t_0). The force is linear in F_0 and the initial slope, so "
        "variable projection was used (Golub and Pereyra 1973, Kaufman 1975), from eight starts; sharpness was searched as 1/p, so that straight-then-flat is 0. The "
        "variances of both kinds of data were estimated with the fit: an error that stays for a whole hold widens the intervals. Increments are F(I)/F(0) − 1 at one time, "
        "so relaxation is not in them. The law was tested against the holds with one free force a level (F test, 99.95 %): where it misses them, or the sweeps differ level after level, "
        "limit, saturation current and sharpness are not told and increments are those of the levels, or null where a force that goes with B^2 mends the misfit. A force that goes "
        "linearly with time (99.5 %) is fitted along, a gap closed before the log began is taken as the age that fits best (99 %); relaxation is then not told."
    )


def _limit() -> str:
    return (
        "Against the S law stand a hinge (straight, then flat: p → ∞), a hyperbolic tangent (tanh), the law of Froehlich and Kennelly (FK, p = 1) and a straight line, compared with the weights of the S law by AICc (Hurvich and Tsai 1989). Intervals of I_s, a and p are those of the profile "
        "likelihood, the others Student's. Saturation is called seen, and I_s, a and p are told, only where the interval of I_s closes below the largest current, the slope there is below "
        "a quarter of that at 0 A with its upper 95 % limit, and three quarters of the limit were reached. Intervals hold 95 %; that of F_0 contains the calibration "
        "where the conditions tell it."
    )
