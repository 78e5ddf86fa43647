"""The chapter on micromechanics is made from findings alone, and says what it lacks."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pipeline.findings import Findings, Parameter, Run
from pipeline.findings.figures import Figure, Line, Points, Table, Text, Value
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.mre.flux_levels import flux_levels
from pipeline.rigs.mre.micromechanics.given import flux_of, increments_of
from pipeline.rigs.mre.micromechanics.sections import sections

COMPOUND = {"powder_fraction": 0.25, "matrix_shear_modulus": 0.3e6}


def findings(conditions: dict[str, float | str | bool], *parameters: Parameter, flux: bool = False) -> Findings:
    arrays = {"flux_levels": pd.DataFrame({"current": [2.0, 6.0], "flux_density": [0.3, 0.75]})} if flux else {}
    return Findings(
        campaign="", experiment="mre.axial", verdict="ok", parameters=list(parameters), arrays=arrays,
        runs=[Run(run="a", conditions=conditions), Run(run="b", used=False, conditions={"powder_fraction": 0.9})],
    )  # fmt: skip


def measured(name: str, value: float, current: float, **at: float) -> Parameter:
    return Parameter(
        name=name, symbol="", value=value, std_error=0.01, ci95=(value - 0.02, value + 0.02), unit="1",
        at={"coil_current": current, **at},
    )  # fmt: skip


def text_of(found: Findings) -> str:
    return " ".join(p for b in sections(found)[0].blocks if isinstance(b, Text) for p in b.paragraphs)


def test_other_devices_get_no_chapter_and_half_a_compound_is_told() -> None:
    assert sections(findings({"coil_current": 2.0})) == []
    (chapter,) = sections(findings({"powder_fraction": 0.25}))
    assert "matrix_shear_modulus" in text_of(findings({"powder_fraction": 0.25}))
    assert len(chapter.blocks) == 1


def test_compounds_that_differ_from_run_to_run_are_not_taken() -> None:
    found = findings(dict(COMPOUND))
    found.runs.append(Run(run="c", conditions={**COMPOUND, "powder_fraction": 0.3}))
    assert "powder_fraction" in text_of(found)
    assert len(sections(found)[0].blocks) == 1


def test_lines_of_both_lattices_and_both_demagnetising_factors() -> None:
    (chapter,) = sections(findings(dict(COMPOUND)))
    over_flux = next(b for b in chapter.blocks if isinstance(b, Figure))
    lines = {m.label: m for m in over_flux.panels[0].marks if isinstance(m, Line)}
    assert set(lines) == {f"{lattice}, N = {n}" for lattice in ("fixed gap", "cubic") for n in ("0", "1/3")}
    at = lines["fixed gap, N = 1/3"]
    assert np.interp(0.8, at.x, at.y) == pytest.approx(0.64, abs=0.005)
    assert np.interp(0.8 / 3, at.x, at.y) == pytest.approx(0.096, abs=0.002)
    claims = next(b for b in chapter.blocks if isinstance(b, Table))
    told = {str(row[0]): row[2] for row in claims.rows}
    assert told["increment, cubic, saturated, any N"] == "31.8 %"
    assert told["increment, fixed gap, saturated, any N"] == "66.7 %"
    assert told["increment, fixed gap, N = 0, 0.267 T"] == "65.6 %"


def test_the_caption_tells_which_form_of_the_theory_comes_nearest() -> None:
    def caption(*parameters: Parameter) -> str:
        found = findings({**COMPOUND, "flux_per_current": 0.8 / 6}, *parameters)
        return next(b for b in sections(found)[0].blocks if isinstance(b, Figure)).caption

    near = caption(measured("stiffening_secant", 0.096, 2.0), measured("stiffening_secant", 0.74, 6.0))
    assert "fixed gap, N = 1/3 comes nearest, 4.9 percentage points off the 2 measured increments on average" in near
    assert "1 of the 95 % intervals holds its prediction" in near
    assert "cubic, N = 1/3 comes nearest, 0.4 percentage points off the measured increment;" in caption(
        measured("stiffening_secant", 0.05, 2.0)
    )
    assert "no increment was measured" in caption()


def test_measured_increments_stand_at_the_measured_flux_else_at_the_assumed_else_in_no_place() -> None:
    stiffening = measured("stiffening_secant", 0.68, 2.0)
    known = findings(dict(COMPOUND), stiffening, flux=True)
    assert "as measured" in text_of(known)
    assert _points(known).x[0] == pytest.approx(0.3)
    assumed = findings({**COMPOUND, "flux_per_current": 0.8 / 6}, stiffening)
    assert "assumed" in text_of(assumed)
    assert _points(assumed).x[0] == pytest.approx(0.2667, abs=1e-4)
    unknown = findings(dict(COMPOUND), stiffening)
    assert "flux_per_current" in text_of(unknown)
    assert not any(
        isinstance(m, Points) for b in sections(unknown)[0].blocks if isinstance(b, Figure) for m in b.panels[0].marks
    )
    table = next(b for b in sections(unknown)[0].blocks if isinstance(b, Table) and b.name == "micromechanics_measured")
    assert isinstance(table.rows[0][3], Value)
    assert table.rows[0][4] is None


def _points(found: Findings) -> Points:
    (chapter,) = sections(found)
    return next(m for b in chapter.blocks if isinstance(b, Figure) for m in b.panels[0].marks if isinstance(m, Points))


def test_flux_is_not_told_beyond_the_measured_currents() -> None:
    flux = flux_of(findings(dict(COMPOUND), flux=True))
    assert flux is not None
    assert flux.at(-2.0) == pytest.approx(0.3)
    assert flux.at(1.0) == pytest.approx(0.15)
    assert np.isnan(flux.at(8.0))


def test_increments_of_every_experiment_are_known_by_their_names() -> None:
    found = findings(
        dict(COMPOUND), measured("force_increment", 0.63, 6.0), measured("mr_effect_amplitude", 0.69, 6.0, preload=200.0),
        Parameter(name="k2", symbol="", value=2.6e5, std_error=100.0, unit="N/m"), measured("k_mr", 2.265e5, 6.0),
    )  # fmt: skip
    told = {one.what: one.value for one in increments_of(found)}
    assert told == {
        "force at a fixed gap": 0.63, "shear stiffness at equal amplitude, 200 N": 0.69,
        "static shear stiffness, large strain: k_2": pytest.approx(0.871, abs=1e-3),
    }  # fmt: skip
    rich = findings(
        dict(COMPOUND), Parameter(name="k2", symbol="", value=2.6e5, unit="N/m", at={"coil_current": 0.0}),
        Parameter(name="k2", symbol="", value=4.865e5, unit="N/m", at={"coil_current": 6.0}),
    )  # fmt: skip
    assert [one.value for one in increments_of(rich)] == [pytest.approx(0.871, abs=1e-3)]


def test_the_static_increment_is_smaller_at_small_strain_where_the_bouc_wen_spring_carries_too() -> None:
    def at(name: str, value: float, current: float) -> Parameter:
        return Parameter(
            name=name, symbol="", value=value, std_error=1e-3 * value, unit="", at={"coil_current": current}
        )

    truth = {"k2": (2.6e5, 4.865e5), "alpha_bw": (40.0, 40.0), "rho": (4000.0, 4000.0)}
    rich = findings(dict(COMPOUND), *(at(name, both[k], 6.0 * k) for name, both in truth.items() for k in (0, 1)))
    shear = findings(
        dict(COMPOUND), measured("k_mr", 2.265e5, 6.0),
        *(Parameter(name=n, symbol="", value=both[0], std_error=1e-3 * both[0], unit="") for n, both in truth.items()),
    )  # fmt: skip
    for found in (rich, shear):
        told = {one.what: one for one in increments_of(found)}
        small = told["static shear stiffness, small strain: k_2 + a_BW ρ"]
        assert small.value == pytest.approx(2.265e5 / 4.2e5, rel=1e-6)
        assert small.low < small.value < small.high
        assert told["static shear stiffness, large strain: k_2"].value == pytest.approx(2.265e5 / 2.6e5, rel=1e-6)


def test_flux_levels_of_runs_are_the_medians_of_what_they_log() -> None:
    time = np.arange(5.0)
    channels = {
        "flux_density": Channel("flux_density", np.array([0.3, 0.31, np.nan, 0.29, 0.3]), "T"),
        "current": Channel("current", np.full(5, 2.01), "A"),
    }
    labelled = {"flux_density": channels["flux_density"]}
    table = flux_levels(
        [
            Recording("a", {"": Stream("", time, channels)}, {"coil_current": 2.0}),
            Recording("b", {"": Stream("", time, labelled)}, {"coil_current": 4.0}),
            Recording("c", {"": Stream("", time, labelled)}),
            Recording("d", {"": Stream("", time, {"current": channels["current"]})}),
        ]
    )
    assert table.to_numpy().tolist() == [["a", 2.01, 0.3], ["b", 4.0, 0.3]]
