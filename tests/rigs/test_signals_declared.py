"""What experiments declare as signals over time: units that are units, tables and columns that their rig writes."""

from __future__ import annotations

from pathlib import Path

import pytest

import pipeline.rigs
from pipeline.recording.units import conversion
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import all_experiments

DECLARED = [experiment for experiment in all_experiments().values() if experiment.signals]


@pytest.mark.parametrize("experiment", DECLARED, ids=lambda experiment: experiment.id)
def test_signals_have_si_units_and_come_from_a_table_of_the_rig(experiment: Experiment) -> None:
    folder = Path(pipeline.rigs.__file__).parent / experiment.rig
    if not folder.is_dir():
        pytest.skip("a rig of another package")
    written = "".join(path.read_text() for path in folder.rglob("*.py") if path.name != "declaration.py")
    for signals in experiment.signals:
        assert signals.units
        for name, unit in signals.units.items():
            assert conversion(unit, unit, name)(2.0) == 2.0
            assert f'"{name}"' in written or f"{name}=" in written, name
        assert f'"{signals.array}"' in written or f" {signals.array}=" in written
        assert not signals.by or f'"{signals.by}"' in written
