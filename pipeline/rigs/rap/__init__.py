"""The wearable ultrafiltration device on its bench: pressures, flow, therapy, cytotoxicity (rap.md)."""

from pipeline.rigs.experiment import Experiment
from pipeline.rigs.rap.cytotoxicity.declaration import CYTOTOXICITY
from pipeline.rigs.rap.flow.declaration import FLOW
from pipeline.rigs.rap.pressures.declaration import PRESSURES
from pipeline.rigs.rap.therapy.declaration import THERAPY

EXPERIMENTS: tuple[Experiment, ...] = (
    PRESSURES,
    FLOW,
    THERAPY,
    CYTOTOXICITY,
)
