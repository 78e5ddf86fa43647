"""From gaps to motion, and which probes lie."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.tpjb.probe_faults import covariance_of, probe_faults
from pipeline.rigs.tpjb.probes import GAPS, probes_of

Z = {"z1": -0.12, "z2": 0.10}


def gaps_of(n: int = 2000, tilt: float = 2e-5, noise: float = 1e-7) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return gaps of all eight probes and the motion of the middle plane, x and y, shape (2, n)."""
    rng = np.random.default_rng(3)
    t = np.linspace(0, 4 * np.pi, n)
    d = np.stack([40e-6 * np.cos(t) + 5e-6, 30e-6 * np.sin(t) - 3e-6])
    turn = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2)
    gaps = {}
    for plane, z in ((1, Z["z1"]), (2, Z["z2"])):
        u, v = turn @ (d + z * np.array([[tilt], [-tilt]]))
        for axis, motion in (("u", u), ("v", v)):
            gaps[f"gap_{axis}p{plane}"] = 1e-3 + motion + rng.normal(0, noise, n)
            gaps[f"gap_{axis}m{plane}"] = 1.02e-3 - motion + rng.normal(0, noise, n)
    return {name: gaps[name] for name in GAPS}, d


def stacked(gaps: dict[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    return np.stack([gaps[name] for name in names])


def test_eight_probes_give_motion_and_tilt_of_the_middle_plane() -> None:
    gaps, d = gaps_of(noise=0.0)
    probes = probes_of(gaps, Z)
    found = probes.displacement @ stacked(gaps, probes.names)
    # the pairs' unequal zeros (1.00 and 1.02 mm) shift u and v by 10 um: (-10, -10) in u, v is (0, -14.1) in x, y
    np.testing.assert_allclose(found - d, np.tile([[0.0], [-np.sqrt(2) * 10e-6]], d.shape[1]), atol=1e-12)
    assert probes.tilt is not None
    tilt = probes.tilt @ stacked(gaps, probes.names)
    np.testing.assert_allclose(tilt.mean(axis=1), [2e-5, -2e-5], atol=1e-12)


def test_noise_of_the_displacement_is_half_that_of_a_probe() -> None:
    probes = probes_of(GAPS, {"z1": -0.12, "z2": 0.12})
    np.testing.assert_allclose(np.sqrt((probes.displacement**2).sum(axis=1)), 0.5)


def test_one_plane_is_enough_and_has_no_tilt() -> None:
    gaps, d = gaps_of(tilt=0.0, noise=0.0)
    probes = probes_of([name for name in gaps if name.endswith("1")], {})
    assert probes.tilt is None
    assert set(probes.planes) == {1}
    found = probes.displacement @ stacked(gaps, probes.names)
    np.testing.assert_allclose(np.ptp(found - d, axis=1), 0.0, atol=1e-12)
    assert [f.level for f in probes.findings] == ["note"]


def test_planes_without_places_are_averaged_and_said() -> None:
    probes = probes_of(GAPS, {})
    assert probes.tilt is None
    assert [f.level for f in probes.findings] == ["warning"]
    assert "z1, z2" in probes.findings[0].message


def test_a_single_probe_stands_for_its_pair() -> None:
    gaps, d = gaps_of(tilt=0.0, noise=0.0)
    probes = probes_of(gaps, Z, excluded=("gap_um1",))
    found = probes.displacement @ stacked(gaps, probes.names)
    np.testing.assert_allclose(np.ptp(found - d, axis=1), 0.0, atol=1e-12)
    assert probes.unpaired == ("gap_up1",)


@pytest.mark.parametrize(
    ("channels", "conditions", "message"),
    [
        (["gap_up1", "gap_um1"], Z, "no sound probe along v"),
        (["force_u"], Z, "no sound probe along u"),
        (GAPS, {"z1": 0.1, "z2": 0.1}, "different places"),
        (GAPS, {"z1": "left", "z2": 0.1}, "z1 is 'left'"),
    ],
)
def test_what_cannot_be_mapped_is_said(channels: list[str], conditions: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        probes_of(channels, conditions, run="r1")


def test_sound_probes_raise_no_finding() -> None:
    gaps, _ = gaps_of()
    found = probe_faults(GAPS, covariance_of(stacked(gaps, GAPS)))
    assert found.findings == ()
    assert found.excluded == ()


@pytest.mark.parametrize("planes", [(1, 2), (1,)])
@pytest.mark.parametrize("fault", ["inverted", "dead", "missing", "noise"])
def test_the_faulty_probe_is_named_and_left_out(fault: str, planes: tuple[int, ...]) -> None:
    gaps, d = gaps_of()
    names = tuple(name for name in GAPS if int(name[-1]) in planes)
    rng = np.random.default_rng(0)
    n = d.shape[1]
    faulty: dict[str, np.ndarray] = {
        "inverted": 2e-3 - gaps["gap_vm1"],
        "dead": np.asarray(0.9e-3 + rng.normal(0, 1e-8, n)),
        "missing": np.full(n, np.nan),
        "noise": np.asarray(1e-3 + rng.normal(0, 3e-5, n)),
    }
    gaps["gap_vm1"] = faulty[fault]
    force = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2) @ d  # a spring: force along the displacement
    along = np.array([np.mean((gaps[g] - gaps[g].mean()) * force["uv".index(g[4])]) for g in names])
    found = probe_faults(names, covariance_of(stacked(gaps, names)), with_force=np.nan_to_num(along))
    if fault == "noise" and planes == (1,):
        assert found.excluded == ()
        assert found.findings[0].level == "error"
        return
    assert found.excluded == ("gap_vm1",)
    assert found.findings[0].channel == "gap_vm1"


def test_a_wrong_gain_is_laid_to_the_probe_that_differs_from_the_other_plane() -> None:
    gaps, _ = gaps_of()
    gaps["gap_up2"] = 1e-3 + 1.3 * (gaps["gap_up2"] - 1e-3)
    found = probe_faults(GAPS, covariance_of(stacked(gaps, GAPS)))
    assert found.excluded == ("gap_up2",)
    alone = tuple(name for name in GAPS if name.endswith("2"))
    found = probe_faults(alone, covariance_of(stacked(gaps, alone)))
    assert found.excluded == ()
    assert "both stay in" in found.findings[0].message


def test_an_axis_that_contradicts_itself_is_an_error_without_a_force_to_decide() -> None:
    gaps, _ = gaps_of()
    names = tuple(name for name in GAPS if name.endswith("1"))
    gaps["gap_up1"] = -gaps["gap_up1"]
    found = probe_faults(names, covariance_of(stacked(gaps, names)))
    assert [f.level for f in found.findings] == ["error"]
    assert found.excluded == ()
