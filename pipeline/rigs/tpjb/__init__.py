"""Large tilting pad journal bearings on a floating-stator rig: clearance, dynamic coefficients, nonlinear orbits."""

from pipeline.rigs.experiment import Experiment
from pipeline.rigs.tpjb.baseline.declaration import BASELINE
from pipeline.rigs.tpjb.bump.declaration import BUMP
from pipeline.rigs.tpjb.dynamic.declaration import DYNAMIC
from pipeline.rigs.tpjb.rotating.declaration import ROTATING

EXPERIMENTS: tuple[Experiment, ...] = (BASELINE, BUMP, DYNAMIC, ROTATING)
