"""What every rig declares: it can be found, and listing it stays light."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from pipeline.recording.units import is_unit
from pipeline.rigs.experiment import Experiment, Later
from pipeline.rigs.registry import all_experiments

EXPERIMENTS = list(all_experiments().values())


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda e: e.id)
def test_functions_named_by_address_exist(experiment: Experiment) -> None:
    named = [value for value in vars(experiment).values() if isinstance(value, Later)]
    assert all(callable(later.function) for later in named)


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda e: e.id)
def test_names_are_declared_once_and_units_are_known(experiment: Experiment) -> None:
    for specs in (experiment.channels, experiment.conditions, experiment.parameters):
        names = [spec.name for spec in specs]
        assert len(names) == len(set(names))
        assert all(spec.description for spec in specs)
        assert all(is_unit(spec.unit) for spec in specs if spec.unit)
    assert experiment.references


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda e: e.id)
def test_a_source_is_a_place_in_the_paper_or_says_that_it_is_none(experiment: Experiment) -> None:
    place = re.compile(r"\beqs?\b|\bFigs?\b|section|Table|\b[Oo]wn\b|in the paper|F = K x|[A-Z]\w+ \d{4}")
    sources = [spec.source for spec in (*experiment.parameters, *experiment.equations) if spec.source]
    assert [source for source in sources if not place.search(source)] == []


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda e: e.id)
def test_what_an_experiment_builds_on_exists(experiment: Experiment) -> None:
    assert set(experiment.builds_on) <= set(all_experiments())


def test_listing_experiments_imports_nothing_heavy() -> None:
    code = (
        "import sys; from pipeline.rigs.registry import all_experiments; all_experiments(); "
        "print([m for m in ('scipy', 'pandas', 'numba', 'lmfit', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
