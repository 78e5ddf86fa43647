"""The paper's numbers (gearbox.md, section 4) against figures computed by hand there."""

from __future__ import annotations

import pytest

from pipeline.rigs.gearbox.outcome.paper import paper_alone, paper_line
from pipeline.rigs.gearbox.outcome.paper_kinematics import kinematics_alone

ROWS = {row.name: row for row in (*paper_alone(), *kinematics_alone())}


def test_every_row_is_of_the_paper_alone() -> None:
    assert all(row.basis == "paper" for row in ROWS.values())


@pytest.mark.parametrize(
    ("name", "published", "found"),
    [
        ("torque reduction, output, 120 rpm", 0.57, 0.423),
        ("torque reduction, input, 120 rpm", 0.65, 0.350),
        ("torque reduction, output, 210 rpm", 0.63, 0.367),
        ("torque reduction, input, 210 rpm", 0.76, 0.2375),
        ('"inertial mass" M_I, input, 120 rpm', 0.89, 0.44),
        ("friction torque T_f, input, 120 rpm", 1.23, 0.76),
        ("efficiency", 0.40, 0.319),
    ],
)
def test_what_the_papers_own_definitions_give(name: str, published: float, found: float) -> None:
    row = ROWS[name]
    assert row.published == published
    assert row.found == pytest.approx(found, abs=5e-4)
    assert row.agrees is False


def test_four_states_lie_on_one_line() -> None:
    line = paper_line(120)
    assert (line.slope, line.intercept) == (pytest.approx(0.5443, abs=5e-5), pytest.approx(-0.2104, abs=5e-5))
    assert line.largest_residual < 0.003
    both = paper_line(120, 210)
    assert (round(both.slope, 3), round(both.slope_error, 3), round(both.r2, 3)) == (0.561, 0.032, 0.981)
    assert (round(both.intercept, 3), round(both.intercept_error, 3)) == (-0.216, 0.053)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("input power in SOS", "17.7 W and 40.2 W"),
        ("locked drag T_0, lock torque, slip torque at 120 rpm", "0.387, 1.783, 1.023 N m"),
        ("mesh frequencies in SOS", "280, 80 and 490, 140 Hz"),
        ("tangential force on the carriers' pins, 120 rpm brake peak", "34.6 N"),
        ("speeds of ring, sun and planets in SOS", "planets 2 -109.1 / -190.9"),
    ],
)
def test_derived_figures_of_the_sheet(name: str, words: str) -> None:
    assert words in str(ROWS[name].found)


def test_remarks_name_what_the_software_reports() -> None:
    told = " ".join(row.remark for row in ROWS.values())
    for name in ("torque_relief_in", "torque_residual_out", "startup_excess_in", "breakaway_drop_in", "breakaway_rise_in",
                 "efficiency_fos", "torque_ratio_sos", "power_dissipated_sos", "speed_in_sos", "inertia_load"):  # fmt: skip
        assert name in told
