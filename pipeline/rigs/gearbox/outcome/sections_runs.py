"""Time plots with their stages, nominal and peak torques beside the paper's, events, clocks of the boards."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Band,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Panel,
    Rule,
    Status,
    Table,
    Text,
    Value,
)
from pipeline.rigs.gearbox.outcome import captions
from pipeline.rigs.gearbox.outcome import sections_many as many
from pipeline.rigs.gearbox.outcome.paper import BRAKE, FOS, RPM, SOS, SPEEDS, STARTUP, TORQUES
from pipeline.rigs.gearbox.outcome.sections_many import NEAR, is_many, told_shown

if TYPE_CHECKING:
    import pandas as pd

TIME, TORQUE = Axis("time", "s"), Axis("torque", "N*m")
# What a stage is called in words, and where it stands in the series of colours: the same everywhere.
STAGES = {
    "standstill": "standstill", "startup": "start-up", "fos": "FOS", "fos_loaded": "FOS under load", "brake": "brake",
    "sos": "SOS", "stall": "stall", "release": "release", "fos_after": "FOS after", "rundown": "run-down",
}  # fmt: skip
_COLOUR = {stage: 2 + place for place, stage in enumerate(STAGES)}
EVENTS = {
    "startup": "start-up", "brake_onset": "brake on", "unlock": "unlock", "sos_start": "output stops",
    "sos_end": "output starts", "relock": "relock", "rundown": "run-down",
}  # fmt: skip
_QUANTITIES = {"torque_in": "input torque", "torque_out": "output torque"}
_STATES = {
    ("startup", "peak"): STARTUP, ("fos", "nominal"): FOS, ("brake", "peak"): BRAKE, ("sos", "nominal"): SOS,
    ("fos_after", "nominal"): "FOS after",
}  # fmt: skip
_SHOWN = 2
_TOLD_DRIFT = 1e-3


def of_run(table: pd.DataFrame, run: str) -> pd.DataFrame:
    """Return the rows of one run."""
    return table[table["run"] == run]


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows as dictionaries."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def shown_runs(findings: Findings) -> list[str]:
    """Return the runs that stand for all: of many those chosen, else those nearest to the paper's speeds, or first and last."""
    runs = findings.arrays["runs"]
    if is_many(findings):
        return [str(run) for run in runs[runs["drawn"] == "typical"]["run"]]
    names = [str(run) for run in runs["run"]]
    if len(names) <= _SHOWN:
        return names
    speeds = runs["speed"].to_numpy() / RPM
    chosen = []
    for rpm in SPEEDS:
        distance = np.abs(speeds / rpm - 1.0)
        if np.isfinite(distance).any() and np.nanmin(distance) < NEAR:
            chosen.append(names[int(np.nanargmin(distance))])
    return chosen or [names[0], names[-1]]


def of_stages(findings: Findings) -> list[Figure | Table | Text]:
    """Return the chapter on the sequence of stages."""
    shown = shown_runs(findings)
    figures: list[Figure | Table | Text] = [_time_plot(findings, run) for run in shown]
    runs = findings.arrays["runs"]
    if is_many(findings):
        far = runs[runs["drawn"] == "odd"]
        odd = [str(run) for run in far["run"]]
        off = [f"{run} in its {what}" for run, what in zip(odd, far["unlike"], strict=True) if what]
        told = f" Off the others is {listing(off)}." if off else ""
        about = f"How do the runs look whose numbers are farthest off? Torques and stages as above.{told}"
        oddest = [_panels(findings, "time_odd", "The oddest runs", about, odd)] if odd else []
        return [
            Text([told_shown(findings)]), *figures, *oddest, many.of_events(findings, EVENTS), *many.of_exchange(findings),
            *many.of_clocks(findings),
        ]  # fmt: skip
    others = [str(run) for run in runs["run"] if str(run) not in shown]
    if others:
        about = f"Do all runs go through the same stages? {captions.complete(runs, [*shown, *others])} Torques and stages as above."
        figures.append(_panels(findings, "time_others", "The other runs", about, others))
    return [*figures, _events(findings), *_exchange(findings), *_clocks(findings)]


def _time_plot(findings: Findings, run: str) -> Figure:
    signals = of_run(findings.arrays["overview"], run)
    time = signals["time"].to_numpy()
    levels = of_run(findings.arrays["levels"], run)
    torque: list[Mark] = [
        *_stage_bands(findings, run, signals[["torque_in", "torque_out"]].to_numpy(), label=True),
        Line(time, signals["torque_in"].to_numpy(), "measured", "input"),
        Line(time, signals["torque_out"].to_numpy(), "model", "output"),
    ]
    if len(levels):
        ends, values = levels[["start", "end"]].to_numpy(), levels["value"].to_numpy()
        x = np.column_stack([ends, np.full(len(ends), np.nan)]).ravel()
        torque.append(Line(x, np.repeat(values, 3), "residual", "nominal"))
    torque += _event_rules(findings, run)
    speed = signals["speed"].to_numpy()
    panels = [
        Panel(torque, TIME, TORQUE, "torques"),
        Panel([*_stage_bands(findings, run, speed), Line(time, speed, "measured")], TIME,
              Axis("output speed", "rad/s"), "output shaft"),
    ]  # fmt: skip
    vibration = signals["vibration"].to_numpy()
    if np.isfinite(vibration).any():
        marks: list[Mark] = [*_stage_bands(findings, run, vibration), Line(time, vibration, "measured")]
        panels.append(
            Panel(
                marks,
                TIME,
                Axis("acceleration, rms", "m/s^2"),
                f"vibration, {captions.channel(str(signals['channel'].iloc[0]))}",
            )
        )
    return Figure(
        f"time_{run}",
        f"Run {run}: stages of the load exchange",
        f"Is the sequence complete, and where does each stage lie? {captions.complete(findings.arrays['runs'], [run])} Block means; colours are the stages found without labels, "
        "vertical lines the events, flat lines the nominal torques. Torques are free of their zero offset where a standstill told it.",
        f"torques, output speed and vibration of run {run} over time with coloured stages",
        panels,
        share_x=True,
    )


def _stage_bands(findings: Findings, run: str, values: np.ndarray, label: bool = False) -> list[Mark]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = 0.05 * (high - low or 1.0)
    marks: list[Mark] = []
    named: set[str] = set()
    for row in records(of_run(findings.arrays["stages"], run)):
        stage = str(row["stage"])
        text = STAGES.get(stage, stage) if label and stage not in named else ""
        named.add(stage)
        x = np.array([row["start"], row["end"]])
        marks.append(Band(x, np.full(2, low - room), np.full(2, high + room), _COLOUR.get(stage, 0), text))
    return marks


def _event_rules(findings: Findings, run: str) -> list[Mark]:
    events = of_run(findings.arrays["events"], run)
    return [
        Rule(x=float(row["time"]), label=EVENTS.get(str(row["event"]), str(row["event"]))) for row in records(events)
    ]


def _panels(findings: Findings, name: str, title: str, caption: str, runs: Sequence[str]) -> Figure:
    panels = []
    for run in runs:
        signals = of_run(findings.arrays["overview"], run)
        time = signals["time"].to_numpy()
        torques = signals[["torque_in", "torque_out"]].to_numpy()
        marks: list[Mark] = [
            *_stage_bands(findings, run, torques, label=True),
            Line(time, torques[:, 0], "measured", "input"),
            Line(time, torques[:, 1], "model", "output"),
        ]
        panels.append(Panel(marks, TIME, TORQUE, f"run {run}"))
    return Figure(
        name, title, caption, f"torques over time of {title[:1].lower()}{title[1:]}, one panel each", panels, columns=2
    )  # fmt: skip


def of_values(findings: Findings) -> list[Figure | Table]:
    """Return the table of nominal and peak torques beside the paper's."""
    if is_many(findings):
        return many.of_values(findings, _QUANTITIES, _STATES)
    blocks: list[Figure | Table] = []
    runs = findings.arrays["runs"]
    for quantity, words in _QUANTITIES.items():
        rows: list[list[Cell]] = []
        for run, speed in zip(runs["run"], runs["speed"], strict=True):
            rows += _value_rows(findings, str(run), float(speed), quantity)
        if rows:
            blocks.append(
                Table(
                    f"values_{quantity}",
                    f"Nominal and peak {words}",
                    f"{captions.beside_paper([(row[2], row[4]) for row in rows])} Nominal: mean over whole turns of the settled stage. Peak: maximum after a zero-phase low-pass at 20 Hz; its "
                    "interval allows for what noise and ripple add. The paper's bench is another one: its values stand beside, they are no reference. "
                    f"{captions.type_b(findings.arrays['levels'].loc[findings.arrays['levels']['quantity'] == quantity, 'type_b'].to_list())}",
                    [Column("run"), Column("state"), Column("value", "N*m"), Column("largest raw sample", "N*m"),
                     Column("paper", "N*m")],
                    rows,
                )
            )  # fmt: skip
    return blocks


def _value_rows(findings: Findings, run: str, speed: float, quantity: str) -> list[list[Cell]]:
    rpm = next((rpm for rpm in SPEEDS if abs(speed / RPM / rpm - 1.0) < NEAR), None)
    found: list[list[Cell]] = []
    for (stage, kind), state in _STATES.items():
        table = of_run(findings.arrays["peaks" if kind == "peak" else "levels"], run)
        for row in records(table[(table["stage"] == stage) & (table["quantity"] == quantity)]):
            printed = TORQUES[state][rpm][quantity == "torque_out"] if rpm and state in TORQUES else None
            value = (
                Value(row["value"], row["sd"], (row["low"], row["high"]))
                if np.isfinite(row["sd"])
                else Value(row["value"])
            )
            raw = float(row["raw"]) if kind == "peak" else None
            found.append([run, state, value, raw, printed])
    return found


def _events(findings: Findings) -> Table:
    events = findings.arrays["events"]
    rows: list[list[Cell]] = []
    for run in findings.arrays["runs"]["run"]:
        own = of_run(events, run)
        cells: list[Cell] = [str(run)]
        for event in EVENTS:
            found = own[own["event"] == event]
            cells.append(Value(float(found["time"].iloc[0]), float(found["sd"].iloc[0])) if len(found) else None)
        rows.append(cells)
    return Table(
        "events",
        "Events",
        f"{captions.seen(events, len(findings.arrays['runs']), list(EVENTS))} When things happened, on the clock of the torques; an empty cell did not happen or was not seen.",
        [Column("run"), *(Column(words, "s") for words in EVENTS.values())],
        rows,
    )


def _exchange(findings: Findings) -> list[Table]:
    """Return how the lock broke and closed again in each run."""
    rows: list[list[Cell]] = []
    for run in findings.arrays["runs"]["run"]:
        found = {str(row["event"]): row for row in records(of_run(findings.arrays["events"], str(run)))}
        if "unlock" not in found:
            continue
        peak = next(
            (p for p in findings.find("torque_in_peak", run=str(run), stage="brake") if p.value is not None), None
        )
        shook = [float(found[name]["disturbance"]) if name in found else np.nan for name in ("unlock", "relock")]
        rows.append([
            str(run), Value(peak.value, peak.std_error, peak.ci95) if peak else None, _between(found, "unlock", "sos_start"),
            _between(found, "sos_end", "relock"), *(value if np.isfinite(value) else None for value in shook),
        ])  # fmt: skip
    if not rows:
        return []
    return [
        Table(
            "exchange",
            "Unlocking and locking again",
            f"{captions.broke(findings)} Torque that broke the lock, times to stop and to lock again, and how much the event shakes the bearing: mean square of the "
            "vibration within 0.1 s of it over that of FOS.",
            [Column("run"), Column("input torque at unlock", "N*m"), Column("unlock to stop", "s"), Column("start to relock", "s"),
             Column("shake at unlock"), Column("shake at relock")],
            rows,
        )
    ]  # fmt: skip


def _between(found: dict[str, dict[str, Any]], first: str, last: str) -> Value | None:
    """Return the time from one event to another with its error."""
    if first not in found or last not in found:
        return None
    spread = float(np.hypot(found[first]["sd"], found[last]["sd"]))
    return Value(float(found[last]["time"] - found[first]["time"]), spread)


def _clocks(findings: Findings) -> list[Table]:
    clocks = findings.arrays["clocks"]
    clocks = clocks[clocks["applied"].astype(bool) | clocks["run"].isin(shown_runs(findings))]
    if clocks.empty:
        return []
    rows: list[list[Cell]] = [
        [str(row["run"]), str(row["board"]), Value(row["shift"], row["shift_sd"]), _drift(row),
         Status("applied", "ok") if row["applied"] else Status("not significant")]
        for row in records(clocks)
    ]  # fmt: skip
    return [
        Table(
            "clocks",
            "Clocks of the boards",
            f"{captions.clocks(findings.arrays['clocks'])} Shift and drift of each board against the torques, from what both see; applied where significant. A drift whose error is above "
            "1000 ppm is not shown.",
            [Column("run"), Column("board"), Column("shift", "s"), Column("drift, ppm"), Column("")],
            rows,
        )
    ]


def _drift(row: dict[str, Any]) -> Value | None:
    """Return a drift in parts per million where the run is long enough to tell one."""
    if not row["drift_sd"] < _TOLD_DRIFT:
        return None
    return Value(1e6 * row["drift"], 1e6 * row["drift_sd"])
