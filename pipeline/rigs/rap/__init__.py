"""The wearable ultrafiltration device on its bench: pressures, flow, therapy, cytotoxicity (rap.md)."""

from pipeline.rigs.experiment import Experiment
from pipeline.rigs.rap.cytotoxicity.declaration import CYTOTOXICITY

EXPERIMENTS: tuple[Experiment, ...] = (CYTOTOXICITY,)
