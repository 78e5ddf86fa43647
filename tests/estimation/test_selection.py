import math

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.estimation.selection import Candidate, leave_one_group_out, rank


def selected(candidates, **options):
    return next(entry.candidate.name for entry in rank(candidates, **options) if entry.selected)


def test_criteria_are_the_textbook_formulae():
    model = Candidate("m", chi2=12.0, n_data=30, n_parameters=3)
    assert model.bic == pytest.approx(30 * math.log(12 / 30) + 3 * math.log(30))
    assert model.aicc == pytest.approx(30 * math.log(12 / 30) + 2 * 4 + 2 * 4 * 5 / (30 - 5))
    known = Candidate("m", 12.0, 30, 3, sigma_known=True, log_determinant=1.5)
    assert known.bic == pytest.approx(13.5 + 3 * math.log(30))
    assert known.aicc == pytest.approx(13.5 + 6 + 24 / 26)


def test_a_richer_model_must_earn_its_parameters():
    line, parabola = Candidate("line", 100.0, 100, 2), Candidate("parabola", 95.0, 100, 3)
    assert parabola.bic - line.bic == pytest.approx(100 * math.log(0.95) + math.log(100))
    assert selected([line, parabola]) == "line"
    slightly = Candidate("parabola", 94.5, 100, 3)
    assert -2 < slightly.bic - line.bic < 0
    assert selected([line, slightly]) == "line"  # better by less than the margin
    assert selected([line, slightly], margin=0.0) == "parabola"
    assert selected([line, Candidate("parabola", 80.0, 100, 3)]) == "parabola"


def test_weights_sum_to_one_and_follow_the_differences():
    ranked = rank([Candidate("a", 100.0, 50, 2), Candidate("b", 90.0, 50, 3), Candidate("c", 300.0, 50, 1)])
    assert sum(entry.weight for entry in ranked) == pytest.approx(1.0)
    by_name = {entry.candidate.name: entry for entry in ranked}
    assert by_name["a"].weight / by_name["b"].weight == pytest.approx(
        math.exp(-0.5 * (by_name["a"].delta_aicc - by_name["b"].delta_aicc))
    )


def test_too_few_data_for_the_correction_are_no_crash():
    ranked = rank([Candidate("a", 1.0, 4, 2), Candidate("b", 0.5, 4, 3)])
    assert math.isfinite(ranked[0].delta_bic)


def test_candidates_of_different_data_are_refused():
    with pytest.raises(ValueError, match="same data"):
        rank([Candidate("a", 1.0, 10, 2), Candidate("b", 1.0, 11, 2)])
    with pytest.raises(ValueError, match="same data"):
        rank([])


def test_the_true_order_of_a_polynomial_is_selected():
    rng = np.random.default_rng(0)
    x = np.linspace(-1, 1, 60)
    chosen = []
    for _ in range(100):
        y = 1 + x - 0.8 * x**2 + 0.1 * rng.normal(size=x.size)
        fits = [np.polynomial.Polynomial.fit(x, y, d) for d in range(6)]
        candidates = [Candidate(str(d), float(((y - p(x)) ** 2).sum()), x.size, d + 1) for d, p in enumerate(fits)]
        chosen.append(selected(candidates))
    assert chosen.count("2") >= 95


def runs(rng, count=6, curvature=0.0):
    x = np.linspace(0, 1, 20)
    return {f"r{i}": (x, 1 + x + curvature * x**2 + 0.05 * rng.normal(size=x.size)) for i in range(count)}


def test_prediction_of_left_out_runs_is_at_the_noise_and_worse_for_the_wrong_model():
    data = runs(np.random.default_rng(1), curvature=1.0)

    def error(degree):
        def refit(kept):
            return np.polyfit(
                np.concatenate([data[r][0] for r in kept]), np.concatenate([data[r][1] for r in kept]), degree
            )

        return leave_one_group_out(list(data), refit, lambda p, r: (data[r][1], np.polyval(p, data[r][0])))

    noise = np.sqrt(np.mean([(y - 1 - x - x**2) ** 2 for x, y in data.values()]))
    signal = np.sqrt(np.mean([np.var(y) for _, y in data.values()]))
    assert error(2).nrmse == pytest.approx(noise / signal, rel=0.05)
    assert error(1).nrmse > 1.5 * error(2).nrmse
    assert set(error(1).by_group) == set(data)


def test_a_group_whose_refit_fails_is_named():
    data = runs(np.random.default_rng(2), 3)

    def refit(kept):
        if "r1" not in kept:
            raise InputError("r1 is needed")
        return np.array([1.0, 1.0])

    found = leave_one_group_out(list(data), refit, lambda p, r: (data[r][1], np.polyval(p, data[r][0])))
    assert found.failed == ("r1",)
    assert set(found.by_group) == {"r0", "r2"}
    with pytest.raises(ValueError, match="two groups"):
        leave_one_group_out(["r0"], refit, lambda p, r: (data[r][1], data[r][1]))
