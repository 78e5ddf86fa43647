"""Faults of rotating-load logs: each is noticed, named and dealt with; what users drop goes through."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from rotating_logs import GAPS, changed, coefficients, found, logs, said, without

from pipeline.errors import InputError
from pipeline.recording import Channel, Stream
from pipeline.rigs.tpjb.rotating import sampling
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.faults import check
from pipeline.rigs.tpjb.rotating.orientation import orientation_of, rough_stiffness, unit_findings
from pipeline.rigs.tpjb.rotating.record import record_of

K = coefficients("4pad-L2")["kxx"]


@pytest.fixture(scope="module")
def a6():
    return logs("A6")[0]


def recorded(log):
    return record_of(log, RotatingSettings())


def turned_over(gap):
    return 2e-3 - gap


@pytest.mark.parametrize(
    ("axes", "text"), [("uv", "moves? against the force"), ("u", "along u"), ("v", "along v")], ids=["both", "u", "v"]
)
def test_inverted_axes_are_named_and_mended(a6, axes, text):
    log = changed(a6, **{gap: turned_over for gap in GAPS if gap[4] in axes})
    mend = orientation_of(recorded(log))
    assert text.split("?")[-1].strip() in mend.findings[0].message
    assert rough_stiffness(recorded(log).mapped(mend.mend))[0, 0] == pytest.approx(K, rel=0.02)


def test_right_axes_are_left_alone(a6):
    assert orientation_of(recorded(a6)).mend is None
    assert unit_findings(recorded(a6)) == []
    assert check(a6) == ()


@pytest.mark.thorough
def test_one_plane_and_single_probes_are_enough(a6):
    for kept in ("p1 m1", "p1"):
        log = changed(a6, **{gap: None for gap in GAPS if gap[5:] not in kept.split()})
        findings = found([log])
        assert findings.one("kyy").value == pytest.approx(K, rel=3e-3)
        # Pitching cannot be seen there, and biases every coefficient.
        assert findings.verdict == "warning"
        assert said(findings, "probes in one plane only")


def test_a_run_in_another_unit_is_left_out_beside_a_good_one(a6):
    kilonewtons = changed(a6, force_u=lambda f: f / 1e3, force_v=lambda f: f / 1e3)
    beside = found([kilonewtons, *logs("A7")])
    assert said(beside, "kN taken as N")
    assert [run.used for run in beside.runs] == [False, True]
    assert beside.one("kxx").value == pytest.approx(K, rel=5e-3)


@pytest.mark.thorough  # the table of bad data has forces late by 0.3 s
@pytest.mark.parametrize("delay", [-2.0])
def test_late_forces_are_shifted_and_the_error_of_the_delay_reaches_the_cross_terms(delay):
    findings = found(logs("A4", delay=delay))
    assert said(findings, "clock slip or delay")
    true = coefficients("4pad-L1")
    assert findings.one("kxx").value == pytest.approx(true["kxx"], rel=1e-3)
    # Left in, 1 s at 0.01 Hz turns 6 % of k into cross coupling; 0.01 s of error 0.06 %.
    for name in ("kxy", "kyx"):
        p = findings.one(name)
        assert abs(p.value - true[name]) < 3.3 * p.std_error
        assert 0.0002 * true["kxx"] < p.std_error < 0.005 * true["kxx"]


@pytest.mark.parametrize("friction", [100.0])
@pytest.mark.thorough
def test_friction_is_told_from_a_delay_and_taken_off(friction):
    findings = found(logs("A4", friction=friction))
    assert said(findings, "friction of stabilisers")
    assert not said(findings, "clock slip")
    assert findings.one("kyy").value == pytest.approx(0.6e9, rel=1e-3)
    for name in ("kxy", "kyx"):
        p = findings.one(name)
        assert abs(p.value - 0.03e9) < 3.3 * p.std_error


def test_friction_and_delay_together_are_not_taken_off_and_widen_the_cross_terms():
    findings = found(logs("A4", friction=300.0, delay=-0.3))
    assert said(findings, "do not tell which")
    assert findings.verdict == "warning"
    p = findings.one("kxy")
    assert p.value is None or p.ci95[0] < 0.03e9 < p.ci95[1]


def test_clean_logs_have_neither_delay_nor_friction():
    findings = found(logs("A4", seed=7))
    assert not said(findings, "delay")
    assert not said(findings, "friction")
    assert findings.verdict == "ok"


@pytest.mark.thorough
def test_wild_and_missing_samples_are_left_out(a6):
    rows = np.arange(700)
    faults = {
        "left out: gap_up1 (7 samples)": lambda x: x + 1e-4 * (rows % 97 == 50),
        "": lambda x: np.where((rows > 300) & (rows < 330), np.nan, x),
    }
    for text, change in faults.items():
        findings = found([changed(a6, gap_up1=change)])
        assert any(text in q.message for q in findings.quality)
        assert findings.one("kxx").value == pytest.approx(K, rel=1.5e-3)
        assert findings.one("thd").value == pytest.approx(0.0598, abs=0.002)


@pytest.mark.thorough
def test_flat_tops_are_left_out_whole_and_rounded_values_are_not_taken_for_them(a6):
    clipped = found([changed(a6, gap_up1=lambda x: np.minimum(x, np.quantile(x, 0.93)))])
    assert said(clipped, "49 samples (7 %), all of which")
    rounded = found([changed(a6, **{gap: lambda x: np.round(x, 7) for gap in GAPS})])
    assert not said(rounded, "clipped")


@pytest.mark.parametrize(
    ("moved", "text"),
    [(lambda t: 6e-6 * (1 - np.exp(-t / 60)), "an exponential drift of")],
    ids=["exponential"],
)
def test_a_drift_that_is_no_parabola_is_named_with_its_time(a6, moved, text):
    t = a6.streams["lf"].time
    drift = {gap: lambda x, s=1 if gap[5] == "p" else -1: x + s * moved(t) for gap in GAPS if gap[4] == "v"}
    findings = found([changed(a6, **drift)])
    assert said(findings, text)
    assert findings.verdict == "warning"


@pytest.mark.thorough
def test_runs_of_two_states_under_one_label_are_told_apart():
    other = without(logs("A6")[0], static_load=40e3)
    findings = found([*logs("A5"), replace(other, run="mixed")])
    assert any("do not belong to one state" in reason for reason in findings.reasons)
    assert not any("cubic" in reason for reason in findings.reasons)
    assert findings.one("kxx").value is None


def test_logs_at_50_hz_are_averaged():
    (log,) = logs("A4", rate=50.0)
    record = recorded(log)
    assert record.averaged == 50
    assert 650 < record.orbit.time.size <= 700
    assert found([log]).one("kyy").value == pytest.approx(0.6e9, rel=5e-4)


def test_long_logs_are_averaged_piece_by_piece_to_the_same_motion(monkeypatch):
    (log,) = logs("A4", rate=50.0)
    plain = recorded(changed(log, gap_up1=lambda x: np.where(np.arange(x.size) % 70 == 3, np.nan, x)))
    monkeypatch.setattr(sampling, "_MANY", 5000)
    thinned = recorded(changed(log, gap_up1=lambda x: np.where(np.arange(x.size) % 70 == 3, np.nan, x)))
    assert thinned.averaged == pytest.approx(50, abs=7)
    assert thinned.rotation.size == pytest.approx(plain.rotation.size, rel=1e-4)
    assert thinned.orbit.displacement.std() == pytest.approx(plain.orbit.displacement.std(), rel=2e-3)


@pytest.mark.thorough
def test_clockwise_and_faster_loads_give_the_same_law():
    for frequency in (-0.01, 0.04):
        findings = found(logs("B3", rotation_frequency=frequency))
        assert findings.one("kyy").value == pytest.approx(0.95e9, rel=1.5e-3)


@pytest.mark.thorough
def test_static_load_may_be_a_channel_or_missing(a6):
    measured = found([without(a6, "static_load")])
    assert measured.one("linear_limit", static_load=80000.0).value == pytest.approx(0.143, abs=0.003)
    unknown = found([without(changed(a6, force_static=None), "static_load", "load_ratio")])
    assert unknown.verdict == "warning"
    assert unknown.one("kxx").value == pytest.approx(K, rel=1e-3)
    assert "static load is not known" in unknown.one("linear_limit").description


def test_speed_may_be_missing(a6):
    findings = found([without(changed(a6, speed=None), "shaft_speed_nominal")])
    assert findings.one("kxx").at == {"static_load": 80000.0}
    assert any("shaft speed is not given" in q.message for q in findings.quality)


@pytest.mark.thorough
def test_noise_widens_the_intervals_and_no_noise_breaks_nothing():
    quiet = found(logs("A4", probe_noise=0.0, force_noise=0.0, force_unrest=0.0, drift=0.0, runout=0.0))
    assert quiet.one("kxx2").value == pytest.approx(1.0e12, rel=1e-3)
    noisy = found(logs("A4", probe_noise=2e-6))
    kxx = noisy.one("kxx")
    assert kxx.std_error > 1e6
    assert abs(kxx.value - 0.6e9) < 3.3 * kxx.std_error


def test_forces_and_gaps_may_have_clocks_of_their_own(a6):
    stream = a6.streams["lf"]
    later = stream.time + 0.37
    forces = {
        name: Channel(name, np.interp(later, stream.time, channel.values), channel.unit)
        for name, channel in stream.channels.items()
        if name.startswith("force")
    }
    others = {name: channel for name, channel in stream.channels.items() if name not in forces}
    two = {"gaps": Stream("gaps", stream.time, others), "forces": Stream("forces", later, forces)}
    assert found([replace(a6, streams=two)]).one("kyy").value == pytest.approx(K, rel=1.5e-3)


@pytest.mark.parametrize(
    ("log", "text"),
    [
        (lambda log: changed(log, force_v=lambda f: 0 * f + np.resize([3.0, -3.0], f.size)), "is actuator v off"),
        (lambda log: changed(log, **dict.fromkeys(GAPS)), "no sound probe along u"),
        (lambda log: without(log, test="bump"), "labelled as test 'bump'"),
        (lambda log: changed(log, force_u=lambda f: 0 * f, force_v=lambda f: 0 * f), "force is zero throughout"),
    ],
    ids=["actuator off", "no gaps", "other test", "no force"],
)
def test_what_cannot_be_used_is_refused_in_plain_words(a6, log, text):
    with pytest.raises(InputError, match=r"no run can be used.*run 'A6_L2_17'") as told:
        found([log(a6)])
    assert text in str(told.value)
    assert not str(told.value).endswith("..")


def test_a_log_with_names_and_units_of_its_own_goes_through_a_recipe(a6, tmp_path, rigfit):
    stream = a6.streams["lf"]
    columns = [("t [s]", stream.time)]
    columns += [(f"G{name[4:]} [um]", stream.channels[name].values * 1e6) for name in GAPS]
    columns += [(f"F{axis} [kN]", stream.channels[f"force_{axis}"].values / 1e3) for axis in "uv"]
    columns += [("n [rpm]", stream.channels["speed"].values * 30 / np.pi)]
    table = np.column_stack([values for _, values in columns])
    path = tmp_path / "run7.csv"
    np.savetxt(path, table, delimiter=";", header=";".join(name for name, _ in columns), comments="", fmt="%.6f")
    gaps = "\n".join(f"  {name}: {{channel: G{name[4:]}}}" for name in GAPS)
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(
        f"experiment: tpjb.rotating\nchannels:\n  time: {{channel: t}}\n{gaps}\n  force_u: {{channel: Fu}}\n"
        "  force_v: {channel: Fv}\n  speed: {channel: n}\n"
        "conditions: {static_load: 80 kN, z1: -120 mm, z2: 0.12 m, bearing: 4pad, clearance_nominal: 200 um}\n"
    )
    answer = rigfit("run", "tpjb.rotating", path, "--recipe", recipe, "--out", tmp_path / "out")
    assert answer.status == 0, answer.err
    written = json.loads((tmp_path / "out" / "findings.json").read_text())
    kxx = next(p for p in written["parameters"] if p["name"] == "kxx")
    assert kxx["value"] == pytest.approx(K, rel=1.5e-3)
    assert kxx["at"] == {"static_load": 80000.0, "shaft_speed": 104.7}
