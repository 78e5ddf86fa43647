"""`rap.cytotoxicity`: are cells as well in the circulated fluid as in a control (rap.md, T9, 3.12, 10)?

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.rigs.experiment import ChannelSpec, ConditionSpec, Experiment, Later, ParameterSpec, Range, Settings
from pipeline.rigs.rap.cytotoxicity.equations import EQUATIONS
from pipeline.rigs.rap.references import RAP_2019, SCHUIRMANN_1987

OUTCOMES = ("viability", "necrosis", "apoptosis")
TIMES = (0.0, 1800.0, 3600.0, 10800.0, 21600.0)


class CytotoxicitySettings(Settings):
    """What a recipe of `rap.cytotoxicity` may set."""

    margin_viability: float = Field(
        0.10, gt=0, le=0.5, description="difference of viability to the control that does not matter, as a share"
    )
    margin_necrosis: float = Field(
        0.05, gt=0, le=0.5, description="difference of necrosis to the control that does not matter, as a share"
    )
    margin_apoptosis: float = Field(
        0.05, gt=0, le=0.5, description="difference of apoptosis to the control that does not matter, as a share"
    )
    times: tuple[float, ...] = Field(
        TIMES,
        min_length=1,
        description="times at which samples are due, s; equivalence is claimed only if all of them pass",
    )
    control_group: str = Field("", description="word of the group that is the control, where it is not 'control'")
    treated_group: str = Field("", description="word of the group to compare with it, where there are several")

    def margin(self, outcome: str) -> float:
        """Return the margin of one of `OUTCOMES`, as a share."""
        return float(getattr(self, f"margin_{outcome}"))


CHANNELS = (
    ChannelSpec("group", "", "control or treated (fluid that went round the device)", required=False, lists_entries=True),
    ChannelSpec("viability", "1", "share of cells that live", limit=1.5, lists_entries=True, required=False),
    ChannelSpec("necrosis", "1", "share of cells that are necrotic", limit=1.5, required=False),
    ChannelSpec("apoptosis", "1", "share of cells that are apoptotic", limit=1.5, required=False),
    ChannelSpec("replicate", "", "name or number of the culture; rows of one culture are repeats of one measurement", required=False),
    ChannelSpec("n", "1", "cultures that the row stands for, where it is a mean", required=False),
    *(ChannelSpec(f"{name}_sd", "1", f"standard deviation of {name} between the cultures of the row", limit=1.5, required=False) for name in OUTCOMES),
)  # fmt: skip

CONDITIONS = (
    ConditionSpec("group", "", "control or treated, where a log holds one group only"),
    ConditionSpec("fluid", "", "saline, medium or blood", default="medium"),
    ConditionSpec("blood_flow", "m^3/s", "flow at which the fluid went round", range=Range(0.0, 2e-5, above=True)),
    ConditionSpec("fluid_volume", "m^3", "volume that went round", range=Range(0.0, 0.1, above=True)),
    ConditionSpec("tube_set_id", "", "tube set"),
    ConditionSpec("filter_id", "", "haemofilter"),
    ConditionSpec("remark", "", "free text"),
)

OPERATING = (ConditionSpec("time", "s", "how long the fluid had gone round when the sample was drawn", read_as="min"),)

_TEXT = "to the control, at one time; the 90 % interval of the equivalence test stands in the description"
PARAMETERS = (
    ParameterSpec(
        "viability_difference",
        r"d_{via}",
        "1",
        f"difference of viability {_TEXT}",
        "not in the paper",
        key=True,
        read_as="%",
    ),
    ParameterSpec(
        "necrosis_difference", r"d_{nec}", "1", f"difference of necrosis {_TEXT}", "not in the paper", read_as="%"
    ),
    ParameterSpec(
        "apoptosis_difference", r"d_{apo}", "1", f"difference of apoptosis {_TEXT}", "not in the paper", read_as="%"
    ),
)

CYTOTOXICITY = Experiment(
    id="rap.cytotoxicity",
    title="Cytotoxicity of a wearable ultrafiltration device",
    summary="Equivalence of cells kept in circulated fluid to a control: viability, necrosis, apoptosis over time.",
    references=(RAP_2019, SCHUIRMANN_1987),
    channels=CHANNELS,
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=CytotoxicitySettings,
    identify=Later("pipeline.rigs.rap.cytotoxicity.identify:identify"),
    synthesize=Later("pipeline.rigs.rap.synthetic.rig:synthesize_cytotoxicity"),
    sections=Later("pipeline.rigs.rap.cytotoxicity.sections:sections"),
    methods=Later("pipeline.rigs.rap.cytotoxicity.methods:methods"),
    check=Later("pipeline.rigs.rap.cytotoxicity.check:check"),
    operating=OPERATING,
)
