"""Which experiments there are: every folder here, and every package that registers itself.

A rig outside this package is announced by an entry point of the group ``rigfit.rigs`` whose name is
the rig and whose value is the module that exports ``EXPERIMENTS``.
"""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points

import pipeline.rigs
from pipeline.errors import InputError, listing, nearest
from pipeline.rigs.experiment import Experiment


@cache
def modules() -> dict[str, str]:
    """Return the module of each rig by the rig's name, without importing any."""
    found = {
        info.name: f"pipeline.rigs.{info.name}" for info in pkgutil.iter_modules(pipeline.rigs.__path__) if info.ispkg
    }
    found.update({entry.name: entry.value for entry in entry_points(group="rigfit.rigs")})
    return dict(sorted(found.items()))


@cache
def experiments(rig: str) -> dict[str, Experiment]:
    """Return the experiments of one rig by id."""
    return {experiment.id: experiment for experiment in import_module(modules()[rig]).EXPERIMENTS}


def all_experiments() -> dict[str, Experiment]:
    """Return every experiment of every rig by id."""
    return {id_: experiment for rig in modules() for id_, experiment in experiments(rig).items()}


def experiment(id_: str) -> Experiment:
    """Return the experiment called `id_`, as ``mre.shear``.

    Raises
    ------
    InputError
        If there is none; names the nearest.
    """
    rig = id_.split(".")[0]
    if rig in modules() and id_ in experiments(rig):
        return experiments(rig)[id_]
    known = all_experiments()
    raise InputError(f"there is no experiment '{id_}'.{nearest(id_, known)} Known experiments: {listing(known)}.")
