"""Intelligent tire: a flex sensor and a PVDF film on the inner liner, on the bench and on the road."""

from pipeline.rigs.experiment import Experiment
from pipeline.rigs.tire.bench.declaration import BENCH
from pipeline.rigs.tire.road.declaration import ROAD

EXPERIMENTS: tuple[Experiment, ...] = (BENCH, ROAD)
