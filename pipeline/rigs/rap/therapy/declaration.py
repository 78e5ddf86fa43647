"""`rap.therapy`: what a therapy run of the wearable ultrafiltration device tells (rap.md, sections 2, 10, 11).

Temperature, ultrafiltrate, membrane, battery, alarms, redundancy. Only the declaration stands here; `identify` does the
work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import ConditionSpec, Experiment, Later, ParameterSpec, Settings
from pipeline.rigs.rap.alarms.limits import AlarmLimits, MismatchLimits
from pipeline.rigs.rap.conditions import CONDITIONS, channels
from pipeline.rigs.rap.references import KALMAN_1960, KNAPP_CARTER_1976, PAGE_1954, RAP_2019
from pipeline.rigs.rap.therapy.equations import EQUATIONS


class TherapySettings(Settings):
    """What a recipe of `rap.therapy` may set."""

    temperature_tolerance: float = Field(
        0.05, gt=0, lt=1, description="largest temperature error allowed, as a share of the bench's reading in degC"
    )
    volume_tolerance: float = Field(
        0.02, gt=0, lt=1, description="largest final error of the ultrafiltrate volume, as a share of what was removed"
    )
    rate_tolerance: float = Field(
        0.05, gt=0, lt=1, description="difference of set and weighed ultrafiltration rate beyond which it is told"
    )
    therapy_duration: float = Field(18000.0, gt=0, description="duration the battery has to last, s")
    alarm_high: float = Field(1.6, gt=1, le=20, description="resistance over its baseline above which an alarm is due")
    alarm_low: float = Field(0.5, gt=0, lt=1, description="resistance over its baseline below which an alarm is due")
    alarm_hold: float = Field(1.0, ge=0, le=60, description="time for which it must stay there, s")
    alarm_blanking: float = Field(3.0, ge=0, le=60, description="time after a pump start without alarms of pressure, s")
    alarm_late: float = Field(10.0, gt=0, le=600, description="delay of a logged code beyond which it is late, s")
    stagnation_limit: float = Field(120.0, gt=0, le=3600, description="longest standstill of the blood, s")
    pressure_limit: float = Field(40e3, gt=0, le=2e5, description="magnitude at which a pressure is out of range, Pa")
    mismatch_threshold: float = Field(
        300.0, gt=0, le=1e5, description="difference of the two units that is a mismatch, Pa"
    )
    mismatch_samples: int = Field(3, ge=1, le=1000, description="samples in a row that make a mismatch")
    cusum_allowance: float = Field(20.0, gt=0, le=1e4, description="allowance of the cumulative sum, Pa")
    cusum_limit: float = Field(80.0, gt=0, le=1e5, description="cumulative sum at which it is a mismatch, Pa")

    @property
    def alarms(self) -> AlarmLimits:
        """When a cause is an alarm."""
        return AlarmLimits(
            self.alarm_high, self.alarm_low, self.alarm_hold, self.alarm_blanking, self.stagnation_limit, self.alarm_late,
            self.pressure_limit,
        )  # fmt: skip

    @property
    def mismatches(self) -> MismatchLimits:
        """When the two units disagree."""
        return MismatchLimits(self.mismatch_threshold, self.mismatch_samples, self.cusum_allowance, self.cusum_limit)


OPERATING = (
    ConditionSpec("source", "", "rap or bench: the device's sensor or the bench's"),
    ConditionSpec("alarm", "", "code of the alarm"),
    ConditionSpec("channel", "", "access, prefilter, return or uf"),
    ConditionSpec("index", "1", "number of the event within its run, from 1"),
)

PARAMETERS = (
    ParameterSpec("uf_volume_final", "V_{end}", "m^3", "ultrafiltrate in the tank at the end", "own eqs (8), (9)", key=True),
    ParameterSpec(
        "uf_volume_error_rms", r"e_{V,rms}", "m^3", "estimated less weighed volume after the first echo, root mean square",
        "own eqs (8), (9)", key=True,
    ),
    ParameterSpec(
        "uf_pump_gain", "s", "1", "delivered over commanded ultrafiltration, mean over the valid part", "own eq. (9)", key=True
    ),
    ParameterSpec("k_uf_initial", "K_0", "m^3/(s Pa)", "hydraulic coefficient of the membrane at the start", "not in the paper", key=True),
    ParameterSpec("k_uf_decline", "a", "1", "decline: K = K_0/(1 + a t/5 h)", "not in the paper", key=True),
    ParameterSpec("energy_used", "E", "J", "electric energy used in the run", "not in the paper", key=True),
    ParameterSpec("runtime_projected", r"t_{run}", "s", "time that the full battery lasts at the mean power", "not in the paper", key=True),
    ParameterSpec("alarm_count", r"n_{alarm}", "1", "alarms that were due by the log, all codes together", "not in the paper", key=True),
    ParameterSpec(
        "temperature_error_max", r"|\Delta T|_{max}", "K", "largest difference of the device's temperature to the bench's",
        "not in the paper", key=True,
    ),
    ParameterSpec("temperature_initial", "T_0", "K", "air in the housing at the start", "own eq. (7)"),
    ParameterSpec("temperature_final", r"T_\infty", "K", "air in the housing in the end state", "own eq. (7)"),
    ParameterSpec("time_constant", r"\tau", "s", "time constant of the housing's warming", "own eq. (7)"),
    ParameterSpec("alarm_time", "t_{alarm}", "s", "onset of an alarm re-derived from the log, device's clock", "not in the paper"),
    ParameterSpec("mismatch_time", "t_{mis}", "s", "onset of a mismatch of the two units, device's clock", "not in the paper"),
)  # fmt: skip

THERAPY = Experiment(
    id="rap.therapy",
    title="Therapy runs of a wearable ultrafiltration device",
    summary="Temperature, ultrafiltrate volume, membrane, battery, alarms and redundancy of a wearable device at its bench.",
    references=(RAP_2019, KALMAN_1960, PAGE_1954, KNAPP_CARTER_1976),
    channels=channels(),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=TherapySettings,
    identify=Later("pipeline.rigs.rap.therapy.identify:identify"),
    synthesize=Later("pipeline.rigs.rap.synthetic.rig:synthesize_therapy"),
    sections=Later("pipeline.rigs.rap.therapy.outcome.sections:sections"),
    methods=Later("pipeline.rigs.rap.therapy.outcome.methods:methods"),
    check=Later("pipeline.rigs.rap.therapy.check:check"),
    operating=OPERATING,
    signals=(
        Signals("temperature", {"value": "K", "model": "K"}, "fluid temperature and the fitted one", by="source"),
        Signals(
            "volume",
            {"set": "m^3", "estimate": "m^3", "sd": "m^3", "device": "m^3"},
            "volume removed: as set, as estimated, as the device counts it",
        ),
    ),
)
