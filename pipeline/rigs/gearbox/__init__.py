"""Two-stage planetary gearbox whose output stage exchanges itself under load: locked (FOS) or slipping (SOS)."""

from pipeline.rigs.experiment import Experiment
from pipeline.rigs.gearbox.declaration import LOAD_EXCHANGE

EXPERIMENTS: tuple[Experiment, ...] = (LOAD_EXCHANGE,)
