"""The examples in the docstrings of the two floors hold, and importing them is light."""

import doctest
import importlib
import pkgutil
import subprocess
import sys

import pytest

import pipeline.estimation
import pipeline.signals

MODULES = [
    f"{package.__name__}.{module.name}"
    for package in (pipeline.estimation, pipeline.signals)
    for module in pkgutil.iter_modules(package.__path__)
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_hold(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_importing_loads_nothing_heavy():
    heavy = ("scipy", "lmfit", "pandas", "numba", "matplotlib")
    mine = [name for name in MODULES if name.split(".")[-1] not in ("scatter", "separable")]
    code = f"import sys, {', '.join(mine)}; print([m for m in {heavy} if m in sys.modules])"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"
