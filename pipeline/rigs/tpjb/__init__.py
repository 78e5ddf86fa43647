"""Large tilting pad journal bearings on a floating-stator rig: clearance, dynamic coefficients, nonlinear orbits."""

from pipeline.rigs.experiment import Experiment

EXPERIMENTS: tuple[Experiment, ...] = ()
