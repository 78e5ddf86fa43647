"""H from amplitudes: exact without noise, honest with it, and wrong by known amounts when done wrongly."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.rigs.tpjb import truth
from pipeline.rigs.tpjb.axes import FROM_UV
from pipeline.rigs.tpjb.dynamic import laws
from pipeline.rigs.tpjb.dynamic.bench import Bench
from pipeline.rigs.tpjb.dynamic.impedance import bearing_force, ratio_of_means

TONES = np.array([7.0, 11.0, 13.0, 19.0, 23.0, 29.0, 37.0, 43.0])
W = 2 * np.pi * TONES
BENCH = Bench()


def amplitudes(name: str) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray], np.ndarray]:
    """Force, displacement, acceleration, (k, 2) each for in-phase and antiphase, and the true H."""
    bearing = truth.bearing(name)
    forces, motions, accelerations = [], [], []
    for sign in (1.0, -1.0):
        u = 400.0 * np.exp(1j * np.arange(TONES.size))
        F = np.stack((u, sign * 1.03 * np.exp(0.035j) * u), axis=1) @ FROM_UV.T
        d, a = BENCH.answers(bearing.impedance, F, TONES)
        forces.append(F)
        motions.append(d)
        accelerations.append(a)
    return forces, motions, accelerations, np.array([bearing.impedance(f) for f in TONES])


def still(parts: list[np.ndarray], blocks: int = 4) -> list[np.ndarray]:
    return [np.broadcast_to(part, (blocks, *part.shape)) for part in parts]


def solved(F: list[np.ndarray], D: list[np.ndarray], A: list[np.ndarray], mass: float, stiffness: float) -> np.ndarray:
    force = [bearing_force(f, a, TONES, mass, stiffness) for f, a in zip(F, A, strict=True)]
    return ratio_of_means(still(force), still(D)).H


@pytest.mark.parametrize("name", truth.BEARINGS)
def test_a_known_bench_gives_its_impedance_exactly(name: str) -> None:
    F, D, A, H = amplitudes(name)
    found = solved(F, D, A, BENCH.stator_mass, BENCH.stabilizer_stiffness)
    np.testing.assert_allclose(found, H, rtol=1e-9, atol=1e-9 * np.abs(H).max())


def test_each_record_may_have_any_origin_of_time_and_size() -> None:
    F, D, A, H = amplitudes("5pad-L3")
    factor = 0.3 * np.exp(1j * TONES)[:, None]
    F[1], D[1], A[1] = F[1] * factor, D[1] * factor, A[1] * factor
    found = solved(F, D, A, BENCH.stator_mass, BENCH.stabilizer_stiffness)
    np.testing.assert_allclose(found, H, rtol=1e-9, atol=1e-9 * np.abs(H).max())


def test_without_the_mass_stiffness_falls_by_13_per_cent_at_43_hz() -> None:
    F, D, A, H = amplitudes("4pad-L1")
    wrong = solved(F, D, A, 0.0, BENCH.stabilizer_stiffness)[:, 1, 1].real / H[:, 1, 1].real - 1
    assert wrong[0] == pytest.approx(-0.004, abs=0.001)
    assert wrong[-1] == pytest.approx(-0.13, abs=0.005)


def test_the_displacement_does_not_serve_for_the_acceleration() -> None:
    F, D, _, H = amplitudes("4pad-L1")
    rough = [-(W**2)[:, None] * d for d in D]
    wrong = solved(F, D, rough, BENCH.stator_mass, BENCH.stabilizer_stiffness)[:, 1, 1].real / H[:, 1, 1].real - 1
    assert wrong.max() == pytest.approx(0.0015, abs=0.01)
    assert np.ptp(wrong) > 0.015
    assert abs(wrong[-1]) > 0.009


def test_without_the_stabilisers_stiffness_is_one_per_cent_high() -> None:
    F, D, A, H = amplitudes("4pad-L1")
    wrong = solved(F, D, A, BENCH.stator_mass, 0.0)[:, 1, 1].real / H[:, 1, 1].real - 1
    np.testing.assert_allclose(wrong, 0.01, atol=0.002)


def noisy(
    seed: int, blocks: int, sigma_f: float, sigma_d: float
) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
    """Blocks of bearing force and displacement of one tone with white noise on both."""
    rng = np.random.default_rng(seed)
    H = np.array([[6e8 + 2e8j, 3e7 + 1e7j], [3e7 + 1e7j, 6e8 + 2e8j]])
    D = np.array([[1e-6, 1e-7j], [2e-7, 0.9e-6]])
    force, motion = [], []
    for m in range(2):
        d = np.broadcast_to(D[:, m], (blocks, 1, 2))
        noise = rng.standard_normal((2, blocks, 1, 2)) + 1j * rng.standard_normal((2, blocks, 1, 2))
        force.append(d @ H.T + sigma_f / np.sqrt(2) * noise[0])
        motion.append(d + sigma_d / np.sqrt(2) * noise[1])
    return force, motion, H


def test_the_covariance_is_what_repetition_shows() -> None:
    found = [ratio_of_means(*noisy(seed, 10, 6.0, 1e-8)[:2]) for seed in range(1500)]
    errors = np.array([(f.H - noisy(0, 2, 0, 0)[2][None])[0].reshape(4) for f in found])
    claimed = np.mean([f.covariance[0] for f in found], axis=0)
    shown = errors.T @ errors.conj() / len(errors)
    scale = np.sqrt(np.outer(np.diag(shown).real, np.diag(shown).real))
    assert np.abs(claimed - shown).max() / scale.min() < 0.1
    z = np.array([(f.H[0] - noisy(0, 2, 0, 0)[2]).real / f.std_error[0] for f in found])
    # The scatter of ten blocks has 18 degrees of freedom, since both parts of the amplitudes show it.
    assert np.sqrt(np.mean(z**2)) == pytest.approx(np.sqrt(18 / 16), rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_the_ratio_of_means_is_not_biased_by_noise_on_the_displacement(seed: int) -> None:
    # 6 dB in a block: averaging ratios block by block, or regressing force on displacement, is far off.
    F, D, H = noisy(seed, 4000, 6.0, 0.5e-6)
    found = ratio_of_means(F, D)
    assert np.abs(found.H[0] - H).max() < 4 * found.std_error.max()
    cross = sum(np.einsum("bki,bkj->ij", f, d.conj()) for f, d in zip(F, D, strict=True))
    power = sum(np.einsum("bki,bkj->ij", d, d.conj()) for d in D)
    regressed = cross @ np.linalg.inv(power)
    assert regressed[0, 0].real / H[0, 0].real - 1 < -0.15


def test_laws_of_the_lowest_degree_that_passes() -> None:
    rng = np.random.default_rng(4)
    r, sd, dof = TONES / 16.667 - 1, np.full(8, 1.0), np.full(8, 18.0)
    for degree, shape in ((0, 0 * r), (1, 10 * r), (2, 6 * r**2)):
        taken = []
        for _ in range(200):
            y = 100 + shape + sd * rng.standard_normal(8)
            law = laws.choose([laws.fit_law(r, y, sd, dof, d) for d in range(3)])
            taken.append(-1 if law is None else law.degree)
        assert np.mean(np.array(taken) == degree) > 0.95


def test_chi_square_allows_for_weights_that_were_estimated() -> None:
    rng = np.random.default_rng(0)
    n = 9
    z = rng.standard_normal((4000, 8)) / np.sqrt(rng.chisquare(n, (4000, 8)) / n)
    passed = (z**2).sum(axis=1) < laws.chi2_limit(8, 0, np.full(8, float(n)))
    assert 0.98 < passed.mean() < 0.998


def test_a_lag_and_a_mass_are_told_by_what_they_do_to_all_entries() -> None:
    H = np.array([truth.bearing("4pad-L1").impedance(f) for f in TONES])
    sd, dof = np.full(H.shape, 5e5), np.full(H.shape, 18.0)
    late = H * np.exp(1j * W * 50e-6)[:, None, None]
    told = laws.imitation(W, late, sd, dof, 1j * W[:, None, None] * late)
    assert told.value == pytest.approx(50e-6, rel=0.05)
    assert told.explains
    assert not laws.imitation(W, H, sd, dof, 1j * W[:, None, None] * H).explains
    heavy = H - (W**2 * 900.0)[:, None, None] * np.eye(2)
    pattern = np.broadcast_to(-(W**2)[:, None, None] * np.eye(2), H.shape)
    assert laws.imitation(W, heavy, sd, dof, pattern).value == pytest.approx(900.0, rel=1e-6)
    mass, error, stiffness = laws.added_mass(W, heavy[:, 0, 0].real, sd[:, 0, 0])
    assert (mass, stiffness) == (pytest.approx(900.0, rel=1e-6), pytest.approx(6e8, rel=1e-6))
    assert error > 0


def test_a_trend_too_small_to_be_seen_does_not_leave_the_interval_without_the_truth() -> None:
    rng = np.random.default_rng(2)
    r, sd, dof = TONES / 16.667 - 1, np.linspace(6.0, 3.4, 8), np.full(8, 18.0)
    held = {0.0: 0, 1.5: 0}
    for slope in held:
        for _ in range(400):
            y = slope * 4.5 * r + sd * rng.standard_normal(8)
            fitted = [laws.fit_law(r, y, sd, dof, degree) for degree in range(3)]
            law = laws.choose(fitted) or fitted[-1]
            (value,), (scatter,) = law.at(0.0)
            held[slope] += abs(value) < 2.0 * np.hypot(scatter, laws.choice_error(law, fitted))
    assert 0.95 < held[0.0] / 400 < 0.99
    assert held[1.5] / 400 > 0.9


@pytest.mark.parametrize("kind", ["stiffness", "damping"])
def test_where_others_go_with_frequency_a_trend_too_small_to_be_seen_does_not_leave_the_interval_without_the_truth(
    kind: str,
) -> None:
    rng = np.random.default_rng(2)
    r, dof = TONES / 16.667 - 1, np.full(8, 18.0)
    sd = np.ones(8) if kind == "stiffness" else 10.0 / TONES
    alone = 1.0 / np.sqrt(np.sum(sd**-2))
    for biased_by in (0.0, 1.5, 3.0):  # standard errors of a constant's intercept
        slope = biased_by * alone / float(np.sum(r / sd**2) * alone**2)
        z = []
        for _ in range(400):
            told = sd * np.sqrt(rng.chisquare(36, 8) / 36)
            fitted = [
                laws.fit_law(r, slope * r + sd * rng.standard_normal(8), told, dof, degree) for degree in range(3)
            ]
            (value,), (error,) = laws.for_intercept(laws.choose(fitted) or fitted[-1], fitted, True).at(0.0)
            z.append(value / error)
        assert np.mean(np.abs(z) < 2.0) > 0.925
        assert 0.9 < np.std(z) < 1.1


def test_sixteen_right_laws_are_hardly_ever_called_rejected_together() -> None:
    rng = np.random.default_rng(5)
    r, dof, tests, campaigns = np.linspace(-0.6, 1.6, 8), np.full(8, 18.0), 16, 150
    alarms = single = 0
    for _ in range(campaigns):
        sd = np.sqrt(rng.chisquare(18, (tests, 8)) / 18)
        drawn = [laws.fit_law(r, rng.standard_normal(8), s, dof, 2) for s in sd]
        single += any(not law.passes for law in drawn)
        alarms += any(not laws.among(law, 8, dof, tests).passes for law in drawn)
    assert alarms <= 6
    assert alarms < single
