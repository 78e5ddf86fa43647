"""The wearable ultrafiltration device on its bench: pressures, flow, therapy, cytotoxicity (rap.md)."""

from pipeline.rigs.experiment import Experiment

EXPERIMENTS: tuple[Experiment, ...] = ()
