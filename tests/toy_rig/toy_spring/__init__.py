"""A rig that rigfit does not know: a spring pulled on a bench. It proves that a rig is one folder.

It stands outside the package `pipeline` and is announced by an entry point only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from pydantic import Field

from pipeline.errors import InputError
from pipeline.findings import Findings, ModelResult, Parameter, Published, Run
from pipeline.findings.figures import Axis, Figure, Line, Panel, Points, Section
from pipeline.findings.signals import Signals
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import (
    ChannelSpec,
    ConditionSpec,
    Context,
    Experiment,
    ParameterSpec,
    Reference,
    Settings,
)


class SpringSettings(Settings):
    largest_extension: float = Field(0.1, gt=0, description="m; samples beyond it do not enter")


def line(extension: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coefficients [slope N/m, offset N], their covariance, and the residuals (n,), N."""
    columns = np.column_stack([extension, np.ones_like(extension)])
    coefficients, *_ = np.linalg.lstsq(columns, force, rcond=None)
    residual = force - columns @ coefficients
    covariance = np.linalg.inv(columns.T @ columns) * (residual @ residual) / (force.size - 2)
    return coefficients, covariance, residual


def identify(recordings: Sequence[Recording], settings: SpringSettings, context: Context) -> Findings:
    parameters, tables, runs = [], [], []
    for recording in recordings:
        extension, force = recording.values("extension"), recording.values("force")
        use = np.isfinite(extension) & np.isfinite(force) & (np.abs(extension) <= settings.largest_extension)
        if use.sum() < 10:
            runs.append(Run(run=recording.run, used=False, reason="fewer than 10 samples"))
            continue
        coefficients, covariance, residual = line(extension[use], force[use])
        error = float(np.sqrt(covariance[0, 0]))
        k = float(coefficients[0])
        parameters.append(
            Parameter(
                name="stiffness",
                symbol="k",
                value=k,
                std_error=error,
                ci95=(k - 1.96 * error, k + 1.96 * error),
                unit="N/m",
                at={"run": recording.run},
                description="slope",
                source="Hooke 1678",
            )
        )
        tables.append(
            pd.DataFrame(
                {
                    "run": recording.run,
                    "time": recording.stream_of("force").time[use],
                    "extension": extension[use],
                    "force": force[use],
                    "model": force[use] - residual,
                }
            )
        )
    if not parameters:
        raise InputError(f"campaign '{context.campaign}': no run holds 10 samples; record longer.")
    n = sum(len(table) for table in tables)
    return Findings(
        campaign=context.campaign,
        experiment="spring.pull",
        verdict="ok",
        reasons=["Every run gives a straight line."],
        parameters=parameters,
        models=[ModelResult(name="line", selected=True, n_parameters=2 * len(tables), n_data=n)],
        published=[Published(name="stiffness", published=200.0, found=parameters[0].value, unit="N/m", agrees=None)],
        runs=runs,
        arrays={"pulls": pd.concat(tables)},
    )


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    rng = np.random.default_rng(seed)
    k = {"stiffness": 200.0, **truth}["stiffness"]
    recordings = []
    for number in (1, 2):
        time = np.arange(500) / 100.0
        extension = 0.02 * np.sin(2 * np.pi * 0.5 * time)
        force = k * extension + rng.normal(0, 0.05, time.size)
        channels = {"extension": Channel("extension", extension, "m"), "force": Channel("force", force, "N")}
        recordings.append(Recording(f"pull_{number}", {"": Stream("", time, channels)}, {"wire_diameter": 1e-3}))
    return recordings


def sections(findings: Findings) -> Sequence[Section]:
    table = findings.arrays["pulls"]
    panels = [
        Panel(
            [
                Points(part.extension.to_numpy(), part.force.to_numpy(), "measured", "measured"),
                Line(part.extension.to_numpy(), part.model.to_numpy(), "model", "line"),
            ],
            Axis("extension", "m"),
            Axis("force", "N"),
            title=str(run),
        )
        for run, part in table.groupby("run")
    ]
    figure = Figure("pulls", "Pulls", "Is the spring straight? It is.", "force over extension", panels, columns=2)
    return [Section("evidence", "Evidence", [figure])]


SPRING = Experiment(
    id="spring.pull",
    title="Spring pulled on a bench",
    summary="Slope of force over extension.",
    references=[Reference("hooke1678", "R. Hooke", "De potentia restitutiva", "London", 1678)],
    channels=[
        ChannelSpec("extension", "m", "extension of the spring, + when pulled", limit=0.5),
        ChannelSpec("force", "N", "force on the spring, + when pulled"),
    ],
    conditions=[ConditionSpec("wire_diameter", "m", "diameter of the wire", required=True)],
    parameters=[ParameterSpec("stiffness", "k", "N/m", "slope of force over extension", "Hooke 1678", key=True)],
    settings=SpringSettings,
    identify=identify,
    synthesize=synthesize,
    sections=sections,
    methods=lambda findings: [f"A line was fitted to {len(findings.parameters)} runs."],
    signals=[Signals("pulls", {"force": "N", "model": "N"}, "force, measured and of the line")],
)
EXPERIMENTS = (SPRING,)
