"""A made-up but realistic campaign: twelve shear runs at three frequencies and four currents."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from pipeline.findings import Findings, ModelResult, Parameter, Published, Quality, Run
from pipeline.findings.figures import (
    Axis,
    Band,
    Column,
    Figure,
    Line,
    Matrix,
    Panel,
    Points,
    Rule,
    Section,
    Table,
    Text,
    Value,
)
from pipeline.recording import Recording
from pipeline.rigs.experiment import (
    ChannelSpec,
    ConditionSpec,
    Experiment,
    ParameterSpec,
    Reference,
    Settings,
)

FREQUENCIES, CURRENTS = (5.0, 10.0, 15.0), (0.0, 2.0, 4.0, 6.0)
AMPLITUDES = (0.2e-3, 0.4e-3, 0.6e-3)


class PadSettings(Settings):
    mains_frequency: float = 50.0
    starts: int = 6


def loop(amplitude: float, current: float, samples: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return displacement, measured and modelled force of a hysteresis loop."""
    angle = np.linspace(0, 2 * np.pi, samples)
    x = amplitude * np.sin(angle)
    model = (2.6e5 + 3.8e4 * current) * x + 3e4 * amplitude * np.cos(angle) + 25 * np.tanh(4 * np.sin(angle + 0.4))
    return x, model + np.random.default_rng(1).normal(0, 3, samples), model


def figures() -> list[Figure]:
    """Return one figure of every kind that a rig may ask for."""
    rng = np.random.default_rng(2)
    displacement, force = Axis("displacement", "m"), Axis("force", "N")
    loops = [
        Panel([Line(x, measured, "measured"), Line(x, model, "model")], displacement, force, f"{f:g} Hz, {current:g} A")
        for j, f in enumerate(FREQUENCIES)
        for i, current in enumerate(CURRENTS)
        for x, measured, model in [loop(AMPLITUDES[(i + j) % 3], current)]
    ]
    f, fine = np.array(FREQUENCIES), np.linspace(5, 15, 40)
    stiffness, damping = [], []
    for series, current in enumerate(CURRENTS):
        k = 2.6e5 + 3.8e4 * current
        y = k + 8e3 * np.log(f)
        stiffness += [
            Points(f, y + rng.normal(0, 2e3, 3), series, f"{current:g} A", y - 5e3, y + 5e3),
            Line(fine, k + 8e3 * np.log(fine), series, f"{current:g} A"),
        ]
        damping.append(Line(f, 12e3 * (1 + 0.4 * series) / f, series, f"{current:g} A"))
    time = np.linspace(0, 4, 20_000)
    wave = 200 * np.sin(2 * np.pi * 5 * time)
    names = ["k_1", "τ", "k_2", "a_BW", "ρ", "C", "n", "k_MR 2 A", "k_MR 4 A", "k_MR 6 A", "s_MR 2 A", "lag"]
    angle = np.linspace(0, 2 * np.pi, 5000)
    cloud = Points(40e-6 * np.cos(angle) + rng.normal(0, 1e-6, 5000), 25e-6 * np.sin(angle), "measured")
    orbit = Panel([cloud, Line(40e-6 * np.cos(angle[::20]), 25e-6 * np.sin(angle[::20]), "model")],
                  Axis("x", "m"), Axis("y", "m"), "bearing 1", equal=True)  # fmt: skip
    order = np.arange(1.0, 13.0)
    repeat = 2.6e5 + rng.normal(0, 900, 12)
    return [
        Figure("loops", "Force over displacement", "Does the model follow every loop? Yes, within the noise.",
               "Twelve hysteresis loops, measured and modelled, which lie on each other.", loops, 4, True, True),
        Figure("frequency", "Stiffness and damping over frequency", "How do they depend on frequency and current?",
               "Stiffness rises with frequency and current, damping falls with frequency.",
               [Panel(stiffness, Axis("frequency", "Hz"), Axis("storage stiffness K'", "N/m"), "Stiffness"),
                Panel(damping, Axis("frequency", "Hz", "log"), Axis("equivalent damping", "N s/m", "log"), "Damping")],
               2),
        Figure("time", "Force over time", "Is there structure in the residual? No.", "Force and residual of run sh_a.",
               [Panel([Line(time, wave + rng.normal(0, 6, time.size), "measured"), Line(time, wave, "model"),
                       Rule(x=1.0, label="left out before")], Axis("time", "s"), force, "Run $sh_a$ at k_{MR}"),
                Panel([Line(time, rng.normal(0, 1, time.size), "residual"), Rule(y=2.0, label="2 sigma")],
                      Axis("time", "s"), Axis("residual", "N"))], share_x=True),
        Figure("correlation", "Correlation of the parameters", "Which parameters are hard to tell apart?",
               "Correlation matrix of twelve parameters.",
               [Panel([Matrix(np.corrcoef(rng.normal(size=(12, 16))), names, names)])]),
        Figure("orbits", "Orbits", "Are the orbits ellipses?", "Two elliptic orbits.", [orbit, orbit], 2),
        Figure("sequence", "Stiffness in the order of the runs", "Does the pad soften with use? Not visibly.",
               "Stiffness of twelve runs scatters about a constant.",
               [Panel([Band(order, order * 0 + 2.585e5, order * 0 + 2.615e5, "model", "95 % of the mean"),
                       Points(order, repeat, "measured", "", repeat - 1800, repeat + 1800,
                              [f"r{n:02.0f}" for n in order]),
                       Points(order[3:4], repeat[3:4] + 5e3, "fault", "clipped")],
                      Axis("run order"), Axis("storage stiffness", "N/m"))]),
    ]  # fmt: skip


def sections(findings: Findings) -> Sequence[Section]:
    table = Table(
        "preload", "Stiffness against preload", "At equal force and at equal amplitude.",
        [Column("preload", "N"), Column("current", "A"), Column("stiffness", "N/m"), Column("remark")],
        [[200.0, 0.0, Value(329_612.0, 812.0, (328_000.0, 331_200.0)), "soft"],
         [200.0, 6.0, Value(599_700.0, 1500.0, (596_760.0, 602_640.0)), None],
         [700.0, 0.0, Value(None, note="one half cycle only"), "left out"]],
    )  # fmt: skip
    return [
        Section("loops", "Loops and the model", [Text(["Each run is one loop."]), *figures()[:3], table]),
        Section("trust", "How far to trust it", figures()[3:]),
    ]


def parameter(name: str, symbol: str, value: float | None, error: float | None, unit: str, **at: object) -> Parameter:
    ci = None if value is None or error is None else (value - 1.98 * error, value + 1.98 * error)
    reason = "no run with field was recorded" if value is None else ""
    return Parameter(name=name, symbol=symbol, value=value, std_error=error, ci95=ci, unit=unit, at=at,
                     description=reason, source="eq. (10)", method="variable projection")  # fmt: skip


def campaign_findings(runs: int = 12) -> Findings:
    """Return findings of a campaign with that many runs."""
    rng = np.random.default_rng(3)
    parameters = [
        parameter("k1", "k_1", 60_041.7, 52.3, "N/m"),
        parameter("s1", "s_1", 1201.4, 2.9, "N s/m"),
        parameter("rho", r"\rho", 4002.0, 3.1, "1/m"),
        parameter("n_bw", "n", 1.4013, 0.0027, "1"),
        parameter("force_lag", r"\delta", 60.3e-6, 1.6e-6, "s"),
        *(parameter("k_mr", "k_{MR}", 3.8e4 * c, 47.0 + c, "N/m", coil_current=c) for c in CURRENTS[1:]),
        parameter("s_mr", "s_{MR}", None, None, "N s/m", coil_current=6.0),
    ]
    told = []
    for number in range(runs):
        f, c = FREQUENCIES[number % 3], CURRENTS[number % 4]
        at = {"run": f"sh_{number:03d}", "coil_current": c, "frequency": f}
        k = 2.6e5 + 3.8e4 * c + rng.normal(0, 900)
        parameters += [
            parameter("stiffness_storage", "K'", k, 310.0, "N/m", **at),
            parameter("loss_factor", r"\eta", 0.21 + 0.01 * c, 0.0021, "1", **at),
        ]
        conditions = {"coil_current": c, "frequency": f, "pad_height": 6e-3, "operator": "A. B."}
        told.append(Run(run=at["run"], used=number != 7, reason="the force is clipped" if number == 7 else "",
                        conditions=conditions, files=[f"datasets/pads/{at['run']}.csv"], sha256=[f"{number:012x}" + "0" * 52],
                        duration=4.0, n_samples=20_000,
                        repairs=["repeated time stamps: 3 rows dropped"] if number < 2 else []))  # fmt: skip
    return Findings(
        schema=1, campaign="pads-2024", experiment="toy.pads", verdict="warning",
        reasons=["One run of twelve is left out because its force is clipped."],
        parameters=parameters,
        models=[ModelResult(name="ks", selected=True, n_parameters=11, n_data=24_000, rms_residual=1.02, nrmse=0.0081,
                            chi2_reduced=0.99, aicc=-1203.4, bic=-1100.2, cv_error=0.011, description="as published"),
                ModelResult(name="ka", n_parameters=11, n_data=24_000, rms_residual=2.9, nrmse=0.024, chi2_reduced=8.1,
                            aicc=24_800.0, bic=24_900.0, cv_error=0.031)],
        published=[Published(name="stiffness at 200 N", published=330e3, found=329_612.0, unit="N/m", where="Fig. 17",
                             agrees=True),
                   Published(name="optimum", published="0.25 to 0.30", found=None, where="Fig. 3",
                             remark="needs other pads"),
                   Published(name="Young's modulus", published=1.57e6, found=1.5795e6, unit="Pa", agrees=False)],
        quality=[Quality(level="note", message="Two logs hold the same bytes."),
                 Quality(level="warning", run="sh_007", channel="force", span=(1.25, 1.31),
                         message="The force stays at its largest value for 312 samples."),
                 Quality(level="error", run="sh_003", channel="displacement", message="The channel is dead.")],
        runs=told, advice=["Add a run at 2 Hz: k1 and k2 are told apart below 8 Hz only."],
        settings={"mains_frequency": 50.0, "starts": 6},
        provenance={"rigfit": "0.1.0", "python": "3.11.7", "libraries": {"numpy": "2.4.6", "scipy": "1.17.0"},
                    "recipe": "recipes/pads-2024.yaml", "recipe_sha256": "ab" * 32,
                    "logs": {"datasets/pads/sh_000.csv": "0" * 64}},
    )  # fmt: skip


def toy_experiment(shown: Callable[[Findings], Sequence[Section]] = sections) -> Experiment:
    """Return the declaration of the experiment; `shown` are its sections."""

    def nothing(*_: object) -> list[Recording]:
        raise NotImplementedError("the report neither identifies nor synthesises")

    return Experiment(
        id="toy.pads", title="Shear of elastomer pads", summary="Stiffness and damping from loops.",
        references=[Reference("brancati2019", "R. Brancati and G. Di Massa and S. Pagano",
                              "Investigation on the Mechanical Properties of MRE Compounds", "Machines", 2019,
                              volume="7", pages="36"),
                    Reference("golub1973", "G. H. Golub and V. Pereyra", "The differentiation of pseudo-inverses",
                              "SIAM J. Numer. Anal. & more", 1973, pages="413-432", doi="10.1137/0710036")],
        channels=[ChannelSpec("displacement", "m", "shear"), ChannelSpec("force", "N", "force")],
        conditions=[ConditionSpec("coil_current", "A", "current"), ConditionSpec("frequency", "Hz", "frequency"),
                    ConditionSpec("pad_height", "m", "height")],
        parameters=[ParameterSpec("k1", "k_1", "N/m", "stiffness of the Maxwell branch", "eq. (10)", key=True),
                    ParameterSpec("n_bw", "n", "1", "sharpness of yielding", key=True),
                    ParameterSpec("force_lag", r"\delta", "s", "how late the force is", key=True),
                    ParameterSpec("k_mr", "k_{MR}", "N/m", "stiffness added by the field", key=True),
                    ParameterSpec("s_mr", "s_{MR}", "N s/m", "damping added by the field", key=True),
                    ParameterSpec("stiffness_storage", "K'", "N/m", "in-phase stiffness", key=True)],
        settings=PadSettings, identify=nothing, synthesize=nothing, sections=shown,
        methods=lambda findings: ["The loops were expanded in harmonics and fitted by variable projection [1, 2]."],
    )  # fmt: skip


@pytest.fixture(scope="session")
def findings() -> Findings:
    """Findings of twelve runs."""
    return campaign_findings()


@pytest.fixture(scope="session")
def experiment() -> Experiment:
    """The experiment that they are of."""
    return toy_experiment()


@pytest.fixture(scope="session")
def make_findings() -> Callable[[int], Findings]:
    """Make findings of any number of runs."""
    return campaign_findings


@pytest.fixture(scope="session")
def make_experiment() -> Callable[[Callable[[Findings], Sequence[Section]]], Experiment]:
    """Make the experiment with other sections."""
    return toy_experiment


@pytest.fixture(scope="session")
def drawn_figures() -> list[Figure]:
    """One figure of every kind."""
    return figures()


@pytest.fixture(scope="session")
def run_python() -> Callable[[str], str]:
    """Run code in a fresh interpreter; return what it prints."""

    def run(code: str) -> str:
        return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout

    return run
