"""Large tilting pad journal bearings on a floating-stator rig: clearance, dynamic coefficients, nonlinear orbits."""

from pipeline.rigs.experiment import Experiment
from pipeline.rigs.tpjb.bump.declaration import BUMP

EXPERIMENTS: tuple[Experiment, ...] = (BUMP,)
