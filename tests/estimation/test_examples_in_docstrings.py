"""The examples in the docstrings of the two floors hold."""

import doctest
import importlib
import pkgutil

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
