"""The two one-sided tests against closed forms, the fact sheet's power table, and simulated campaigns."""

import numpy as np
import pytest
from scipy import stats

from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.cytotoxicity.declaration import CYTOTOXICITY, CytotoxicitySettings
from pipeline.rigs.rap.cytotoxicity.equivalence import Cell, differences, pooled, slope_of, verdict_of
from pipeline.rigs.rap.cytotoxicity.power import cultures_needed, power
from pipeline.rigs.rap.cytotoxicity.samples import samples_of


def _cells(rng, k, n, sd, shift=0.0):
    return [Cell.of(0.92 + shift + sd * rng.standard_normal(n)) for _ in range(k)]


def test_one_time_is_students_two_sample_test():
    rng = np.random.default_rng(1)
    a, b = 0.90 + 0.03 * rng.standard_normal(5), 0.93 + 0.03 * rng.standard_normal(4)
    found = differences([Cell.of(a)], [Cell.of(b)], 0.1)
    theirs = stats.ttest_ind(a, b)
    interval, narrow = theirs.confidence_interval(0.95), theirs.confidence_interval(0.90)
    assert found.dof == 7
    assert (found.low95[0], found.high95[0]) == pytest.approx((interval.low, interval.high))
    assert (found.low90[0], found.high90[0]) == pytest.approx((narrow.low, narrow.high))
    lower = stats.ttest_ind(a + 0.1, b, alternative="greater").pvalue
    upper = stats.ttest_ind(a - 0.1, b, alternative="less").pvalue
    assert found.p[0] == pytest.approx(max(lower, upper))


def test_variance_is_that_of_the_analysis_of_variance():
    rng = np.random.default_rng(2)
    groups = [rng.standard_normal(n) + i for i, n in enumerate((3, 4, 6))]
    deviation, dof = pooled([Cell.of(group) for group in groups])
    total = np.concatenate(groups)
    within = np.sum((total - total.mean()) ** 2) - sum(g.size * (g.mean() - total.mean()) ** 2 for g in groups)
    assert dof == 10
    assert deviation**2 == pytest.approx(within / 10)


def test_a_shared_control_counts_once():
    rng = np.random.default_rng(3)
    treated, control = _cells(rng, 5, 4, 0.03), _cells(rng, 1, 4, 0.03)[0]
    assert differences(treated, [control] * 5, 0.1).dof == 6 * 3


def test_interval_within_the_margin_and_both_tests_below_5_percent_are_the_same():
    rng = np.random.default_rng(4)
    for _ in range(200):
        control = _cells(rng, 1, 4, 0.04)[0]
        found = differences(_cells(rng, 5, 4, 0.04, -0.03), [control] * 5, 0.1)
        assert np.array_equal((found.low90 > -0.1) & (found.high90 < 0.1), found.p < 0.05)


# rap.md, section 6: pooled test, all five times, margin 10 points.
@pytest.mark.parametrize(
    ("n", "sd", "published"),
    [
        (3, 2, 1.00),
        (3, 3, 0.90),
        (3, 4, 0.44),
        (4, 2, 1.00),
        (4, 3, 0.99),
        (4, 4, 0.73),
        (6, 2, 1.00),
        (6, 3, 1.00),
        (6, 4, 0.96),
    ],
)
def test_power_is_that_of_the_fact_sheet(n, sd, published):
    assert power(sd / 100.0, n, 0.10) == pytest.approx(published, abs=0.02)


def test_a_loss_as_large_as_the_margin_is_claimed_equivalent_in_no_more_than_1_of_20_trials():
    assert power(0.03, 4, 0.10, true=[-0.10, 0, 0, 0, 0], trials=40_000, seed=1) <= 0.054
    assert power(0.03, 4, 0.10, true=[-0.10] * 5, trials=40_000, seed=2) <= 0.054


def test_the_claim_itself_keeps_its_level_on_counted_cells():
    rng, claims = np.random.default_rng(5), 0
    for _ in range(4000):
        treated = _cells(rng, 4, 4, 0.03) + _cells(rng, 1, 4, 0.03, -0.10)
        control = _cells(rng, 1, 4, 0.03)[0]
        claims += verdict_of(differences(treated, [control] * 5, 0.10), 0.10) == "equivalence"
    assert claims / 4000 <= 0.054


def test_no_difference_is_called_different_in_no_more_than_1_of_20_trials_where_all_lie_on_the_margin():
    rng, called = np.random.default_rng(6), 0
    for _ in range(2000):
        control = _cells(rng, 1, 4, 0.03)[0]
        found = differences(_cells(rng, 5, 4, 0.03, -0.10), [control] * 5, 0.10)
        called += verdict_of(found, 0.10) == "different"
    assert called / 2000 <= 0.054


def test_intervals_of_95_percent_cover_the_true_loss():
    truth = {"loss": 0.06, "scatter": 0.025}
    # The synthetic cells lose viability in proportion to time.
    true = -0.06 * np.array(CytotoxicitySettings().times) / 21600.0
    inside = np.zeros(5)
    for seed in range(400):
        samples = samples_of(CYTOTOXICITY.synthesize(truth, seed)[0], CytotoxicitySettings())
        column, time = samples.values["viability"], np.round(samples.time)
        treated = [Cell.of(column[samples.treated & (time == t)]) for t in CytotoxicitySettings().times]
        control = Cell.of(column[~samples.treated])
        found = differences(treated, [control] * 5, 0.1)
        inside += (found.low95 <= true) & (true <= found.high95)
    assert 0.93 <= inside.sum() / 2000 <= 0.97


def test_a_slope_is_found_and_none_is_not():
    rng = np.random.default_rng(7)
    times = np.array(CytotoxicitySettings().times)
    control = _cells(rng, 1, 6, 0.02)[0]
    falling = [Cell.of(0.92 - 4e-6 * t + 0.02 * rng.standard_normal(6)) for t in times]
    found = slope_of(times, falling, [control] * 5, differences(falling, [control] * 5, 0.1))
    assert found is not None
    assert found.ci95[0] < -4e-6 < found.ci95[1] < 0.0
    assert found.p < 0.05
    p = []
    for _ in range(500):
        flat, own = _cells(rng, 5, 4, 0.02), _cells(rng, 5, 4, 0.02)
        slope = slope_of(times, flat, own, differences(flat, own, 0.1))
        assert slope is not None
        p.append(slope.p)
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.03)


def test_more_scatter_needs_more_cultures():
    needed = [cultures_needed(sd, 0.10) for sd in (0.02, 0.03, 0.04)]
    assert needed == sorted(needed)
    assert needed[1] in (3, 4)  # 0.90 at three cultures
    assert cultures_needed(0.3, 0.05) is None


@pytest.mark.parametrize(
    ("truth", "verdict"),
    [
        ({"scatter": 0.015}, "equivalence"),
        ({"scatter": 0.09, "replicates": 3}, "inconclusive"),
        ({"loss": 0.35}, "different"),
    ],
)
def test_verdict_on_viability(truth, verdict):
    findings = CYTOTOXICITY.identify(CYTOTOXICITY.synthesize(truth, 3), CytotoxicitySettings(), Context("c", {}))
    outcomes = findings.arrays["outcomes"].set_index("outcome")
    assert outcomes.loc["viability", "verdict"] == verdict
    assert (findings.verdict == "ok") == (verdict == "equivalence")
    assert all(p.description.endswith(verdict) for p in findings.find("viability_difference"))
    assert {p.at["time"] for p in findings.find("viability_difference")} == {0.0, 1800.0, 3600.0, 10800.0, 21600.0}
