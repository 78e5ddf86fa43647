"""The joint ring fit against waveforms of a known tire: the contact solved, a white noise on every angle."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.tire.bench.identifiability import contact_lengths, ratios, scale_doubt, statements, told
from pipeline.rigs.tire.bench.ring_fit import fit_ring
from pipeline.rigs.tire.bench.ring_model import NAMES, SCALED, RingModel, Unknowns
from pipeline.rigs.tire.bench.ring_run import Known, RingRun, incoherent_error, weights
from pipeline.rigs.tire.bench.ring_verdict import judged
from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.ring import Ring, grid
from pipeline.rigs.tire.ring.sensor import Sensor, flex_shape

R, RO, P0, KMH = 0.3171, 0.3266, 2.2e5, 1.0 / 3.6
TRUTH = Unknowns(6.0, 0.21, 6e5, 2e5, 1.2e8, 5000.0, 0.08, 1e-3, 0.05)
KNOWN = Known(R, 6e-5, RO, 0.05, belt_width=0.2)
LOADS = [(1000.0, 10.0), (1500.0, 10.0), (2000.0, 10.0), (2500.0, 10.0), (3000.0, 10.0)]
SPEEDS = [(2000.0, 5.0), (2000.0, 20.0)]
# Sheet, section 6.
ACCURACY = dict.fromkeys(NAMES, 0.02) | dict.fromkeys(("bending_stiffness", "foundation_radial", "sensor_gain"), 0.01)


@lru_cache(maxsize=32)
def _contact(load, truth=TRUTH):
    ring = Ring(R, truth.bending_stiffness, P0 * truth.belt_width, truth.foundation_radial,
                truth.foundation_tangential, truth.loss_factor)  # fmt: skip
    return pressed(compliance(ring), truth.tread_stiffness, RO, load)


def _runs(plan=tuple(LOADS + SPEEDS), seed=0, truth=TRUTH, noise=1.2, drift=0.0, creep=0.0, heights=False, stretch=0.0):
    rng = np.random.default_rng(seed)
    theta, found = grid(1024), []
    for i, (load, kmh) in enumerate(plan):
        rotation = kmh * KMH / R
        shape = flex_shape(
            _contact(load, truth).shape,
            Sensor(truth.sensor_gain, 0.0, truth.sensor_length, truth.sensor_lag),
            R,
            rotation,
        )
        n = shape.orders
        slow = 1.0 - creep + creep / (1.0 + 1j * n * rotation * 0.06)
        wave = shape.times(slow * np.exp(1j * n * rng.uniform(-0.01, 0.01))).cut(400).at(theta * (1.0 + stretch))
        se = noise * (1.0 + wave / 2e4) ** 2
        R2 = 1e4 + wave + drift * theta / (2.0 * np.pi) + se * rng.standard_normal(theta.size)
        height = _contact(load, truth).loaded_radius if heights else None
        measured = load * (1.0 + 5e-5 * rng.standard_normal())
        found.append(
            RingRun(f"run_{i}", theta, R2, se, measured, 5e-5 * load, rotation, P0, load, kmh * KMH, height, 1e-5)
        )
    return found


@pytest.fixture(scope="module")
def fit():
    return fit_ring(_runs(), KNOWN)


@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_tire_is_recovered_from_a_start_twice_off(factor):
    off = {n: getattr(TRUTH, n) * (factor if i % 2 else 1.0 / factor) for i, n in enumerate(NAMES)}
    found = fit_ring(_runs(), KNOWN, Unknowns(**{**off, "sensor_length": 0.05}))
    for name in NAMES:
        assert getattr(found.values, name) == pytest.approx(getattr(TRUTH, name), rel=ACCURACY[name]), name
    assert not found.at_bound
    assert judged(found).level == "ok"


@pytest.mark.thorough
def test_errors_are_as_large_as_the_standard_errors():
    z = []
    for seed in range(1, 5):
        found = fit_ring(_runs(seed=seed), KNOWN)
        z += [(getattr(found.values, n) - getattr(TRUTH, n)) / found.std_error(n, combined=False) for n in NAMES]
        z += [(r.contact_length - _contact(r.nominal_load).length) / r.contact_length_se for r in found.runs[:5:2]]
    # Parameters are correlated: about half of the 48 are independent.
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4
    assert np.mean(np.abs(z) < 1.96) > 0.85


def test_contact_lengths_are_true_within_a_tenth_of_a_millimetre(fit):
    lengths = {e.at["load"]: e for e in contact_lengths(fit, judged(fit)) if e.at["speed"] == pytest.approx(10 * KMH)}
    for load, truth in ((1000.0, 0.0350), (2000.0, 0.0491), (3000.0, 0.0625)):
        assert lengths[load].value == pytest.approx(truth, abs=3e-4)  # the sheet's own table
        assert lengths[load].value == pytest.approx(_contact(load).length, abs=1e-4)
    assert len(contact_lengths(fit, judged(fit))) == 7


def test_drift_of_the_resistance_within_a_turn_is_no_loss(fit):
    drifting = fit_ring(_runs(drift=2.0), KNOWN)
    assert drifting.values.loss_factor == pytest.approx(fit.values.loss_factor, rel=1e-6)


def test_rotation_uneven_within_a_turn_widens_what_it_touches(fit):
    stretched = fit_ring([*_runs(LOADS), *_runs(SPEEDS[:1], stretch=3e-4), *_runs(SPEEDS[1:])], KNOWN)
    for name in ("sensor_lag", "bending_stiffness", "sensor_gain"):
        off = getattr(stretched.values, name) - getattr(fit.values, name)
        assert abs(off) < 2.5 * stretched.std_error(name, combined=False)


def test_load_gain_scales_stiffnesses_and_pressure_the_width_only(fit):
    by = {i.source: i.slopes for i in fit.influences}
    assert by["load_gain"][: len(SCALED)] == pytest.approx(1.0, abs=0.02)
    assert by["load_gain"][len(SCALED) :] == pytest.approx(0.0, abs=0.02)
    assert by["pressure"] == pytest.approx([0, -1, 0, 0, 0, 0, 0, 0, 0], abs=0.02)
    # EI goes with R^3, Ls with R: lengths scale with the belt.
    assert by["belt_radius"][[0, 8]] == pytest.approx([3.0, 1.0], abs=0.05)


def test_a_wrong_pressure_moves_the_width_as_the_influence_says(fit):
    runs = [replace(run, pressure=1.02 * run.pressure) for run in _runs()]
    wrong = fit_ring(runs, KNOWN)
    assert math.log(wrong.values.belt_width / fit.values.belt_width) == pytest.approx(-math.log(1.02), abs=1e-5)
    assert wrong.values.bending_stiffness == pytest.approx(fit.values.bending_stiffness, rel=1e-5)


def test_combined_error_holds_gain_and_pressure(fit):
    alone = fit.std_error("belt_width", combined=False) / fit.values.belt_width
    both = fit.std_error("belt_width") / fit.values.belt_width
    assert both == pytest.approx(math.sqrt(alone**2 + 0.01**2 + 0.005**2), rel=0.02)
    assert fit.std_error("sensor_gain") == pytest.approx(fit.std_error("sensor_gain", combined=False), rel=0.05)


def test_creep_of_the_sensor_is_a_model_that_does_not_fit():
    found = fit_ring(_runs(creep=0.08), KNOWN)
    verdict = judged(found)
    assert verdict.chi2_reduced > 20
    assert not verdict.fits
    assert "does not fit" in verdict.statement
    for value in told(found, verdict).values():
        assert value.value is None
        assert value.reason
    assert all(length.value is None for length in contact_lengths(found, verdict))


@pytest.mark.thorough
def test_noise_told_too_small_widens_and_is_no_misfit():
    runs = [replace(run, std_error=run.std_error / 2.0) for run in _runs()]
    found, honest = fit_ring(runs, KNOWN), fit_ring(_runs(), KNOWN)
    assert found.chi2_reduced == pytest.approx(4.0, rel=0.1)
    assert judged(found).level == "doubt"
    assert found.std_error("bending_stiffness", False) == pytest.approx(
        honest.std_error("bending_stiffness", False), rel=0.3
    )


def test_one_load_tells_ratios_only():
    found = fit_ring(_runs((*SPEEDS, LOADS[2])), KNOWN)
    verdict = judged(found)
    values = told(found, verdict)
    for name in (*SCALED, "sensor_gain"):
        assert values[name].value is None
        assert "three loads" in values[name].reason
    for name in ("loss_factor", "sensor_lag"):
        assert values[name].value == pytest.approx(getattr(TRUTH, name), rel=0.02)
    known = {c.text: c for c in ratios(found, verdict)}
    for name in ("bending_stiffness", "foundation_radial", "sensor_gain"):
        truth = getattr(TRUTH, name) / TRUTH.belt_width
        ratio = known[f"{name} / belt_width"]
        assert ratio.value == pytest.approx(truth, rel=0.005)
        assert abs(ratio.value - truth) < 4.0 * ratio.std_error
    (length,) = {e.value for e in contact_lengths(found, verdict)}
    assert length == pytest.approx(_contact(2000.0).length, abs=1e-3)
    assert any("ratios" in s for s in statements(found, verdict))


def test_a_known_belt_width_sets_the_scale_of_one_load():
    found = fit_ring(_runs((*SPEEDS, LOADS[2])), replace(KNOWN, belt_width=0.21, belt_width_u=0.01))
    value = told(found, judged(found))["bending_stiffness"]
    assert value.value == pytest.approx(6.0, rel=0.03)
    # The tension p0 b sets the scale: 1 % of the width and 1 % of the pressure.
    assert value.std_error / value.value == pytest.approx(math.hypot(0.01, 0.01), rel=0.1)


def test_hub_heights_narrow_the_scale_of_two_loads():
    plain, high = (fit_ring(_runs(LOADS[:2], heights=h), KNOWN) for h in (False, True))
    assert plain.scale_held
    assert not high.scale_held
    value = told(high, judged(high))["foundation_radial"]
    assert value.value == pytest.approx(6e5, rel=0.03)
    assert high.runs[0].loaded_radius == pytest.approx(_contact(1000.0).loaded_radius, abs=2e-5)


def test_one_speed_tells_neither_loss_nor_lag():
    found = fit_ring(_runs(LOADS), KNOWN)
    values = told(found, judged(found))
    for name in ("loss_factor", "sensor_lag"):
        assert values[name].value is None
        assert "two speeds" in values[name].reason
    assert values["bending_stiffness"].value == pytest.approx(6.0, rel=0.01)


def test_a_sensor_ten_per_cent_longer_than_told_is_found():
    found = fit_ring(_runs(truth=replace(TRUTH, sensor_length=0.055)), KNOWN)
    assert found.values.sensor_length == pytest.approx(0.055, rel=2e-3)
    assert any("measure its length" in s for s in statements(found, judged(found)))


@pytest.mark.thorough
def test_a_load_in_kilograms_shows_as_a_belt_too_narrow(fit):
    runs = [replace(run, load=run.load / 9.80665, load_se=run.load_se / 9.80665) for run in _runs()]
    found = fit_ring(runs, KNOWN)
    assert "kg" in scale_doubt(found)
    assert scale_doubt(fit) == ""


@pytest.mark.thorough
def test_a_parameter_that_ends_at_its_bound_is_not_told():
    found = fit_ring(_runs(truth=replace(TRUTH, tread_stiffness=2e10)), KNOWN)
    assert "tread_stiffness" in found.at_bound
    assert told(found, judged(found))["tread_stiffness"].value is None


def test_another_tire_is_fitted_as_well():
    truth = Unknowns(20.0, 0.15, 1.5e6, 6e5, 2.5e8, 900.0, 0.04, 3e-4, 0.04)
    found = fit_ring(_runs(truth=truth, noise=0.2), replace(KNOWN, sensor_length=0.04, belt_width=None))
    for name in ("bending_stiffness", "belt_width", "foundation_radial", "sensor_gain"):
        assert abs(getattr(found.values, name) - getattr(truth, name)) < 4.0 * found.std_error(name, combined=False)
    assert judged(found).level == "ok"


def test_gaps_in_a_waveform_cost_only_themselves():
    runs = _runs()
    runs[0].resistance[100:130] = np.nan
    found = fit_ring(runs, KNOWN)
    assert found.values.bending_stiffness == pytest.approx(6.0, rel=0.01)
    assert np.isnan(found.runs[0].residual[110])
    assert np.isfinite(found.runs[0].model).all()


def test_runs_without_load_or_pressure_are_left_out_by_name():
    runs = _runs()
    runs[0], runs[1] = replace(runs[0], load=0.0), replace(runs[1], pressure=math.nan)
    found = fit_ring(runs, KNOWN)
    assert set(found.left_out) == {"run_0", "run_1"}
    with pytest.raises(InputError, match="no run to work on"):
        fit_ring([runs[0]], KNOWN)


def test_jacobian_is_the_derivative_of_the_residual():
    model = RingModel(_runs(LOADS[:2], heights=True), KNOWN)
    x = np.concatenate([TRUTH.coordinates(), 1e-3 * np.random.default_rng(2).standard_normal(8), [1e-4]])
    J = model.jacobian(x)
    for j in range(x.size):
        step = np.zeros(x.size)
        step[j] = 1e-4
        difference = (model.residual(x + step) - model.residual(x - step)) / 2e-4
        assert np.linalg.norm(J[:, j] - difference) < 0.02 * np.linalg.norm(difference)


def test_waves_of_the_load_are_not_taken_as_noise_of_each_angle():
    rng = np.random.default_rng(3)
    theta = grid(1024)
    wave = flex_shape(_contact(2000.0).shape, Sensor(5000.0, 0.0, 0.05, 1e-3), R, 8.76).cut(400).at(theta)
    turns = 1e4 + wave * (1.0 + 0.005 * rng.standard_normal(24))[:, None] + 6.0 * rng.standard_normal((24, 1024))
    groups = (turns.sum(axis=0) - turns) / 23
    error = incoherent_error(theta, turns.mean(axis=0), groups)
    assert error is not None
    peak = np.abs(theta) < 0.05
    assert np.sqrt(np.mean(error[peak] ** 2)) == pytest.approx(6.0 / math.sqrt(24), rel=0.2)
    assert incoherent_error(theta, turns.mean(axis=0), groups[:3]) is None


def test_weights_are_smooth_and_zero_in_gaps():
    run = _runs(LOADS[:1])[0]
    se = np.abs(1.0 + 0.3 * np.random.default_rng(0).standard_normal(1024))
    se[50] = np.nan
    w = weights(replace(run, std_error=se))
    assert w[50] == 0.0
    assert np.std(w[w > 0]) < 0.12


def _scattering(by, seed):
    """Return runs whose load, gain and pressure differ from what is told by draws of `by`, unseen."""
    rng = np.random.default_rng((seed, 5))
    found = []
    for point in (*LOADS, *SPEEDS):
        gain, more, pressure = 1.0 + by * rng.standard_normal(3)
        truth = replace(TRUTH, sensor_gain=TRUTH.sensor_gain * gain, belt_width=TRUTH.belt_width * pressure)
        (run,) = _runs((((point[0] * more), point[1]),), seed=int(rng.integers(1 << 30)), truth=truth)
        found.append(replace(run, run=f"{point}", load=point[0], nominal_load=point[0]))
    return found


@pytest.mark.thorough
def test_runs_that_differ_unseen_widen_the_errors_to_hold_the_truth():
    z, alone = [], []
    for seed in range(2):
        runs = _scattering(0.002, seed)
        plain, found = fit_ring(runs, KNOWN), fit_ring(runs, KNOWN, scattered=True)
        assert 0.001 < found.scatter.size < 0.005
        assert judged(found).level == "doubt"
        assert "from run to run" in judged(found).statement
        for one, into in ((found, z), (plain, alone)):
            into += [(getattr(one.values, n) - getattr(TRUTH, n)) / one.std_error(n, combined=False) for n in NAMES]
    assert np.abs(z).max() < 3.0 < np.abs(alone).max()


def test_runs_that_are_alike_are_not_taken_to_differ(fit):
    found = fit_ring(_runs(), KNOWN, scattered=True)
    assert found.scatter.size < 2e-4
    assert found.std_error("bending_stiffness", False) < 2.0 * fit.std_error("bending_stiffness", False)


def test_a_negative_lag_is_not_told(fit):
    wrong = replace(fit, values=replace(fit.values, sensor_lag=-1e-3))
    value = told(wrong, judged(fit))["sensor_lag"]
    assert value.value is None
    assert "negative" in value.reason
