"""Two-stage planetary gearbox whose output stage exchanges itself under load: locked (FOS) or slipping (SOS)."""

from pipeline.rigs.experiment import Experiment

EXPERIMENTS: tuple[Experiment, ...] = ()
