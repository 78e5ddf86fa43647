"""Rows that follow from the paper alone: the numbers and verdicts of mre.md section 4, each row once."""

from __future__ import annotations

import pytest

from pipeline.rigs.mre.paper import axial_rows, hold_rows, row, shear_rows, shore_modulus, stiffness_by_geometry

ROWS = {found.name: found for found in (*axial_rows(), *shear_rows(), *hold_rows())}


def test_every_row_stands_in_one_experiment_and_is_of_the_paper_alone() -> None:
    assert len(ROWS) == len(axial_rows()) + len(shear_rows()) + len(hold_rows())
    assert {found.basis for found in ROWS.values()} == {"paper"}
    assert row("", None, None, None, "").basis == "paper"


@pytest.mark.parametrize(
    ("name", "found", "agrees"),
    [
        ("shear modulus without field", 0.658125e6, True),
        ("Young's modulus", 1.5795e6, False),
        ("axial stiffness E A/h", 516.9e3, None),
        ("best volume fraction by eq. (4) at a fixed gap", 0.2663, True),
        ("axial stiffening at 2 A by eq. (8), at most", 0.318, False),
        ("axial stiffening at 2 A by eq. (4), touching spheres", 0.656, True),
        ("2 G A/h of the two pads", 430.7e3, None),
        ("density of a compound with 25 % powder", 2775.0, False),
        ("matrix modulus G_0 from Shore A 10", 0.1376e6, False),
        ("Young's modulus from Shore A 33", 1.289e6, False),
        ("field during curing", 0.257, False),
        ("ampere-turns of 1500 turns at 4 A", 6000.0, True),
        ("wire of 1500 turns", 396.0, False),
        ("coil resistance", 6.54, True),
        ("power at 4 A", 110.4, True),
        ("ampere-turns at 6 A", 9000.0, False),
        ("pull of the poles at 0.8 T on the area of a pad", 500.0, None),
        ("strain at 700 N preload, at most for Hooke's law", 0.2257, False),
        ("force increment at 2 A by the straight line to 6 A, beside the stiffening there", 0.21, False),
    ],
)
def test_number_and_verdict(name: str, found: float, agrees: bool | None) -> None:
    assert ROWS[name].found == pytest.approx(found, rel=2e-3)
    assert ROWS[name].agrees is agrees


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Young's modulus", ["1.584", "0.193", "0.654"]),
        ("axial stiffness E A/h", ["513.8", "518.4", "9.68", "2.083"]),
        ("density of a compound with 25 % powder", ["22.3 %", "6.7 %"]),
        ("amplitudes at the four shear stiffnesses", ["0.504", "0.764", "0.917", "1.070"]),
        ("stiffness from 200 N to 700 N preload, 0 A and 6 A", ["+29 %", "+40 %"]),
        ("power at 4 A", ["248 W"]),
        ("wire of 1500 turns", ["207 mm", "264 mm"]),
    ],
)
def test_what_else_the_sheet_computes_is_told(name: str, words: list[str]) -> None:
    assert all(word in ROWS[name].remark for word in words)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("amplitudes at the four shear stiffnesses", "0.606, 0.400, 0.333, 0.286 mm"),
        ("MR effect from the printed stiffness, 200 N and 700 N", "81.8 %, 40.0 %"),
        ("stiffness from 200 N to 700 N preload, 0 A and 6 A", "+51.5 %, +16.7 %"),
        ("friction that 200 N over two pads needs, at 200 N and 700 N", "0.50, 0.14"),
        ("gap that 10000 and 6000 ampere-turns magnetise to 0.8 T", "15.7 mm, 9.4 mm"),
        ("wire gauge of 1.02 mm", "AWG 18"),
    ],
)
def test_numbers_that_are_told_together(name: str, found: str) -> None:
    assert ROWS[name].found == found


def test_relations() -> None:
    assert shore_modulus(10.0) == pytest.approx(0.413e6, abs=500)
    assert stiffness_by_geometry(700.0, 0.5) / stiffness_by_geometry(200.0, 0.5) == pytest.approx(1.40, abs=0.005)
