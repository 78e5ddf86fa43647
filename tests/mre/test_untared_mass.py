"""A mass that was not tared against a gain that scatters: what is believed, and that no wrong number is held for good."""

from __future__ import annotations

import pytest
from loops_of_truth import measured, noisy

from pipeline.rigs.mre.model.harmonic_fit import FitOptions, identify_loops
from pipeline.rigs.mre.shear.untared_mass import MassDecision, weigh_mass
from pipeline.rigs.mre.synthetic import ShearRun

SEEDS = range(2)


def decided(truth: dict[str, float], seed: int, mass: float, options: FitOptions | None = None) -> MassDecision:
    options = options or FitOptions(starts=1)
    loops = noisy(truth, seed, mass)
    return weigh_mass(identify_loops(loops, options), loops, options)


def z_of_k2(decision: MassDecision) -> float:
    k2 = decision.found.selected.one("k2")
    assert k2.value is not None
    assert k2.std_error is not None
    return abs(k2.value - 2.6e5) / k2.std_error


@pytest.mark.parametrize("mass", [0.08])
def test_a_mass_is_not_mistaken_for_scatter(mass: float) -> None:
    for seed in SEEDS:
        decision = decided({}, seed, mass)
        found = decision.found.selected.one("moving_mass")
        assert decision.mass is not None, f"seed {seed}"
        assert found.value == pytest.approx(mass, abs=5 * (found.std_error or 0.0))
        assert z_of_k2(decision) < 4
        assert not decision.doubt


@pytest.mark.parametrize("scatter", [0.0, 0.004])
@pytest.mark.thorough
def test_scatter_is_not_mistaken_for_a_mass(scatter: float) -> None:
    decisions = [decided({"gain_scatter": scatter}, seed, 0.0) for seed in SEEDS]
    assert all(decision.mass is None for decision in decisions)
    assert sum(bool(decision.doubt) for decision in decisions) <= 1


@pytest.mark.thorough
def test_a_mass_beside_scatter_is_found_or_its_doubt_told() -> None:
    for seed in SEEDS:
        decision = decided({"gain_scatter": 0.004}, seed, 0.6)
        assert decision.mass is not None or decision.doubt or z_of_k2(decision) < 3, f"seed {seed}"


def test_a_mass_that_was_weighed_is_not_looked_for() -> None:
    options = FitOptions(starts=1, moving_mass=0.15, mass_known=True)
    decision = decided({}, 0, 0.15, options)
    assert decision.mass is None
    assert not decision.doubt
    assert z_of_k2(decision) < 4


def test_a_mass_too_small_to_be_seen_does_no_harm() -> None:
    for seed in SEEDS:
        decision = decided({}, seed, 0.02)
        assert decision.mass is not None or decision.doubt or z_of_k2(decision) < 3.5, f"seed {seed}"


def test_a_mass_is_not_claimed_where_no_current_has_two_frequencies() -> None:
    runs = [ShearRun("a", "shear", 5.3, 6e-4, 2.0), ShearRun("b", "shear", 10.6, 4e-4, 6.0)] * 2
    for seed in SEEDS:
        loops = measured(runs, {"gain_scatter": 0.004}, seed)
        options = FitOptions(starts=1)
        assert weigh_mass(identify_loops(loops, options), loops, options).mass is None
