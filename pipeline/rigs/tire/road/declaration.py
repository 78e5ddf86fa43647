"""`tire.road`: what the flex sensor tells of a drive: load, force and speed of each revolution, events (tire.md, 5, 10).

Only the declaration stands here; `identify` does the work, so that listing experiments is fast.
"""

from __future__ import annotations

from pydantic import Field

from pipeline.findings.signals import Signals
from pipeline.rigs.experiment import Experiment, Later, ParameterSpec, Reference, Settings
from pipeline.rigs.tire.conditions import CONDITIONS, OPERATING, channels
from pipeline.rigs.tire.references import BREGLIO_2019, FYFE_MUNCK_1997, GONG_1993, KALMAN_1960
from pipeline.rigs.tire.road.equations import EQUATIONS


class RoadSettings(Settings):
    """What a recipe of `tire.road` may set."""

    force_walk: float = Field(
        1000.0, gt=0, description="N s^-1.5, how fast the slope of a force wanders in the Kalman filter (q)"
    )
    rotation_walk: float = Field(
        1.0, gt=0, description="rad s^-2.5, how fast the slope of the rotation wanders in the Kalman filter (q)"
    )
    tune_walk: bool = Field(True, description="whether q of each track is tuned until the mean NIS is 1")
    event_sd: float = Field(4.0, gt=1, description="robust standard deviations from which a deviation is an event")
    longitudinal_sd: float = Field(6.0, gt=1, description="robust standard deviations of Fx that make it longitudinal")
    event_median: float = Field(12.0, gt=0, description="s, running median of the load that events stand out of")


PARAMETERS = (
    ParameterSpec(
        "load_rms_error",
        r"\mathrm{rms}(F_z)",
        "N",
        "filtered load against the reference channel, rms",
        "not in the paper",
        key=True,
    ),
    ParameterSpec(
        "force_rms_error",
        r"\mathrm{rms}(F_x)",
        "N",
        "filtered longitudinal force against the reference channel, rms",
        "not in the paper",
        key=True,
    ),
    ParameterSpec("event_time", "t", "s", "centre of an event", "not in the paper"),
    ParameterSpec(
        "packet_loss", "p", "1", "share of the radio's packets that are missing", "not in the paper", key=True
    ),
)

BAR_SHALOM_2001 = Reference(
    "barshalom2001",
    "Y. Bar-Shalom, X. R. Li and T. Kirubarajan",
    "Estimation with Applications to Tracking and Navigation",
    "Wiley",
    2001,
    note="consistency of a filter: normalised innovation squared (NIS)",
)

ROAD = Experiment(
    id="tire.road",
    title="Intelligent tire on the road: load, force and speed of every revolution",
    summary="Load, longitudinal force and peripheral speed per revolution of a drive, tracked, with events and debonding.",
    references=(BREGLIO_2019, GONG_1993, FYFE_MUNCK_1997, KALMAN_1960, BAR_SHALOM_2001),
    channels=channels(),
    conditions=CONDITIONS,
    parameters=PARAMETERS,
    equations=EQUATIONS,
    settings=RoadSettings,
    identify=Later("pipeline.rigs.tire.road.identify:identify"),
    synthesize=Later("pipeline.rigs.tire.synthetic.rig:synthesize_road"),
    sections=Later("pipeline.rigs.tire.road.sections:sections"),
    methods=Later("pipeline.rigs.tire.road.methods:methods"),
    check=Later("pipeline.rigs.tire.road.check:check"),
    operating=OPERATING,
    builds_on=("tire.bench",),
    reads_blocks=True,
    signals=(
        Signals(
            "revolutions",
            {
                "speed": "m/s",
                "vertical_load": "N",
                "vertical_load_se": "N",
                "longitudinal_force": "N",
                "longitudinal_force_se": "N",
                "speed_filtered": "m/s",
                "vertical_load_filtered": "N",
                "longitudinal_force_filtered": "N",
            },
            "what each revolution tells, and what all up to it tell",
        ),
    ),
)
