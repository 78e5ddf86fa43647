"""`mre.step`: how the axial force follows a step of the coil current at a fixed gap (mre.md T3).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import ChannelSpec, ConditionSpec, Experiment, Later, ParameterSpec, Range, Settings
from pipeline.rigs.mre.conditions import PRELOAD, SAMPLE
from pipeline.rigs.mre.references import BRANCATI_2019, GOLUB_PEREYRA_1973, KAUFMAN_1975, SCHWARZ_1978
from pipeline.rigs.mre.step.equations import EQUATIONS

LAG = Range(-0.1, 0.1)


class StepSettings(Settings):
    """What a recipe of `mre.step` may set."""

    gap_limit: float = Field(1.2e-5, gt=0, description="m, motion of the gap that is warned of; 1.2e-5 is 12 µm")
    settled: float = Field(
        5.0, gt=0, le=20, description="time constants that a level must be held for the end level to be seen"
    )


CHANNELS = (
    ChannelSpec("current", "A", "measured coil current, not the set-point", limit=100.0),
    ChannelSpec("force_axial", "N", "axial force on the pad, + in compression", limit=1e5),
    ChannelSpec(
        "displacement_axial", "m", "compression of the pad (gap), + in compression", required=False, limit=0.02
    ),
    ChannelSpec("flux_density", "T", "flux density between pad and plate", required=False, limit=3.0),
    ChannelSpec("voltage", "V", "coil voltage", required=False, limit=1000.0),
    ChannelSpec("temperature", "K", "pad or core temperature", required=False, limit=500.0),
)
CONDITIONS = (
    ConditionSpec("test", "", "step"),
    PRELOAD,
    ConditionSpec("gap_held", "", "true where the gap is held and not the axial load"),
    ConditionSpec("n_pads", "1", "pads in parallel", range=Range(1, 100, whole=True)),
    ConditionSpec("force_lag", "s", "how late the force is against the current, where it was calibrated", range=LAG),
    ConditionSpec(
        "force_filter",
        "Hz",
        "corner of a first-order low-pass in the force channel that the current channel has not",
        range=Range(0, 1e6, above=True),
    ),
    *SAMPLE,
)
PARAMETERS = (
    ParameterSpec("delay", "L", "s", "dead time between measured current and force", "not in the paper", key=True),
    ParameterSpec("time_constant_1", r"\tau_1", "s", "larger time constant of the force", "not in the paper", key=True),
    ParameterSpec(
        "time_constant_2", r"\tau_2", "s", "smaller time constant of the force", "not in the paper", key=True
    ),
    ParameterSpec(
        "t63",
        "t_{63}",
        "s",
        "from the onset of the current to 63.2 % of the change of the force",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "t90",
        "t_{90}",
        "s",
        "from the onset of the current to 90 % of the change of the force",
        "not in the paper",
        key=True,
    ),
    ParameterSpec("creep", "c", "N", "force lost in each decade of 1 s + t", "not in the paper"),
    ParameterSpec("force_step", r"\Delta F", "N", "change of the force by a step, creep taken out", "not in the paper"),
)

STEP = Experiment(
    id="mre.step",
    title="Response of magneto-rheological pads to steps of the coil current",
    summary="Delay, time constants and rise times of the axial force at a fixed gap, on and off, from the measured current.",
    references=(BRANCATI_2019, GOLUB_PEREYRA_1973, KAUFMAN_1975, SCHWARZ_1978),
    channels=CHANNELS,
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=StepSettings,
    identify=Later("pipeline.rigs.mre.step.identify:identify"),
    synthesize=Later("pipeline.rigs.mre.step.synthetic:synthesize"),
    sections=Later("pipeline.rigs.mre.step.sections:sections"),
    methods=Later("pipeline.rigs.mre.step.methods:methods"),
    check=Later("pipeline.rigs.mre.step.check:check"),
    operating=(ConditionSpec("direction", "", "rise or fall of the current"),),
    signals=(
        Signals(
            "series",
            {"current": "A", "force": "N", "model": "N", "residual": "N"},
            "the record and the fitted response",
        ),
    ),
)
