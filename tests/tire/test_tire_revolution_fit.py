"""Load and longitudinal force of each revolution of a drive are those of the truth, within errors that are true."""

from dataclasses import replace

import numpy as np
import pytest
from drives_of_truth import calibrated, drive, known_library, passages

from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.ring import Shape
from pipeline.rigs.tire.ring.sensor import flex_shape
from pipeline.rigs.tire.road.gauss_newton import coarse_fit, noise_step
from pipeline.rigs.tire.road.library import UNKNOWNS, library
from pipeline.rigs.tire.road.missing_bins import fill
from pipeline.rigs.tire.road.noise_spectrum import NoiseSpectrum
from pipeline.rigs.tire.road.passage_voltage import ANGLES, passages_of
from pipeline.rigs.tire.road.revolution_fit import REASONS, RevolutionFit
from pipeline.rigs.tire.road.systematic import systematic
from pipeline.rigs.tire.synthetic.truth import road_truth


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_the_library_between_its_loads_is_the_contact_seen_by_the_sensor():
    tire = calibrated(road_truth({}))
    known, speed = known_library(), 40.0
    for Fz, Fx in ((700.0, 0.0), (2345.0, 0.0), (3456.0, 300.0)):
        found = known.harmonics(np.array([Fz]), np.array([Fx]), np.array([speed]))[0][0]
        exact = flex_shape(pressed(compliance(tire.ring), tire.kt, tire.Ro, Fz, Fx).shape, tire.sensor, 0.3171, speed)
        exact = exact.cut(found.size - 1)
        theta = np.linspace(-1.0, 1.0, 801)
        assert np.abs(Shape(found).at(theta) - exact.at(theta)).max() < 8e-4 * exact.at(theta).max()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_load_and_force_of_the_standard_drive_are_closer_than_asked(seed):
    found = drive(seed)
    assert np.mean(found.forces.fits) > 0.95
    assert rms(found.load_error) < 25.0
    assert rms(found.force_error) < 45.0
    assert abs(found.load_error.mean()) < 4.0
    assert abs(found.force_error.mean()) < 8.0


@pytest.mark.thorough
def test_standard_errors_hold_under_coloured_noise():
    Fz, Fx = [], []
    for seed in range(1, 6):
        found = drive(seed)
        f = found.forces
        Fz.append(found.load_error / f.load_se[f.fits])
        Fx.append(found.force_error / f.force_se[f.fits])
    for z in (np.concatenate(Fz), np.concatenate(Fx)):
        assert 0.93 < np.mean(np.abs(z) < 1.96) < 0.985
        assert 0.8 < np.std(z) < 1.1


@pytest.mark.parametrize("kmh", [10.0, 20.0])
def test_a_quiet_bench_gives_the_load_within_newtons(kmh):
    speed = kmh / 3.6
    found = drive(
        4, road_noise=0.0, loss=0.01, pulses=(), static_load=2000.0, duration=25.0, speeds=((0.0, speed), (1.0, speed))
    )
    assert rms(found.load_error) < 2.0
    assert rms(found.force_error) < 6.0
    assert np.mean(np.abs(found.load_error) < 1.96 * found.forces.load_se[found.forces.fits]) > 0.9


def test_a_tire_as_a_bench_finds_it_moves_the_forces_by_no_more_than_its_systematic_error():
    sd = dict(
        zip(UNKNOWNS, (0.0022, 0.0023, 0.0023, 0.0057, 0.0058, 0.0011, 0.0023, 0.0032, 0.0005, 1e-4), strict=True)
    )
    moved = {
        name: float(np.exp(sign * sd[name]))
        for name, sign in zip(UNKNOWNS, (1, 1, -1, 1, -1, 1, 1, -1, 1, -1), strict=True)
    }
    tire = replace(
        calibrated(road_truth({}), **moved), names=UNKNOWNS, covariance=np.diag([sd[name] ** 2 for name in UNKNOWNS])
    )
    known = library(tire)
    found = drive(1, known)
    assert rms(found.load_error) < 40.0
    assert rms(found.force_error) < 100.0
    errors = systematic(known, found.forces.speed)
    sd_load = errors.load_sd(found.forces.load, found.forces.force, found.forces.speed)
    assert 2.0 < np.nanmedian(sd_load) < 40.0
    assert abs(found.load_error.mean()) < 3.0 * np.nanmedian(sd_load)


@pytest.mark.thorough
def test_the_systematic_error_of_each_number_is_the_shift_that_it_causes():
    straight = drive(1)
    errors = systematic(known_library(), straight.forces.speed)
    for name, factor in (("c", 1.02), ("p0b", 1.02), ("R", 1.005)):
        shifted = drive(1, known_library(**{name: factor}))
        expected = errors._slopes(np.array([3500.0]), np.zeros(1), np.array([38.0]))[
            0, 0, UNKNOWNS.index(name)
        ] * np.log(factor)
        assert np.nanmedian(shifted.forces.load - straight.forces.load) == pytest.approx(expected, rel=0.2)


def test_more_gain_of_the_sensor_reads_as_more_load():
    errors = systematic(known_library(), np.array([40.0]))
    louder = drive(1, known_library(c=1.0 / 1.01))
    change = np.nanmedian(louder.forces.load - drive(1).forces.load)
    assert change == pytest.approx(errors.gain_to_load(3500.0), rel=0.1)
    assert 25.0 < change < 50.0


def test_a_tenth_of_the_packets_may_be_lost():
    found = drive(5, loss=0.1, burst=12.0)
    assert np.mean(found.forces.fits) > 0.7
    assert rms(found.load_error) < 40.0
    assert rms(found.force_error) < 100.0
    assert found.covered()[0] > 0.9


def test_blocks_of_any_size_give_the_same_numbers():
    whole, split = drive(2), drive(2, block=37)
    assert np.array_equal(whole.forces.time, split.forces.time)
    assert np.allclose(whole.forces.load, split.forces.load, equal_nan=True)


def test_a_revolution_that_is_no_passage_is_named_and_not_reported():
    _, blocks = passages(1, ())
    block = blocks[0]
    R2 = block.resistance.copy()
    theta = np.linspace(-np.pi, np.pi, R2.shape[1], endpoint=False)
    R2[40] += 3000.0 * np.exp(-(((theta - 1.2) / 0.1) ** 2))
    R2[60, 300:700] = np.nan
    fit = RevolutionFit(known_library())
    parts = [fit.add(replace(block, resistance=R2)), fit.close()]
    forces = next(part for part in parts if part is not None)
    assert not forces.fits[40]
    assert "shape" in REASONS[forces.reason[40]]
    assert not forces.fits[60]
    assert np.array_equal(forces.speed, block.speed)
    assert np.isnan(forces.load[60])


def test_loads_beyond_the_bench_are_flagged():
    forces = drive(1).forces
    assert forces.extrapolated[forces.fits].mean() > 0.9
    low = drive(
        4,
        road_noise=0.0,
        loss=0.01,
        pulses=(),
        static_load=2000.0,
        duration=25.0,
        speeds=((0.0, 20 / 3.6), (1.0, 20 / 3.6)),
    )
    assert not low.forces.extrapolated.any()


def test_the_spectrum_that_a_drive_teaches_is_that_of_its_noise():
    noise = drive(1).fit.noise
    band = (noise.frequency > 60.0) & (noise.frequency < 250.0)
    # 8 mV between 30 and 400 Hz, as a Butterworth band-pass of second order shapes it.
    assert np.sqrt(noise.values[band]).mean() == pytest.approx(8e-3 / np.sqrt(400.0), rel=0.15)
    assert np.sqrt(noise.values[noise.frequency < 13.0]).max() < 1.5e-4


def test_a_density_in_bands_is_learnt_without_bias():
    rng = np.random.default_rng(3)
    noise, f = NoiseSpectrum(), np.broadcast_to(np.arange(1.0, 129.0) * 5.0, (400, 128))
    noise.add(f, 2e-6 * rng.exponential(size=f.shape), np.ones(f.shape))
    assert np.median(noise.density(f[0])) == pytest.approx(2e-6, rel=0.03)


def test_missing_bins_carry_no_weight():
    rng = np.random.default_rng(1)
    M = 32
    row = np.exp(-0.5 * np.minimum(np.arange(M), M - np.arange(M)))
    row[0] += 0.3
    C = np.array([np.roll(row, i) for i in range(M)])
    J, missing = rng.standard_normal((M, 3)), np.zeros(M, dtype=bool)
    missing[[3, 4, 5, 20]] = True
    seen = ~missing
    exact = J[seen].T @ np.linalg.solve(C[np.ix_(seen, seen)], J[seen])
    columns = np.where(missing, 0.0, J.T)[None].copy()
    kernel = np.fft.irfft(1.0 / np.fft.rfft(row), M)[None]
    weighted = np.fft.irfft(np.fft.rfft(columns, axis=2) * np.fft.rfft(kernel)[:, None], M, axis=2)
    fill(kernel, weighted, missing[None], columns)
    Lambda = np.linalg.inv(C)
    assert columns[0] @ Lambda @ columns[0].T == pytest.approx(exact, rel=1e-8)


def test_the_covariance_of_a_step_is_the_scatter_under_the_noise_that_it_is_given():
    _, blocks = passages(1, ())
    known = known_library()
    data = passages_of(blocks[0], known)
    gapless = int(np.flatnonzero(~data.missing.any(axis=1))[5])
    data = data.part(np.array([gapless]))
    rng, state = np.random.default_rng(5), coarse_fit(data, known)
    many = replace(data.part(np.zeros(400, dtype=int)), time=10.0 * np.arange(400))
    half = np.arange(ANGLES + 1)
    variances = np.tile(1e-5 / (1.0 + (half / 40.0) ** 2), (400, 1))
    # Noise that is longer than the turn: it does not repeat with it.
    spectrum = np.sqrt(variances[0] * 2 * ANGLES / 2) * (
        rng.standard_normal((400, half.size)) + 1j * rng.standard_normal((400, half.size))
    )
    noise = np.fft.irfft(spectrum, 2 * ANGLES, axis=1)[:, :ANGLES]
    weights = 1.0 / variances[:, ::2]
    many = replace(many, voltage=many.voltage + noise)
    state = state.part(np.zeros(400, dtype=int))
    step = noise_step(many, state, known, weights, variances)
    predicted = np.sqrt(step.covariance[0, 0, 0]), np.sqrt(step.covariance[0, 1, 1])
    assert np.std(step.state.load) == pytest.approx(predicted[0], rel=0.15)
    assert np.std(step.state.force) == pytest.approx(predicted[1], rel=0.15)


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda block: {"whole": np.zeros_like(block.whole)},
        lambda block: {"speed": np.full_like(block.speed, np.nan)},
        lambda block: {"count": np.zeros_like(block.count)},
        lambda block: {"resistance": np.full_like(block.resistance, 1e4)},
        lambda block: {"resistance": np.full_like(block.resistance, 1e8)},
        lambda block: {"resistance": 2e4 - block.resistance},
    ],
)
def test_blocks_without_a_passage_give_no_number(spoilt):
    block = passages(1, ())[1][0][:40]
    fit = RevolutionFit(known_library())
    assert fit.add(replace(block, **spoilt(block))) is None
    forces = fit.close()
    assert len(forces) == 40
    assert not forces.fits.any()
    assert fit.shape_error is None or fit.shape_error.share > 0.0
