from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.mre.model.dynamic_model import Shape
from pipeline.rigs.mre.model.time_columns import highest_motion, segment_columns, segments_of
from pipeline.rigs.mre.model.time_fit import Record, TimeFit, TimeOptions, fit_records
from pipeline.rigs.mre.synthetic import synthesize_rich

TRUTH = {"k1": 6.0e4, "s1": 1200.0, "k2": 2.6e5, "alpha_bw": 40.0, "rho": 4000.0, "c_bw": 0.8, "n_bw": 1.4}


@cache
def rich(seed: int, current: float = 0.0, duration: float = 60.0) -> Record:
    log = synthesize_rich({}, seed, current=current, duration=duration)
    return Record(log.run, *log.signal("displacement"), log.values("force"), current)


@cache
def fitted(seed: int) -> TimeFit:
    return fit_records([rich(seed)])


def test_chirp_gives_the_whole_model() -> None:
    fit = fitted(1)
    for name, truth in TRUTH.items():
        assert fit.one(name).value == pytest.approx(truth, rel=0.0075), name
    assert fit.one("force_lag").value == pytest.approx(60e-6, abs=6e-6)
    assert not fit.undetermined
    assert fit.nrmse < 0.01


def test_first_half_predicts_the_second() -> None:
    fit = fitted(1)
    assert fit.nrmse_second_half == pytest.approx(fit.nrmse_first_half, rel=0.3)
    assert fit.nrmse_second_half < 0.01


@pytest.mark.thorough
def test_intervals_hold_the_truth() -> None:
    held, count = 0, 0
    for seed in range(4):
        fit = fit_records([rich(seed, duration=20.0)], TimeOptions(starts=1))
        pairs = [(fit.one(name), truth) for name, truth in TRUTH.items()] + [(fit.one("force_lag"), 60e-6)]
        held += sum(e.ci95[0] <= truth <= e.ci95[1] for e, truth in pairs)
        count += len(pairs)
    assert held / count >= 0.85


@pytest.mark.thorough
def test_field_adds_to_k2_and_a_viscous_column() -> None:
    fit = fit_records([rich(1, 6.0)], TimeOptions(viscous=True))
    assert fit.one("k2").value == pytest.approx(2.6e5 + 2.265e5, rel=0.005)
    low, high = fit.one("s_mr").ci95
    assert low < 360 < high


def test_records_of_several_currents_share_what_the_field_leaves_alone() -> None:
    fit = fit_records([rich(3, 0.0, 20.0), rich(4, 6.0, 20.0)])
    assert fit.levels == (0.0, 6.0)
    assert fit.one("k_mr", 6.0).value == pytest.approx(2.265e5, rel=0.005)
    assert fit.one("s_mr", 6.0).value == pytest.approx(360, rel=0.05)
    assert fit.one("k2").value == pytest.approx(2.6e5, rel=0.005)
    assert set(fit.series) == {"rich_0a", "rich_6a"}


def test_offsets_belong_to_each_record() -> None:
    record = rich(3, 0.0, 20.0)
    moved = Record("moved", record.time, record.displacement + 2e-3, record.force + 300.0, 0.0)
    fit = fit_records([record, moved], TimeOptions(starts=1))
    assert fit.one("k2").value == pytest.approx(2.6e5, rel=0.005)


@pytest.mark.thorough
def test_a_gap_parts_the_record_and_costs_nothing_else() -> None:
    record = rich(1)
    kept = (record.time < 20) | (record.time > 24)
    broken = Record("broken", record.time[kept], record.displacement[kept], record.force[kept], 0.0)
    fit = fit_records([broken], TimeOptions(starts=1))
    assert fit.one("k2").value == pytest.approx(2.6e5, rel=0.005)
    assert len(segments_of(broken, None)) == 2


def test_too_short_a_record_is_refused_in_words() -> None:
    record = rich(1)
    short = Record("short", record.time[:60], record.displacement[:60], record.force[:60])
    with pytest.raises(InputError, match="short"):
        fit_records([short])


def test_hum_is_fitted_along_and_does_not_lead_astray() -> None:
    record = rich(1)
    hummed = Record(
        "hum", record.time, record.displacement, record.force + 5 * np.sin(2 * np.pi * 49.98 * record.time), 0.0
    )
    fit = fit_records([hummed], TimeOptions(starts=1))
    for name, truth in TRUTH.items():
        assert fit.one(name).value == pytest.approx(truth, rel=0.01), name


def test_cutoff_follows_the_motion() -> None:
    t = np.arange(0, 20, 1e-3)
    rng = np.random.default_rng(0)
    for f in (2.0, 15.0):
        assert highest_motion(t, np.sin(2 * np.pi * f * t) + 1e-3 * rng.normal(size=t.size)) == pytest.approx(
            3 * f, rel=0.1
        )


def test_slopes_of_the_columns_agree_with_differences() -> None:
    segment = segments_of(rich(1, 0.0, 20.0), None)[0]
    shape = Shape(0.02, 4000.0, 0.8, 1.4, 1e-4)
    _, slopes = segment_columns(segment, shape, 4000)
    q = shape.search_point
    for k, step in enumerate((1e-5, 1e-5, 1e-5, 1e-5, 1e-7)):
        up, down = (segment_columns(segment, Shape.of(q + s * step * np.eye(5)[k]), 4000)[0] for s in (1, -1))
        for name, slope in slopes[k].items():
            late = slice(200, None)  # the start at rest is not delayed
            difference, slope = (up[name] - down[name])[late] / (2 * step), slope[late]
            near = 1e-6 if k < 4 else 0.03  # the lag's is a difference along time
            assert np.linalg.norm(slope - difference) < near * np.linalg.norm(difference), (k, name)


def test_random_record_of_a_real_damper(realdata: Path) -> None:
    log = realdata / "mr_damper_random" / "ranran_50_converted.csv"
    columns: dict[str, Any] = {"delimiter": ",", "skip_header": 1, "usecols": (0, 2, 6)}
    t, x, force = np.genfromtxt(log, max_rows=30000, **columns).T
    fit = fit_records([Record("random", t, x / 100, force)], TimeOptions(starts=1))
    assert fit.nrmse_first_half < 0.5
    assert fit.nrmse_second_half < 0.6  # the coil's voltage is random as well: no constant model follows it
    assert fit.effective_fraction < 0.3  # and its residual is anything but white
