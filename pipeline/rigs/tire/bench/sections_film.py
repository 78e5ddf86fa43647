"""The PVDF's voltage measured and predicted from the flex sensor, over angle and by order."""

from __future__ import annotations

import math

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Status, Table
from pipeline.rigs.tire.bench import captions
from pipeline.rigs.tire.bench.sections_waveform import ANGLE, Blocks, of_run, shown_runs, title_of

# Of the rms of the measured voltage: less is good, more than the second is a warning.
GOOD, BAD = 0.02, 0.10
_REACH = 0.25 * math.pi


def of_film(findings: Findings) -> Blocks:
    """Return measured against predicted, order spectra, and the misfit of each run."""
    table, orders = findings.arrays["film"], findings.arrays["film_orders"]
    if table.empty:
        return []
    waves: list[Panel] = []
    spectra: list[Panel] = []
    told = _apart(findings)
    for number, run in enumerate(shown_runs(findings)):
        own = of_run(table, run)
        own = own[own["angle"].abs() <= _REACH]
        if own.empty:
            continue
        x = own["angle"].to_numpy()
        marks: list[Mark] = [
            Line(x, own["measured"].to_numpy(), "measured", "measured"),
            Line(x, own["predicted"].to_numpy(), "model", "from flex", dashed=True),
        ]
        waves.append(Panel(marks, ANGLE, Axis("PVDF less its mean", "V"), title_of(findings, run)))
        lines = of_run(orders, run)
        if len(lines) and number in told:
            n = lines["order"].to_numpy(dtype=float)
            spectra.append(
                Panel(
                    [Points(n, lines["measured"].to_numpy(), "measured", "measured"), Line(n, lines["predicted"].to_numpy(), "model", "from flex")],
                    Axis("order", whole=True), Axis("amplitude", "V", "log"), run,
                )
            )  # fmt: skip
    found: Blocks = [
        Figure(
            "film", "PVDF measured and predicted from flex",
            f"Do both sensors see one belt? {captions.one_belt(findings)} The film's voltage over the angle and what the flex sensor's waveform makes of it by the rate model: "
            f"derivative at low orders, strain at high ones. Both curves hold the orders {int(orders['order'].min())} to {int(orders['order'].max())} of the wheel only, those that can be compared: "
            "the ripple beside the passage is that cut and not the film.",
            "film voltage over angle for each run, measured and predicted", waves, columns=2,
        )
    ]  # fmt: skip
    if spectra:
        found.append(
            Figure(
                "film_orders", "Order spectra of the PVDF",
                f"Where does the prediction hold? {captions.holds_up_to(orders[orders['run'].isin(panel.title for panel in spectra)])} Amplitude of each order of the wheel in the runs of lowest and highest load and speed; near the first null of the flex sensor (one wave on its "
                "length) nothing can be predicted.",
                "amplitude over order, measured and predicted", spectra, columns=2,
            )
        )  # fmt: skip
    return [*found, *_table(findings)]


def _apart(findings: Findings) -> set[int]:
    """Return which of the shown runs have the lowest and highest load and speed: the spectra of the others lie between."""
    table = findings.arrays["runs"].head(len(shown_runs(findings)))
    return {
        int(found)
        for name in ("load", "speed")
        for found in (table[name].fillna(0.0).argmin(), table[name].fillna(0.0).argmax())
    }


def _table(findings: Findings) -> Blocks:
    rows: list[list[Cell]] = []
    for p in findings.find("pvdf_nrmse"):
        word = Status("not determined", "warning")
        if p.value is not None:
            word = (
                Status("good", "ok")
                if p.value < GOOD
                else Status("poor", "rejected")
                if p.value > BAD
                else Status("fair", "warning")
            )
        rows.append([str(p.at["run"]), None if p.value is None else round(p.value, 4), word])
    if not rows:
        return []
    return [
        Table(
            "film_misfit", "Misfit of the prediction by run",
            f"{captions.film_words([row[-1].word for row in rows if isinstance(row[-1], Status)])} Rms of measured less predicted over the rms of the measured voltage; below {100 * GOOD:.0f} % is good, above {100 * BAD:.0f} % the "
            "sensors contradict each other.",
            [Column("run"), Column("NRMSE", "%"), Column("")], rows,
        )
    ]  # fmt: skip
