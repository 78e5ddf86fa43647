"""Agreement of device and bench: Deming's line, limits with block bootstrap, coherence, on data whose truth is known."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from pipeline.rigs.rap.alignment.align import align
from pipeline.rigs.rap.alignment.pair import pairs_of
from pipeline.rigs.rap.alignment.result import Alignment
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.agreement import Agreement, bland_altman
from pipeline.rigs.rap.pressures.aligned import Aligned, aligned
from pipeline.rigs.rap.pressures.blocks import blocks_of
from pipeline.rigs.rap.pressures.coherence import coherence_at_lines
from pipeline.rigs.rap.pressures.deming import deming, line_through, noise_of
from pipeline.rigs.rap.pressures.hydraulics_fit import Readings, fit_hydraulics
from pipeline.rigs.rap.pressures.levels import Level, SetPoints, levels_of
from pipeline.rigs.rap.pressures.misfit import Misfit, misfits_of_circuit, misfits_of_tap
from pipeline.rigs.rap.pulsation.passages import Passages, find_passages
from pipeline.rigs.rap.synthetic.rig import synthesize_pressures
from pipeline.rigs.rap.tables import Signal, needed

ML_MIN = 1e-6 / 60.0
MMHG = 133.322
GAINS = {"access": 1.012, "prefilter": 1.015, "return": 0.990, "uf": 1.008}
OFFSETS = {"access": -60.0, "prefilter": 80.0, "return": 40.0, "uf": -30.0}


class Run(NamedTuple):
    taps: dict[str, Aligned]
    levels: list[Level]
    passages: Passages
    alignment: Alignment
    misfits: list[Misfit]


@cache
def run(seed: int, *truth: tuple[str, object], stated: str | None = None) -> Run:
    short = {"flows": (60 * ML_MIN, 80 * ML_MIN, 100 * ML_MIN), "duration": 330.0, "prot": False}
    recording = synthesize_pressures(short | dict(truth), seed)[0]
    pairs = pairs_of(recording)
    clock = align(pairs, 0.005)
    flow, uf = (needed(recording, name, "the test") for name in ("blood_flow_set", "uf_flow_set"))
    sets = SetPoints(*(Signal(s.name, clock.clock.to_bench(s.time), s.values) for s in (flow, uf)))
    bench = {tap: needed(recording, pressure(tap, "bench"), "the test") for tap in TAPS}
    levels = levels_of([bench[tap] for tap in ("prefilter", "return", "access", "uf")], sets)
    passages = find_passages(bench["prefilter"].time, bench["prefilter"].values)
    taps = {p.name: aligned(p, clock) for p in pairs}
    meter = needed(recording, "blood_flow_bench", "the test")
    location = stated or str(recording.conditions["flowmeter_location"])
    circuit = fit_hydraulics(Readings(bench, meter, location, sets.uf), levels)
    misfits = misfits_of_circuit(circuit)
    for one in taps.values():
        misfits += misfits_of_tap(one, deming(one, levels), clock, passages)
    return Run(taps, levels, passages, clock, misfits)


def limits(tap: str, seed: int = 0) -> Agreement:
    found = run(seed)
    return bland_altman(found.taps[tap], found.levels, found.passages)


def test_deming_becomes_least_squares_of_either_side_at_its_ends():
    rng = np.random.default_rng(0)
    x = rng.normal(3.0, 2.0, 200)
    y = 1.5 * x - 1.0 + rng.normal(0.0, 0.5, 200)
    sxx, syy, sxy = np.var(x), np.var(y), np.cov(x, y, bias=True)[0, 1]
    assert line_through(x, y, 1e12)[0] == pytest.approx(sxy / sxx, rel=1e-6)
    assert line_through(x, y, 1e-12)[0] == pytest.approx(syy / sxy, rel=1e-6)


def test_deming_with_equal_errors_is_the_principal_axis():
    rng = np.random.default_rng(1)
    x = rng.normal(0.0, 2.0, 300)
    y = 0.7 * x + rng.normal(0.0, 0.4, 300)
    _, vectors = np.linalg.eigh(np.cov(x, y))
    assert line_through(x, y, 1.0)[0] == pytest.approx(vectors[1, 1] / vectors[0, 1], rel=1e-9)


def test_deming_is_the_same_line_seen_from_both_sides():
    rng = np.random.default_rng(2)
    x = rng.normal(0.0, 1.0, 100)
    y = -1.3 * x + rng.normal(0.0, 0.3, 100)
    gain, offset = line_through(x, y, 4.0)
    back, shift = line_through(y, x, 0.25)
    assert gain * back == pytest.approx(1.0)
    assert offset == pytest.approx(-shift * gain)


def test_deming_does_not_flatten_under_noise_on_both_sides():
    rng = np.random.default_rng(3)
    true = rng.normal(0.0, 1.0, 20000)
    x, y = true + 0.5 * rng.standard_normal(20000), 2.0 * true + rng.standard_normal(20000)
    assert line_through(x, y, 4.0)[0] == pytest.approx(2.0, abs=0.04)
    assert line_through(x, y, 1e12)[0] == pytest.approx(1.6, abs=0.04)


@pytest.mark.parametrize("tap", TAPS)
def test_gain_and_offset_of_each_sensor_are_recovered(tap: str):
    found = run(0)
    line = deming(found.taps[tap], found.levels)
    assert line.gain.value == pytest.approx(GAINS[tap], abs=4.0 * (line.gain.std_error or 0.0))
    assert line.offset.value == pytest.approx(OFFSETS[tap], abs=4.0 * (line.offset.std_error or 0.0))
    assert (line.gain.std_error or 1.0) < 2e-3
    # Noise 25 Pa and steps of 26 Pa against 10 Pa and 2 Pa.
    assert line.ratio == pytest.approx((625.0 + 26.0**2 / 12.0) / 100.0, rel=0.6)


@pytest.mark.thorough
def test_errors_of_gain_and_offset_are_as_large_as_they_say():
    z = []
    for seed in range(8):
        found = run(seed)
        for tap in TAPS:
            line = deming(found.taps[tap], found.levels)
            assert line.gain.ci95 is not None
            assert line.offset.ci95 is not None
            z.append(line.gain.ci95[0] <= GAINS[tap] <= line.gain.ci95[1])
            z.append(line.offset.ci95[0] <= OFFSETS[tap] <= line.offset.ci95[1])
    # 64 intervals of 95 %: fewer than 54 hits come by chance once in a thousand.
    assert sum(z) >= 54


def test_gain_of_the_bench_is_told_apart_and_counted():
    found = run(0)
    plain = deming(found.taps["prefilter"], found.levels)
    typed = deming(found.taps["prefilter"], found.levels, bench_gain_u=0.005)
    assert typed.gain.std_error == pytest.approx(
        np.hypot(plain.gain.std_error or 0.0, 0.005 * (plain.gain.value or 0.0)), rel=1e-9
    )
    assert "type B" in typed.gain.reason
    assert "taken as exact" in plain.gain.reason


def test_one_level_tells_no_line():
    found = run(0)
    one = found.taps["prefilter"]
    steady = (one.time > found.levels[1].start) & (one.time < found.levels[1].start + 30.0)
    cut = Aligned(one.name, *(v[steady] for v in (one.time, one.device, one.bench, one.plain, one.good)))
    assert deming(cut, found.levels).gain.value is None


def test_noise_is_found_under_the_pulsation():
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 300.0, 0.05)
    x = 800.0 * np.cos(2 * np.pi * 1.96 * t) + 300.0 * np.cos(4 * np.pi * 1.96 * t) + 25.0 * rng.standard_normal(t.size)
    assert noise_of(x, np.ones(t.size, dtype=bool), 20.0) == pytest.approx(25.0, rel=0.05)


def test_equalised_limits_are_those_of_noise_and_gain_while_a_left_pole_widens_them():
    # The published-form table of the rig: 3.36 mmHg without, 0.59 mmHg with equalised bandwidth (pre-filter).
    found = limits("prefilter")
    assert 1.96 * found.unequalised.sd / MMHG == pytest.approx(3.36, rel=0.1)
    assert 1.96 * found.samples.sd / MMHG == pytest.approx(0.59, rel=0.1)
    assert found.means.sd < found.samples.sd


def test_limits_are_the_bias_and_its_196_standard_deviations():
    found = limits("return").samples
    assert found.bias.value == pytest.approx(float(found.difference.mean()), abs=1e-9)
    assert found.upper.value == pytest.approx((found.bias.value or 0.0) + 1.96 * found.sd, abs=1e-9)
    assert found.lower.value == pytest.approx((found.bias.value or 0.0) - 1.96 * found.sd, abs=1e-9)


@pytest.mark.thorough
def test_bias_scatters_over_runs_as_its_error_says():
    found = [limits("access", seed).samples.bias for seed in range(8)]
    values = np.array([one.value for one in found], dtype=float)
    errors = np.array([one.std_error for one in found], dtype=float)
    # A chi-squared of seven degrees of freedom lies between these in 99.8 %.
    assert 0.6 < float(((values - values.mean()) ** 2).sum() / (errors**2).mean()) < 24.3


def test_proportional_bias_is_that_of_the_gain():
    slope = limits("prefilter").trend.slope
    assert slope.value == pytest.approx(2.0 * 0.015 / 2.015, abs=4.0 * (slope.std_error or 0.0))


def test_too_short_a_record_has_no_limits():
    one = run(0).taps["uf"]
    few = Aligned(one.name, *(v[:100] for v in (one.time, one.device, one.bench, one.plain, one.good)))
    found = bland_altman(few, [])
    assert found.samples.bias.value is None
    assert "too few" in found.samples.bias.reason


def test_blocks_keep_the_share_of_each_level_when_drawn():
    t = np.arange(0.0, 200.0, 0.05)
    blocks = blocks_of(t, np.ones(t.size, dtype=bool), [Level(0.0, 0.0, 90.0, True), Level(90.0, 90.0, 200.0, True)])
    draws = blocks.draws()
    for level in np.unique(blocks.level):
        members = blocks.level == level
        assert np.allclose(draws[:, members].sum(axis=1), members.sum())
    # The variance of a drawn mean is that of the mean of independent blocks, without the loss of one degree of freedom.
    first = blocks.level == 0
    x = np.random.default_rng(0).standard_normal(int(first.sum()))
    drawn = (draws[:, first] @ x) / first.sum()
    assert drawn.var() == pytest.approx(x.var(ddof=1) / first.sum(), rel=0.1)


def test_coherence_is_one_at_the_low_lines_and_chance_between_them():
    found = run(0)
    at = {
        round((s.flow_set or 0.0) / ML_MIN): s
        for s in coherence_at_lines(found.taps["prefilter"], found.levels, found.passages)
    }
    assert set(at) == {60, 80, 100}
    lines = {line.harmonic: line for line in at[80].lines}
    assert (lines[1].coherence.value or 0.0) > 0.999
    assert (lines[3].coherence.value or 0.0) > 0.99
    assert all(lines[k].significant for k in (1, 2, 3, 4))
    assert at[80].between < at[80].threshold
    assert lines[1].gain == pytest.approx(1.015 * abs((1 + 0.0615j) / (1 + 0.369j)), rel=0.01)


def test_lines_above_half_the_rate_are_read_where_they_fold_to():
    found = run(0)
    at = coherence_at_lines(found.taps["prefilter"], found.levels, found.passages)[-1]
    fifth = next(line for line in at.lines if line.harmonic == 5)
    assert fifth.folded
    assert fifth.frequency == pytest.approx(20.0 - 5.0 * at.strokes, abs=0.25)


def test_a_pressure_without_harmonics_shows_no_coherence_there():
    # The inlet of the pump is one line: what stands at its multiples is noise.
    at = coherence_at_lines(run(0).taps["access"], run(0).levels, run(0).passages)[1]
    third = next(line for line in at.lines if line.harmonic == 3)
    assert not third.significant
    assert third.coherence.ci95 is not None
    assert third.coherence.ci95[0] == 0.0


def test_nothing_is_left_over_on_a_sound_rig():
    assert [m for m in run(0).misfits if m.exceeds] == []


def test_a_meter_on_the_return_line_is_seen_when_stated_as_on_the_access_line():
    found = run(0, ("flowmeter_location", "return"), stated="access")
    step = next(m for m in found.misfits if m.name == "meter_step")
    assert step.exceeds
    assert step.value == pytest.approx(-1.0, abs=0.25)


def test_interpolation_keeps_the_pulsation():
    found = run(0).taps["prefilter"]
    near = found.good & (found.time > 100.0) & (found.time < 250.0)
    # Straight lines would leave 2 to 8 % of 800 Pa; what is left is the noise of both.
    left = found.device[near] - 1.015 * found.bench[near] - 80.0
    assert float(np.std(left)) < 40.0


def test_a_short_level_is_two_blocks_and_so_tells_scatter() -> None:
    t = np.arange(0.0, 120.0, 0.05)
    blocks = blocks_of(t, np.ones(t.size, dtype=bool), [Level(0.0, 0.0, 18.0, False), Level(18.0, 18.0, 120.0, True)])
    assert np.bincount(blocks.level).tolist() == [2, 5]
