"""mre.shear_rich on the example campaign's records: names, accuracy, both methods, the paper's assumption."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from faulty_logs import with_conditions
from rich_logs import TRUTH, identify, rich, true_values

from pipeline.findings import Findings
from pipeline.rigs.mre.rich import captions
from pipeline.rigs.mre.rich.declaration import SHEAR_RICH
from pipeline.rigs.mre.synthetic import synthesize_rich

NAMES = ("k1", "s1", "tau", "k2", "alpha_bw", "rho", "c_bw", "n_bw")


@cache
def both() -> Findings:
    return identify(rich(0.0, 1, 60.0), rich(6.0, 2, 60.0))


def test_every_name_of_the_sheet_stands_at_its_current_within_the_sheets_errors() -> None:
    for current, near in ((0.0, 0.0042), (6.0, 0.006)):
        truth = true_values(current)
        for name in NAMES:
            found = both().one(name, coil_current=current)
            assert found.value == pytest.approx(truth[name], rel=near), (name, current)
            assert found.at == {"coil_current": current}
    assert not both().find("s_mr", coil_current=0.0)
    assert both().one("s_mr", coil_current=6.0).value == pytest.approx(360.0, rel=0.03)
    assert both().one("force_lag", coil_current=0.0).value == pytest.approx(60e-6, abs=5e-6)
    assert both().verdict == "ok"


def test_k2_with_a_field_says_what_it_holds() -> None:
    assert "k2 + k_MR" in both().one("k2", coil_current=6.0).description
    assert "k2 + k_MR" not in both().one("k2", coil_current=0.0).description


def test_every_yielded_name_is_declared() -> None:
    assert {p.name for p in both().parameters} <= {spec.name for spec in SHEAR_RICH.parameters}


def test_the_batch_fit_is_reported_and_the_filter_stands_beside_it() -> None:
    models = {model.name: model for model in both().models}
    assert [name for name, model in models.items() if model.selected] == ["batch rich_0a", "batch rich_6a"]
    assert "Kalman" in models["online filter rich_0a"].description
    table = both().arrays["side_by_side"].set_index(["run", "name"])
    for name in NAMES:
        row = table.loc[("rich_0a", name)]
        assert row["batch"] == both().one(name, coil_current=0.0).value
        assert row["online"] == pytest.approx(row["batch"], rel=0.05)
    assert set(both().arrays["records"]["online"]) == {"converged"}
    assert {"k1", "k1_low", "k1_high", "time"} <= set(both().arrays["online"].columns)


def test_the_cycles_drawn_are_whole_and_of_three_sizes() -> None:
    for _, record in both().arrays["cycles"].groupby("run"):
        spans = []
        for _, cycle in record.groupby("cycle"):
            x, steps = cycle["displacement"], np.diff(cycle["time"])
            assert steps.max() == pytest.approx(steps.min()), "every sample of it"
            assert min(abs(x.iloc[0] - end) for end in (x.min(), x.max())) < 0.1 * np.ptp(x), "from turn to turn"
            assert abs(x.iloc[-1] - x.iloc[0]) < 0.25 * np.ptp(x), "and back"
            spans.append(np.ptp(x) / 2)
        # The record's amplitude swings from 0.1 to 0.6 mm.
        assert len(spans) == 3
        assert spans[0] < 0.2e-3 < spans[1] < 0.5e-3 < spans[2]


def test_captions_answer_from_the_findings_and_say_what_is_lacking() -> None:
    arrays = {name: both().arrays[name] for name in ("records", "side_by_side", "online")}
    records, ends, online = arrays.values()
    assert captions.reaches(records, ends).startswith("Yes: amplitudes lie on both sides of 1/rho = 0.25 mm")
    small = records.assign(amplitude_high=2e-4, frequency_high=6.0)
    assert captions.reaches(small, ends).startswith(
        "Not everywhere: rich_0a lacks amplitudes above 1.5/rho and frequencies above 1/(2π tau); rich_6a lacks"
    )
    assert captions.reaches(records, ends.assign(batch=np.nan)) == (
        "Not told of rich_0a, rich_6a, where rho or tau is not determined."
    )
    assert captions.trusted(records.assign(online="diverged")) == "In no record: its numbers are not to be used."
    first, part = ends[ends["run"] == "rich_0a"], online[online["run"] == "rich_0a"]
    assert re.fullmatch(
        r"From \d+ s on it stays within 5 % of it; \w+ is found last\.", captions.found_online(part, first)
    )
    assert captions.found_online(part.assign(rho=5e3), first) == "It does not: rho is more than 5 % off it at the end."
    assert captions.agree(first).startswith("Yes: all 9 lie within")
    moved = first.assign(batch=first["batch"].where(first["name"] != "k2", 1.0), difference=2.0)
    assert captions.agree(moved) == "8 of 9 within the 95 % that the filter claims; not k2 (+200.0 %)."
    k2 = [both().one("k2", coil_current=level) for level in (0.0, 6.0)]
    assert captions.added(k2, None, "ok").startswith("From 0 to 6 A 226.")
    assert captions.added(k2, None, "rejected") == "Not told: the model does not hold."
    assert captions.added(k2[:1] * 2, None, "ok") == "Not told: the records are all at one current."


def test_records_agree_in_what_the_paper_takes_for_common() -> None:
    table = both().arrays["agreement"]
    assert table["p_value"].iloc[0] > 0.001
    assert table["dof"].iloc[0] == 6
    k1 = table[(table["run"] == "rich_0a") & (table["name"] == "k1")].iloc[0]
    assert k1["common"] == pytest.approx(TRUTH.k1, rel=0.002)


def test_a_hysteretic_force_that_grows_with_the_field_contradicts_the_assumption_and_is_found() -> None:
    overrides = {"alpha_mr": {6.0: 20.0}, "rate": 2000.0}
    logs = [synthesize_rich(overrides, seed, current, 20.0) for seed, current in ((3, 0.0), (4, 6.0))]
    findings = identify(*logs, online=False)
    assert findings.arrays["agreement"]["p_value"].iloc[0] < 1e-6
    assert any("the field changes more than k_MR and s_MR" in reason for reason in findings.reasons)
    assert findings.one("alpha_bw", coil_current=6.0).value == pytest.approx(60.0, rel=0.01)


def test_the_model_predicts_fig_17() -> None:
    rows = {row.name: row for row in both().published}
    assert rows["stiffness at 200 N preload, 0 A"].found == pytest.approx(329.6e3, rel=0.003)
    assert rows["stiffness at 200 N preload, 6 A"].found == pytest.approx(599.7e3, rel=0.003)
    effect = rows["MR effect at 200 N preload, 6 A, equal force"]
    assert effect.found == pytest.approx(0.82, abs=0.005)
    assert effect.agrees


@pytest.mark.thorough
def test_intervals_hold_the_truth() -> None:
    held, count = 0, 0
    for seed in range(5):
        findings = identify(rich(6.0, 10 + seed), online=False)
        truth = true_values(6.0)
        for p in findings.parameters:
            if p.name in truth and p.ci95 is not None:
                held += p.ci95[0] <= truth[p.name] <= p.ci95[1]
                count += 1
    assert count >= 45
    assert held / count > 0.85


def test_two_records_at_one_current_are_told_apart_by_their_run() -> None:
    findings = identify(rich(), replace(rich(seed=5), run="again"), online=False)
    assert [p.at for p in findings.find("k1")] == [
        {"coil_current": 0.0, "run": "rich_0a"},
        {"coil_current": 0.0, "run": "again"},
    ]


def test_another_preload_is_part_of_the_operating_point() -> None:
    other = with_conditions(replace(rich(seed=5), run="loaded"), preload=700.0)
    findings = identify(rich(), other, online=False)
    assert {float(p.at["preload"]) for p in findings.find("k1")} == {200.0, 700.0}


def test_without_conditions_of_the_pads_the_model_is_fitted_all_the_same() -> None:
    from faulty_logs import without_channel

    bare = with_conditions(
        without_channel(rich(), "current"), coil_current=None, preload=None, pad_height=None, n_pads=None
    )
    findings = identify(bare, online=False)
    assert findings.one("k2").at == {}
    assert findings.one("k2").value == pytest.approx(2.6e5, rel=0.005)
    assert not findings.published


def test_other_pads_at_another_rate() -> None:
    overrides = {
        "rate": 500.0,
        "k1": 2e4,
        "s1": 900.0,
        "k2": 8e4,
        "alpha_bw": 25.0,
        "rho": 6000.0,
        "c_bw": 1.1,
        "n_bw": 1.9,
    }
    log = synthesize_rich(overrides, 6, 0.0, 60.0)
    findings = identify(with_conditions(log, pad_diameter=0.03, pad_height=0.004))
    for name, value in overrides.items():
        if name != "rate":
            assert findings.one(name).value == pytest.approx(value, rel=0.02), name
    assert np.isfinite(findings.arrays["records"]["innovation"].iloc[0])
