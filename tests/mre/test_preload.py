from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from loops_of_truth import logged

from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, identify_loops
from pipeline.rigs.mre.model.loop import Loop
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics
from pipeline.rigs.mre.shear.preload import PreloadTable, preload_table, split_by_preload
from pipeline.rigs.mre.synthetic import ShearRun, amplitude_for_force, shear_truth, true_loop

STATES = [(200.0, 0.0), (200.0, 6.0), (700.0, 0.0), (700.0, 6.0)]


@cache
def fitted(scatter: float) -> tuple[DynamicFit, list[Loop], PreloadTable]:
    loops = logged(1, scatter, True)
    core, _ = split_by_preload(loops)
    fit = identify_loops(core, FitOptions(variants=("ks",))).selected
    preload = [loop for loop in loops if loop.run.startswith("pre")]
    return fit, preload, preload_table(fit, preload)


def test_truth_gives_the_published_stiffnesses_at_equal_force() -> None:
    truth = shear_truth({"second_harmonic": 0.0, "third_harmonic": 0.0})
    for (preload, current), stiffness, amplitude in zip(
        STATES, (329.6, 599.7, 499.3, 699.4), (0.6069, 0.3335, 0.4006, 0.2860), strict=True
    ):
        X = amplitude_for_force(truth, 200.0, 2.0, current, preload)
        assert pytest.approx(amplitude, abs=5e-4) == X * 1e3
        loop = true_loop(truth, ShearRun("r", "preload", 2.0, X, current, preload))
        assert loop_metrics(loop)[0].value / 1e3 == pytest.approx(stiffness, abs=0.15)


def test_largest_preload_group_is_taken_by_the_dynamic_fit() -> None:
    core, others = split_by_preload(logged(1, 0.0, True))
    assert len(core) == 14
    assert {loop.run for loop in others} == {"pre_3", "pre_4"}


def test_measured_stiffness_at_every_preload_and_current() -> None:
    _, _, table = fitted(0.0)
    for state, stiffness in zip(table.states, (329.6, 599.7, 499.3, 699.4), strict=True):
        assert state.secant.value / 1e3 == pytest.approx(stiffness, rel=0.003)
        assert state.force_amplitude == pytest.approx(200, abs=0.5)


def test_static_stiffness_of_each_preload() -> None:
    _, _, table = fitted(0.0)
    truth = shear_truth({})
    for state in table.states:
        expected = truth.k2_at(state.preload) + truth.k_mr_at(state.current, state.preload)
        assert state.static.value == pytest.approx(expected, rel=0.002)
        assert state.static.std_error < 0.001 * expected


def test_effect_at_equal_force_and_at_equal_amplitude() -> None:
    _, _, table = fitted(0.0)
    effect = {(e.name, e.at["preload"]): e for e in table.effects}
    assert effect["mr_effect_force", 200.0].value == pytest.approx(0.820, abs=0.004)
    assert effect["mr_effect_force", 700.0].value == pytest.approx(0.401, abs=0.004)
    assert effect["mr_effect_amplitude", 200.0].value == pytest.approx(0.687, abs=0.004)
    assert effect["mr_effect_amplitude", 700.0].value == pytest.approx(0.352, abs=0.004)
    assert all(e.at["coil_current"] == 6.0 for e in table.effects)


@pytest.mark.thorough
def test_gain_scatter_is_in_the_intervals() -> None:
    _, _, table = fitted(0.004)
    truth = {200.0: (0.820, 0.687), 700.0: (0.401, 0.352)}
    for e in table.effects:
        expected = truth[e.at["preload"]][e.name == "mr_effect_amplitude"]
        assert e.ci95[0] < expected < e.ci95[1]
        assert e.std_error > 0.004


def test_without_a_model_the_effect_at_equal_force_remains() -> None:
    _, preload, _ = fitted(0.0)
    effects = {e.name: e for e in preload_table(None, preload).effects if e.at["preload"] == 200.0}
    assert effects["mr_effect_force"].value == pytest.approx(0.82, abs=0.01)
    assert effects["mr_effect_amplitude"].value is None
    assert "model" in effects["mr_effect_amplitude"].reason


def test_unequal_forces_are_not_called_equal() -> None:
    fit, preload, _ = fitted(0.0)
    others = [loop for loop in logged(1, 0.0, True) if loop.run in ("sh_5hz_0a", "sh_5hz_6a")]
    assert len(preload) == 4
    effects = {e.name: e for e in preload_table(fit, others).effects}
    assert np.all([loop.preload == 200.0 for loop in others])
    assert effects["mr_effect_force"].value is None
    assert "force amplitudes differ" in effects["mr_effect_force"].reason
