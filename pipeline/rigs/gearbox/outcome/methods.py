"""The methods paragraphs of `gearbox.load_exchange`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.rigs.gearbox.outcome.sections_many import is_many


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    if "runs" not in findings.arrays:
        return []
    paragraphs = [_stages(findings), _levels(findings), _map(), _load(), _friction(findings)]
    if not findings.arrays["vibration"].empty:
        paragraphs.append(_vibration())
    if is_many(findings):
        paragraphs.append(_many(findings))
    return paragraphs


def _many(findings: Findings) -> str:
    unlike = int((findings.arrays["runs"]["unlike"] != "").sum())
    return (
        "Torques, slope, inertia, efficiency and input speed of each run were held against those of the other runs of its speed by a robust "
        "regression (Huber) on a level for each speed, drift and steps, limits being those of all runs and numbers together. "
        f"{counted(unlike, 'run')} off by more than chance allows and by more than 1 %, or between two steps that were soon taken back, "
        f"{'is' if unlike == 1 else 'are'} left out of what the runs share; the numbers of such a run alone stand. Errors of what the runs "
        "share are widened by the scatter of blocks of neighbouring runs, so that what a day has in common does not average out. Tables by "
        "speed tell the mean over the runs and the scatter between them."
    )


def _stages(findings: Findings) -> str:
    left = [run.run for run in findings.runs if not run.used]
    told = f" {counted(len(left), 'run')} left out: {listing(left, 8)}." if left else ""
    return (
        "A two-stage planetary gearbox drove a flywheel with a brake (González-Cruz and Ceccarelli 2019). Clocks of the boards were compared "
        "by what both see (torque of the accelerating load, end of the motion, mesh noise) and moved where clearly off. Stages were found "
        "without labels: speed from straight lines through the encoder's counts, standstill and SOS from gaps between counts, told "
        "apart by the level of the input torque; a sequence other than the protocol's is reported and not forced. Start, "
        "brake onset, unlock, relock and run-down are where the input torque leaves its course, fitted together with the lag (droop times "
        "inertia) with which the drive passes a load on; a lock breaks where the rise bends, some 10 ms before the torque's low-passed peak. SOS "
        "begins and ends with the counts; its end lies between a brake that lets go at once and one that does so in proportion to time. Errors of "
        f"events come from noise, slope and sample interval.{told}"
    )


def _levels(findings: Findings) -> str:
    share = 100 * float(findings.settings.get("torque_accuracy", 0.001))
    return (
        "Zero offsets come from the standstill before the motor is switched on (a change point of the input torque) and, where there is one, "
        "from that at the end. Nominal torques are means over whole turns after the transient was cut (MSER, White 1997) and shaft orders 1 "
        "and 2 fitted; their errors use the effective number of samples and add the offset's. Peaks are maxima after a 20 Hz zero-phase "
        "low-pass; what noise adds to a maximum was found by adding the noise of steady stretches to it. Zero offsets cancel in "
        f"differences of one sensor and not in ratios. Type B ({share:g} % of the sensor's range) is told apart. A torque that changes between "
        "and within the locked stretches by more than its noise, with no standstill at the end to tell its zero, widens all intervals of its "
        "channel by what its zero may have moved. Samples at an end stop are left out."
    )


def _map() -> str:
    return (
        "The slope a of T_out = a (T_in - T_00) was fitted by total least squares to the brake's rise (locked, nearly constant speed: what its small "
        "change leaves in the slope, 0.3 % standard, is added to the error of all runs together), to the start-up "
        "and to the steady levels, ripple over the shaft's angle taken out; runs were pooled by weight. T_0 = T_in - T_out/a in FOS, lock "
        "torque = peak T_in - T_0 (peak without ripple and without what the low-pass adds to its kink; T_0 at the speed at which the lock broke "
        "where its law over speed is known), slip torque = T_out/a with the output held."
    )


def _load() -> str:
    return (
        "T_out = J dω/dt + d0 + d1 ω was integrated against sin^4 windows of 0.8 s, hop 0.1 s (modulating functions, Shinbrot 1957), by parts, "
        "so that counts are never differentiated; least squares over the windows of all runs together, start-up and release, brake free. "
        "Errors come from the torque noise of steady stretches carried through the fit, wider where leaving out one run at a time shows more "
        "scatter. A drift of torque_out is fitted with it. The gearbox's own inertia is not reported: such a campaign leaves it as uncertain "
        "as it is large."
    )


def _friction(findings: Findings) -> str:
    speeds = len(findings.find("drag_locked"))
    law = next((model.name for model in findings.models if model.family.startswith("drag")), "")
    told = (
        f"the law {law} was fitted to T_0 at {counted(speeds, 'speed')}"
        if law
        else f"T_0 stands by speed ({counted(speeds, 'speed')}, too few for a law)"
    )
    return (
        f"Friction (form of Armstrong-Hélouvry, Dupont and Canudas de Wit 1994): {told}; slip torque over slip speed was fitted by a straight "
        "line where two slip speeds are known. All share the error of a, which the fits carry as a common one."
    )


def _vibration() -> str:
    return (
        "The input speed in SOS is the one whose comb of mesh lines (40, 80, 140, 280 per turn with the paper's teeth) has the most log power "
        "between 0.85 and 1.05 of nominal, Hann window, fourfold zero padding. Order spectra were resampled on the encoder's angle in FOS and on that "
        "input speed in SOS. Mesh lines in FOS would be partial slip."
    )
