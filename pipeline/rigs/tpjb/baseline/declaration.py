"""`tpjb.baseline`: mass and parallel stiffness of the stator, hung free of the bearing (tpjb.md T0).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.rigs.experiment import Experiment, Later, ParameterSpec, Settings
from pipeline.rigs.tpjb.baseline.equations import EQUATIONS
from pipeline.rigs.tpjb.rig import CIULLI_FORTE_2019, CONDITIONS, OPERATING, channels


class BaselineSettings(Settings):
    """What a recipe of `tpjb.baseline` may set."""

    least_snr: float = Field(10.0, gt=0, description="amplitude over its error below which a tone is dropped")


PARAMETERS = (
    ParameterSpec("stator_mass", "m_s", "kg", "mass of the floating stator", "not in the paper", key=True),
    ParameterSpec(
        "stabilizer_stiffness",
        "k_s",
        "N/m",
        "stiffness of stabilisers and hoses to ground",
        "not in the paper",
        key=True,
    ),
)


BASELINE = Experiment(
    id="tpjb.baseline",
    title="Stator mass and stabiliser stiffness",
    summary="Mass and parallel stiffness of the floating stator from tones without contact in the bearing.",
    references=(CIULLI_FORTE_2019,),
    channels=channels("force_u", "force_v"),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=BaselineSettings,
    identify=Later("pipeline.rigs.tpjb.baseline.identify:identify"),
    synthesize=Later("pipeline.rigs.tpjb.baseline.synthetic:synthesize"),
    sections=Later("pipeline.rigs.tpjb.baseline.sections:sections"),
    methods=Later("pipeline.rigs.tpjb.baseline.methods:methods"),
    operating=OPERATING,
)
