"""Many runs: what they share is told as for few, what changes over them and which are odd is named, and nothing grows with them."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from pipeline.campaign.parallel import in_parallel
from pipeline.estimation.course import Odd
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Parameter
from pipeline.findings.figures import Figure, Table
from pipeline.findings.storage import to_json
from pipeline.recording import QualityFinding, Recording
from pipeline.report.page import render_report
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox import cycle
from pipeline.rigs.gearbox.campaign_numbers import _not_quite_steady, straight_course
from pipeline.rigs.gearbox.declaration import LOAD_EXCHANGE, LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.load.friction_fit import mean_of_runs, scatter_of_groups, shared_errors, slip_line
from pipeline.rigs.gearbox.many import blocks
from pipeline.rigs.gearbox.one_run import told_by
from pipeline.rigs.gearbox.outcome.core_numbers import kind_of, missing
from pipeline.rigs.gearbox.outcome.verdict_many import by_kind, over_campaign
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.synthetic import synthesize
from pipeline.rigs.gearbox.torques.pooled_map import pooled
from pipeline.rigs.gearbox.torques.torque_map import Transfer, total_least_squares
from pipeline.rigs.gearbox.truth import gearbox_truth
from pipeline.rigs.judgement import Judgement
from pipeline.rigs.number_over_runs import over_runs

RPM = 2 * np.pi / 60
SPEEDS = (60, 90, 120, 150, 210)
RUNS = 45
# A short cycle at half the rate: enough for every stage at 60 rpm.
SHORT = {
    "brake_on": 7.5,
    "brake_off": 11.0,
    "rundown_start": 15.0,
    "duration": 17.0,
    "torque_rate": 1000.0,
    "vibration": False,
}
ODD, SWAPPED, WEAR = "run12", "run20", 0.1
TRUTH = {"inertia_load": 0.0195, "drag_coulomb": 0.2467, "drag_viscous": 0.004244, "torque_transfer_slope": 0.5443}


def recording(number, **truth):
    (found,) = synthesize({"speeds": [SPEEDS[number % len(SPEEDS)] * RPM], **SHORT, **truth}, 500 + number)
    return Recording(f"run{number:02d}", found.streams, found.conditions)


class Stored:
    """Does the work once, as another process would: what it is told and tells goes through a pickle."""

    def __init__(self):
        self.done = {}

    def __call__(self, function, tasks, seconds):
        for at, task in enumerate(tasks):
            key = (len(tasks), at)
            if key not in self.done:
                self.done[key] = pickle.dumps(function(*pickle.loads(pickle.dumps(task))))
            yield pickle.loads(self.done[key])


@pytest.fixture(scope="module")
def campaign():
    faults = {ODD: {"gain_out": 0.8}, SWAPPED: {"swap_torques": True}}
    recordings = [recording(k, c0=0.1 + WEAR * k / RUNS, **faults.get(f"run{k:02d}", {})) for k in range(1, RUNS + 1)]
    stored = Stored()
    return recordings, stored, identify(recordings, LoadExchangeSettings(), Context("endurance", {}, each=stored))


def test_what_the_runs_share_is_right_and_better_known_than_from_one(campaign):
    findings = campaign[2]
    for name, true in TRUTH.items():
        (found,) = [p for p in findings.find(name) if not p.at]
        assert abs(found.value - true) < 3 * found.std_error, name
    (inertia,) = [p for p in findings.find("inertia_load") if not p.at]
    alone = np.median([p.std_error for p in findings.find("inertia_load") if p.at and p.std_error])
    assert inertia.std_error < 0.4 * alone
    for speed in SPEEDS:
        (drag,) = findings.find("drag_locked", speed=float(f"{speed * RPM:.4g}"))
        assert "runs" in drag.description
        assert drag.std_error < 0.03


def test_a_drift_is_told_and_not_averaged_away(campaign):
    drift = next(reason for reason in campaign[2].reasons if "drift" in reason)
    assert "input torque in FOS by +" in drift
    assert "efficiency in FOS by -" in drift


def test_an_odd_run_is_named_and_left_out_of_what_the_others_share(campaign):
    findings = campaign[2]
    (told,) = [reason for reason in findings.reasons if "unlike the others" in reason]
    assert ODD in told
    runs = findings.arrays["runs"].set_index("run")
    assert runs.loc[ODD, "unlike"]
    assert runs.loc[ODD, "drawn"] == "odd"
    assert next(run for run in findings.runs if run.run == ODD).used
    assert findings.find("inertia_load", run=ODD)[0].value == pytest.approx(0.8 * 0.0195, rel=0.08)


def test_a_faulty_run_is_left_out_with_its_reason(campaign):
    findings = campaign[2]
    assert any(SWAPPED in reason and "channels swapped" in reason for reason in findings.reasons)
    assert not next(run for run in findings.runs if run.run == SWAPPED).used


def test_the_report_tells_trends_and_few_runs(campaign):
    findings = campaign[2]
    blocks_ = [block for section in LOAD_EXCHANGE.sections(findings) for block in section.blocks]
    figures = [block for block in blocks_ if isinstance(block, Figure)]
    assert sum(len(figure.panels) for figure in figures) < RUNS
    assert all(len(table.rows) < RUNS for table in blocks_ if isinstance(table, Table))
    drawn = findings.arrays["overview"]["run"].unique()
    assert 2 <= len(drawn) <= 6
    page = render_report(findings, LOAD_EXCHANGE, "Endurance", "rigfit report endurance")
    assert len(page.encode()) < 5e6
    assert "stand for the others" in page


def test_the_findings_do_not_depend_on_where_the_work_was_done(campaign):
    recordings, stored, findings = campaign
    again = identify(recordings, LoadExchangeSettings(), Context("endurance", {}, each=stored))
    assert to_json(again) == to_json(findings)
    few = recordings[:3]
    two = Context("few", {}, each=lambda f, tasks, _: in_parallel(f, tasks, 60.0))
    turn = Context("few", {})
    assert to_json(identify(few, LoadExchangeSettings(), two)) == to_json(identify(few, LoadExchangeSettings(), turn))


def test_what_a_run_hands_on_is_small():
    told = told_by(recording(3), False)
    assert len(pickle.dumps(told)) < 60e3
    numbers = numbers_of(record_of(recording(3)))
    assert len(pickle.dumps(numbers)) > 20 * len(pickle.dumps(numbers.emptied()))


def test_the_mean_over_runs_is_known_to_their_scatter_and_what_they_share():
    rng = np.random.default_rng(3)
    errors, dofs, none = np.full(100, 0.01), np.full(100, 20.0), np.zeros(100)
    value, error, _ = mean_of_runs(1 + 0.01 * rng.standard_normal(100), errors, dofs, none)
    assert value == pytest.approx(1.0, abs=0.004)
    assert error == pytest.approx(0.001, rel=0.2)
    scattered = mean_of_runs(1 + 0.05 * rng.standard_normal(100), errors, dofs, none)
    assert scattered[1] == pytest.approx(0.005, rel=0.3)
    # Half of the variance is common: it does not average out here and is not counted twice.
    shared = mean_of_runs(1 + 0.007 * rng.standard_normal(100), errors, dofs, np.full(100, 0.00707))
    assert shared[1] == pytest.approx(0.0007, rel=0.3)


def test_warm_days_are_not_averaged_away_as_if_runs_were_independent():
    rng = np.random.default_rng(4)
    covered = 0
    for _ in range(200):
        days = np.repeat(0.02 * rng.standard_normal(20), 20)
        runs = 1 + days + 0.005 * rng.standard_normal(400)
        value, error, dof = mean_of_runs(runs, np.full(400, 0.005), np.full(400, 20.0), np.zeros(400))
        covered += abs(value - 1) < t_quantile(dof) * error
    assert covered > 180
    slopes = [Transfer("brake", float(a), 0.005, 0.4, 0.01, 20.0) for a in 0.54 + days]
    assert pooled(slopes).slope_error > 3 * 0.005 / np.sqrt(400)


def test_an_error_that_all_runs_share_does_not_pull_a_line_of_many_runs_off():
    """M_slip = T_out/a: the slope a is wrong for all alike, and no number of runs may be used to move it."""
    rng = np.random.default_rng(5)
    speed = np.tile(np.array(SPEEDS) * RPM, 200)
    torque = 0.5388 + 0.039 * speed + 0.01 * rng.standard_normal(speed.size)
    errors = shared_errors(np.full(speed.size, 0.01), straight_course(speed, 0.5443 * torque), 0.5443, 0.01)
    line = slip_line(speed, torque, errors)
    assert line.values == pytest.approx([0.5388, 0.039], rel=2e-3)
    assert line.covariance.std_error == pytest.approx(np.array([0.5388, 0.039]) * 0.01 / 0.5443, rel=0.1)


def test_neighbouring_runs_are_taken_together_only_where_there_are_many():
    assert [list(block) for block in blocks(3)] == [[0], [1], [2]]
    assert len(blocks(1000)) == 24
    assert sorted(np.concatenate(blocks(1000))) == list(range(1000))


def test_three_hundred_bad_runs_are_told_in_a_few_sentences():
    said = Judgement()
    left_out = {f"r{k}": f"torque_in is {0.1 * k:.3g} N m and dead" for k in range(200)}
    left_out |= {f"s{k}": f"reason {'abcdefgh'[k]}" for k in range(8)}
    grave = [QualityFinding("warning", f"the clock is {k:.1f} s late", f"t{k}") for k in range(100)]
    by_kind(said, left_out, grave)
    assert len(said.reasons) < 10
    assert said.reasons[0].startswith("200 runs are left out (r0, r1, r2")
    assert any(reason.startswith("100 runs (t0, t1") for reason in said.reasons)
    assert said.verdict == "warning"


def test_sentences_that_differ_in_numbers_only_are_one_kind():
    assert kind_of("lasts 0.53 s, -1e-3 N m") == kind_of("lasts 12 s, +4.5 N m")
    assert kind_of("torque_in is dead") != kind_of("torque_out is dead")


@pytest.mark.parametrize("rpm", SPEEDS)
def test_any_number_of_runs_leaves_room_for_what_slowing_shafts_do_to_the_slope(rpm):
    truth = gearbox_truth({})
    motion = cycle.run_motion(truth, rpm * RPM, 1.0)
    events = cycle.events(truth, motion)
    rise = (motion.time > events["brake_onset"] - 0.5) & (motion.time < events["unlock"])
    x, y = motion.torque_in[rise], motion.torque_out[rise]
    found = total_least_squares(x - x.mean(), y - y.mean())
    told = _not_quite_steady(Transfer("brake", found, 0.0, 0.5, 0.0, np.inf), [])
    low, high = told.slope_ci95
    assert low < truth.a < high
    assert told.slope_error < 0.01 * found


def test_few_runs_of_a_speed_that_lie_close_by_chance_are_known_to_the_scatter_of_all_speeds():
    rng = np.random.default_rng(4)
    own, gains = 1.0, 2.0
    inside = 0
    for _ in range(300):
        groups = [(rng.normal(0.0, np.hypot(own, gains), 3), np.full(3, own)) for _ in range(8)]
        values, errors = groups[0]
        mean, error, dof = mean_of_runs(values, errors, np.full(3, 20.0), np.zeros(3), scatter_of_groups(groups))
        inside += abs(mean) < t_quantile(dof) * error
    assert inside >= 0.93 * 300


def without_speed(run, speed):
    reason = f"input speed assumed nominal: {speed} rad/s"
    return Parameter(name="speed_in_sos", symbol="w", unit="rad/s", value=None, at={"run": run}, description=reason)


def test_missing_numbers_of_many_runs_that_differ_by_their_speed_are_one_line():
    lacking = [without_speed(f"r{k}", 6.0 + k % 3) for k in range(48)]
    assert len(missing(lacking)) == 3
    (told,) = missing(lacking, many=True)
    assert told.startswith("Missing in 48 runs (r0, r1, r2, ")
    assert "numbers differ" in told


class Campaign:
    """The part of a campaign of which `over_campaign` tells."""

    def __init__(self, watched, exceptions, runs):
        self.watched, self.exceptions, self.runs = watched, exceptions, runs


def test_one_bad_day_is_told_one_way_and_its_number_once():
    runs = [f"r{k:02d}" for k in range(60)]
    noise = np.random.default_rng(2).standard_normal((2, 60))
    bad = (np.arange(60) >= 30) & (np.arange(60) < 38)
    day = over_runs("torque", "N*m", runs, 1.0 + 0.002 * noise[0] + 0.02 * bad)
    (spell,) = day.course.changes
    alone = over_runs("drag", "N*m", runs, 1.0 + 0.002 * noise[1])
    odd = tuple(Odd(int(place), 0.05, 25.0, 30.0) for place in np.flatnonzero(bad))
    alone = replace(alone, course=replace(alone.course, changes=(), odd=odd))
    said = Judgement()
    over_campaign(said, Campaign((day, alone), {runs[odd_one.place]: "torque" for odd_one in odd}, runs))
    (told,) = [reason for reason in said.reasons if reason.startswith("From run")]
    assert told.startswith(f"From run {runs[spell.first]} to run {runs[spell.last]}")
    assert "drag by about +5.0 %" in told
    (names,) = [reason for reason in said.reasons if "unlike the others" in reason]
    assert names.count("torque") == 1
    assert "r30, r31, r32" in names
