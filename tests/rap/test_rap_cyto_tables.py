"""Tables of samples as laboratories write them, and what is wrong with some."""

import math

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Recording, Stream
from pipeline.report.parameters import key_table
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.cytotoxicity.check import check
from pipeline.rigs.rap.cytotoxicity.declaration import CYTOTOXICITY, OUTCOMES, CytotoxicitySettings
from pipeline.rigs.rap.cytotoxicity.groups import is_control, is_positive
from pipeline.rigs.rap.cytotoxicity.methods import methods
from pipeline.rigs.rap.cytotoxicity.sections import sections

TIMES = (0.0, 1800.0, 3600.0, 10800.0, 21600.0)
SHARES = {"viability": 0.92, "necrosis": 0.03, "apoptosis": 0.05}


def _rows(control_at=(0.0,), treated_at=TIMES, n=4, words=("control", "treated"), seed=0):
    rng = np.random.default_rng(seed)
    rows = []
    for word, times in zip(words, (control_at, treated_at), strict=True):
        for t in times:
            for i in range(n):
                lack = 0.015 * rng.standard_normal()
                rows.append((t, word, str(i + 1), 0.92 + lack, 0.03 - 0.4 * lack, 0.05 - 0.6 * lack))
    return sorted(rows, key=lambda row: row[0])


def _recording(rows, run="cells", drop=(), factor=1.0, **more):
    time = np.array([row[0] for row in rows])
    for i in range(1, time.size):
        time[i] = max(time[i], time[i - 1] + 1e-6)
    columns = {
        "group": Channel("group", np.array([row[1] for row in rows], object), ""),
        "replicate": Channel("replicate", np.array([row[2] for row in rows], object), ""),
        **{
            name: Channel(name, factor * np.array([row[3 + i] for row in rows]), "1") for i, name in enumerate(OUTCOMES)
        },
        **{name: Channel(name, np.asarray(values), "1") for name, values in more.items()},
    }
    kept = {name: channel for name, channel in columns.items() if name not in drop}
    return Recording(run, {"cells": Stream("cells", time, kept)}, {})


def _identify(*recordings, **settings):
    return CYTOTOXICITY.identify(list(recordings), CytotoxicitySettings(**settings), Context("c", {}))


def _value(findings, time=1800.0, outcome="viability"):
    return findings.one(f"{outcome}_difference", time=time).value


def test_control_once_and_control_at_each_time_are_understood():
    for control_at, word in (((0.0,), "once"), (TIMES, "each"), ((0.0, 21600.0), "some")):
        findings = _identify(_recording(_rows(control_at)))
        assert set(findings.arrays["outcomes"]["control"]) == {word}
        assert all(p.value is not None for p in findings.parameters)
    rows = _rows(TIMES)
    at = [row for row in rows if row[0] == 3600.0]
    expected = np.mean([r[3] for r in at if r[1] == "treated"]) - np.mean([r[3] for r in at if r[1] == "control"])
    assert _value(_identify(_recording(rows)), 3600.0) == pytest.approx(expected)


@pytest.mark.parametrize(
    "words",
    [("CTRL", "RAP"), ("Kontrolle", "Gerät"), ("0", "1"), ("untreated", "exposed"), ("Negative control", "device 2")],
)
def test_groups_bear_other_words(words):
    assert _identify(_recording(_rows(words=words))).verdict == "ok"


def test_a_positive_control_is_no_control():
    assert is_control("neg. control")
    assert not is_control("positive control")
    assert is_positive("Triton X")
    rows = sorted([*_rows(), *((0.0, "positive control", str(i), 0.1, 0.5, 0.4) for i in range(4))], key=lambda r: r[0])
    findings = _identify(_recording(rows))
    assert _value(findings) == pytest.approx(_value(_identify(_recording(_rows()))))
    assert any("positive control" in q.message for q in findings.quality)


def test_two_treated_groups_are_asked_back_and_the_recipe_answers():
    rows = sorted(
        [*_rows(words=("control", "filter A")), *_rows((), words=("", "filter B"), seed=9)], key=lambda r: r[0]
    )
    with pytest.raises(InputError, match="treated_group"):
        _identify(_recording(rows))
    findings = _identify(_recording(rows), treated_group="filter A")
    assert _value(findings) == pytest.approx(_value(_identify(_recording(_rows()))))
    with pytest.raises(InputError, match="filter C"):
        _identify(_recording(rows), treated_group="filter C")


def test_no_control_gives_nulls_that_say_so():
    findings = _identify(_recording(_rows(())))
    assert findings.verdict == "rejected"
    assert all(p.value is None and "control" in p.description for p in findings.parameters)
    assert any("no control" in q.message for q in check(_recording(_rows(()))))
    sections(findings)


def test_a_control_in_a_log_of_its_own_is_used():
    rows = _rows()
    control, treated = ([r for r in rows if r[1] == word] for word in ("control", "treated"))
    findings = _identify(
        _recording(control, "control", drop=("group", "replicate")),
        _recording(treated, "rap", drop=("group", "replicate")),
    )
    assert findings.verdict == "ok"
    assert _value(findings) == pytest.approx(_value(_identify(_recording(rows))))


def test_one_culture_each_gives_no_interval():
    findings = _identify(_recording(_rows(n=1)))
    assert all(p.value is None for p in findings.parameters)
    assert "points" in findings.one("viability_difference", time=1800.0).description
    assert set(findings.arrays["outcomes"]["verdict"]) == {"inconclusive"}
    assert check(_recording(_rows(n=1)))


def test_repeats_of_one_culture_are_no_cultures():
    rows = _rows()
    doubled = sorted([*rows, *rows], key=lambda r: r[0])
    once, twice = _identify(_recording(rows)), _identify(_recording(doubled))
    assert twice.one("viability_difference", time=3600.0).ci95 == pytest.approx(
        once.one("viability_difference", time=3600.0).ci95
    )
    assert any("repeat" in q.message for q in twice.quality)


def test_means_with_their_scatter_and_number_give_the_same_as_single_cultures():
    rows = _rows()
    cells: dict = {}
    for row in rows:
        cells.setdefault((row[0], row[1]), []).append(row[3:])
    keys = sorted(cells)
    means = [(t, word, "", *np.mean(cells[t, word], axis=0)) for t, word in keys]
    spread = np.array([np.std(cells[key], axis=0, ddof=1) for key in keys])
    summary = _recording(means, n=[4.0] * len(keys), **{f"{name}_sd": spread[:, i] for i, name in enumerate(OUTCOMES)})
    single, found = _identify(_recording(rows)), _identify(summary)
    for p in single.parameters:
        assert found.one(p.name, **p.at).ci95 == pytest.approx(p.ci95)


def test_a_missing_time_leaves_the_claim_open():
    findings = _identify(_recording(_rows(treated_at=TIMES[:-1])))
    assert findings.one("viability_difference", time=21600.0).value is None
    assert set(findings.arrays["outcomes"]["verdict"]) == {"inconclusive"}
    assert any("360 min" in reason for reason in findings.reasons)
    assert _identify(_recording(_rows(treated_at=TIMES[:-1])), times=TIMES[:-1]).verdict == "ok"


def test_samples_a_minute_late_belong_to_their_time():
    rows = [(t + 20.0 * int(i), g, i, *v) for t, g, i, *v in _rows()]
    findings = _identify(_recording(sorted(rows, key=lambda r: r[0])))
    assert {p.at["time"] for p in findings.parameters} == set(TIMES)


def test_minutes_taken_for_seconds_are_told():
    rows = [(row[0] / 60.0, *row[1:]) for row in _rows()]
    findings = _identify(_recording(rows))
    assert findings.verdict == "warning"
    assert any("minutes taken for seconds" in q.message for q in findings.quality)


def test_percent_without_a_unit_is_read_as_percent_and_told():
    findings = _identify(_recording(_rows(), factor=100.0))
    assert _value(findings) == pytest.approx(_value(_identify(_recording(_rows()))))
    assert any("percent" in reason for reason in findings.reasons)


def test_percent_in_some_samples_only_is_refused():
    rows = _rows()
    rows[5] = (*rows[5][:3], 100 * rows[5][3], *rows[5][4:])
    with pytest.raises(InputError, match="mixed"):
        _identify(_recording(rows))
    with pytest.raises(InputError, match="mixed"):
        check(_recording(rows))


def test_one_column_in_percent_beside_fractions_is_told():
    rows = [(*row[:4], 100 * row[4], row[5]) for row in _rows()]
    findings = _identify(_recording(rows))
    assert any("necrosis" in reason and "percent" in reason for reason in findings.reasons)
    assert abs(_value(findings, outcome="necrosis")) < 0.05


def test_more_than_all_cells_and_shares_that_do_not_sum_are_told():
    rows = _rows()
    rows[7] = (*rows[7][:3], 1.04, *rows[7][4:])
    messages = " ".join(q.message for q in _identify(_recording(rows)).quality)
    assert "more than 100 %" in messages
    assert "do not sum to 100 %" in messages


def test_a_lost_count_is_told_and_costs_that_sample_only():
    rows = _rows()
    rows[7] = (*rows[7][:3], math.nan, *rows[7][4:])
    findings = _identify(_recording(rows))
    assert any("viability is missing in 1 of" in q.message and q.level == "warning" for q in findings.quality)
    assert all(p.value is not None for p in findings.parameters)


def test_the_report_s_numbers_are_in_points_and_minutes():
    findings = _identify(_recording(_rows()))
    row = key_table(findings, CYTOTOXICITY).rows[-1]
    assert "time 360 min" in row[0].text
    assert str(row[2].text) == "%"
    assert float(row[1].text.split("±")[0].replace("−", "-")) == pytest.approx(
        100 * _value(findings, time=21600.0), abs=0.06
    )


def test_a_negative_share_is_refused():
    rows = _rows()
    rows[7] = (*rows[7][:4], -0.02, rows[7][5])
    with pytest.raises(InputError, match="not negative"):
        _identify(_recording(rows))


def test_a_lost_culture_is_named():
    rows = _rows()
    rows[9] = (*rows[9][:3], 0.55, *rows[9][4:])
    assert any("others of its time" in q.message for q in _identify(_recording(rows)).quality)


def test_sound_tables_raise_no_doubt():
    doubts = [q for seed in range(60) for q in check(_recording(_rows(seed=seed)))]
    assert len(doubts) <= 1


def test_viability_alone_leaves_the_others_null():
    findings = _identify(_recording(_rows(), drop=("necrosis", "apoptosis")))
    assert findings.verdict == "warning"
    assert all(p.value is None for p in findings.find("necrosis_difference"))
    assert len(findings.find("necrosis_difference")) == 5


def test_two_runs_stand_side_by_side():
    findings = _identify(_recording(_rows(seed=1), "monday"), _recording(_rows(seed=2), "tuesday"))
    assert {p.at["run"] for p in findings.parameters} == {"monday", "tuesday"}
    assert len(sections(findings)) == 3


def test_report_and_methods_tell_the_interval_and_the_margins():
    findings = _identify(_recording(_rows()))
    assert "two one-sided" in " ".join(methods(findings))
    figure = sections(findings)[0].blocks[1]
    assert [panel.title for panel in figure.panels] == list(OUTCOMES)
    assert {row.basis for row in findings.published} == {"logs", "paper"}


def test_the_papers_own_arithmetic():
    rows = {row.name: row for row in _identify(_recording(_rows())).published}
    assert rows["passes of the medium through the device in 6 h"].found == pytest.approx(72.0)
    assert rows["duration of the cell test against the battery"].agrees is False


def test_numbers_of_samples_are_not_taken_for_numbers_of_cultures():
    rows = _rows()
    numbered = _recording(rows, n=[float(row[2]) for row in rows])
    plain = _identify(_recording(rows)).one("viability_difference", time=3600.0)
    assert _identify(numbered).one("viability_difference", time=3600.0).ci95 == pytest.approx(plain.ci95)
