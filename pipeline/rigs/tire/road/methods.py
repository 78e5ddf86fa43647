"""The methods paragraphs of `tire.road`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.rigs.tire.road.sections_tracks import rows_of


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    if "drives" not in findings.arrays:
        return []
    drives = rows_of(findings.arrays["drives"])
    with_bench = [row for row in drives if row["bench"]]
    paragraphs = [_passages(findings, drives)]
    if with_bench:
        paragraphs += [_forces(with_bench), _errors()]
    paragraphs += [_tracks(findings), _checks(bool(with_bench))]
    return paragraphs


def _passages(findings: Findings, drives: Sequence[dict[str, object]]) -> str:
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    radii = "; ".join(dict.fromkeys(str(row["radius_source"]) for row in drives))
    return (
        "A flex sensor on the inner liner passed the contact patch once a revolution (Breglio et al. 2019). Packets were placed on the "
        "transmitter's sample grid by their counters, lost samples kept as missing, voltages turned into resistance by the divider. Passages "
        "were timed by least squares on a running template and its derivative, samples ordered by the angle between passages (Fyfe and Munck "
        "1997) in 1024 bins of a revolution. Peripheral speed is rolling radius times rotation; the radius comes from: "
        f"{radii}.{told}"
    )


def _forces(drives: Sequence[dict[str, object]]) -> str:
    benches = listing(dict.fromkeys(str(row["bench"]) for row in drives))
    return (
        f"Load and longitudinal force: the flexible ring (after Gong 1993) with the parameters of the bench campaign {benches}, at the "
        "pressure that the drive states, was pressed on a flat road at loads from zero to beyond those of the drive; its curvature, averaged "
        "over the sensor's length and lagged, is a library over load and force. Each revolution was fitted by Gauss-Newton in the divider's "
        "voltage for load, force, angle and resistance, weighted by the spectrum of what earlier fits left over, so that its standard errors "
        "hold under coloured road noise; where neighbouring revolutions scatter by more than these explain (a body that moves while the "
        "patch passes), the errors of the longitudinal force are widened to that scatter. The mean of a revolution is the sensor's resistance at rest: slow drift of it falls out."
    )


def _errors() -> str:
    return (
        "What the bench leaves uncertain (covariance of its ring fit; load cell, pressure and sensor length as type B) and the pressure of the "
        "drive were carried through the same fit; they move all revolutions together and stand in every standard error of load and force "
        "in `revolutions.parquet`, apart from the random part in `evidence.parquet`. What other pressures do to the foundation is not known and "
        "adds a share of the correction. What the ring leaves of the mean waveform, and a gain that leaves that of the film, are added: "
        "nothing is corrected by them, and where the gain is more than a tenth too low load and force are withheld."
    )


def _tracks(findings: Findings) -> str:
    settings = findings.settings
    forces, rotation = float(settings.get("force_walk", 1000.0)), float(settings.get("rotation_walk", 1.0))
    tuned = " and tuned until the mean normalised innovation squared is 1" if settings.get("tune_walk", True) else ""
    return (
        "Load, force and rotation were each tracked by a Kalman filter (Kalman 1960) with value and slope as state, one update a "
        f"revolution, the slope a random walk (q = {forces:g} N s^-1.5 for forces, {rotation:g} rad s^-2.5 for the rotation to start with"
        f"{tuned}), predicting through lost passages; innovations beyond NIS 10.8 are left out (Bar-Shalom et al. 2001)."
    )


def _checks(forces: bool) -> str:
    said = (
        "Events are where the load leaves its running median, or the force that of steady rolling at that speed, by more than the set multiple of a robust standard "
        "deviation for two revolutions or more; their time is the centre. "
        if forces
        else ""
    )
    return (
        f"{said}Bonding was checked by the ratio of the flex sensor's amplitude to the PVDF film's. Reference channels were averaged over each "
        "revolution after the clocks were compared; errors against them are those of the filtered tracks."
    )
