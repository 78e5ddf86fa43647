"""What the radio lost, what the passages look like, and the energy that the paper speaks of."""

from __future__ import annotations

from pipeline.findings import Findings
from pipeline.findings.figures import Cell, Column, Status, Table, Text, Value
from pipeline.rigs.tire.bench import captions, paper
from pipeline.rigs.tire.bench.sections_waveform import Blocks


def of_quality(findings: Findings) -> Blocks:
    """Return the table of data quality."""
    table = findings.arrays["passages"]
    if table.empty:
        return []
    rows: list[list[Cell]] = []
    for row in table.to_dict("records"):
        rows.append([
            str(row["run"]), "yes" if row["used"] else "no", round(float(row["loss"]), 4), round(float(row["longest_gap"]), 4), int(row["revolutions"]), int(row["lost"]),
            int(row["rejected"]), {1: "up", -1: "down"}.get(int(row["polarity"]), "unknown"), round(float(row["skewness"]), 2),
            round(float(row["first_harmonic"]), 5), round(float(row["speed_scatter"]), 4), round(float(row["drift"]), 4),
        ])  # fmt: skip
    both = [("temperature", "degC", "liner temperature"), ("pressure", "Pa", "inflation pressure")]
    told = [(name, unit, words) for name, unit, words in both if table[name].nunique(dropna=False) > 1]
    columns = [
        Column("run"), Column("used"), Column("packets lost", "%"), Column("longest gap", "s"), Column("revolutions used"), Column("lost or repaired"),
        Column("rejected"), Column("peaks point"), Column("skewness"), Column("first harmonic", "%"), Column("speed scatter", "%"), Column("R0 drift", "%"),
    ]  # fmt: skip
    found: Blocks = [
        Table(
            "passages", "Quality of the passages",
            f"{captions.passages(table)} First harmonic of R₂ over the peak: a closed belt has none, above 2 % it is an artefact. Skewness of a flex sensor is 3 to 5. R0 drift: "
            "change of the revolution's mean over the run.",
            columns, rows,
        )
    ]  # fmt: skip
    if told:
        found.append(
            Table(
                "state", "State of the tire",
                "As the runs state it; nothing here was measured by rigfit.",
                [Column("run"), *(Column(words, unit) for _, unit, words in told)],
                [[str(row["run"]), *(Value(float(row[name])) for name, _, _ in told)] for row in table.to_dict("records")],
            )
        )  # fmt: skip
    return found


def of_energy(findings: Findings) -> Blocks:
    """Return the energy box: what was measured, what the paper's numbers give, no battery life without a time base."""
    saved = 1.0 - paper.CHARGE_GATED / paper.CHARGE_ALWAYS
    factor = paper.CHARGE_ALWAYS / paper.CHARGE_GATED
    said = [
        f"The paper's sleep mode cuts the charge from {paper.CHARGE_ALWAYS / paper.MAH:.0f} to {paper.CHARGE_GATED / paper.MAH:.0f} mAh. That is "
        f"{100 * saved:.1f} % less, a factor of {factor:.2f}, and not the {100 * paper.SAVING:.1f} % that it prints twice."
    ]
    table = findings.arrays["energy"]
    rows: list[list[Cell]] = []
    for row in table.to_dict("records"):
        rows.append(
            [
                str(row["run"]),
                Status("asleep at rest", "ok") if row["gated"] else "always on",
                *(float(row[name]) for name in _MEANS),
            ]
        )
    bases = sorted({float(base) for base in table["time_base"].dropna()})
    if bases:
        for base in bases:
            lives = [paper.life(charge, base) / 3600.0 for charge in (paper.CHARGE_ALWAYS, paper.CHARGE_GATED)]
            said.append(
                f"With the time base of {base / 3600.0:.3g} h that these runs state, {paper.BATTERY / paper.MAH:.0f} mAh last {lives[0]:.3g} h without "
                f"and {lives[1]:.3g} h with the sleep mode."
            )
    else:
        said.append(
            "A charge without the time in which it is used gives no battery life: none is computed, as no run states 'time_base'. Means of "
            f"{paper.CHARGE_ALWAYS / paper.MAH:.0f} or {paper.CHARGE_GATED / paper.MAH:.0f} mA would be more than a microcontroller and this radio draw."
        )
    if not len(table):
        said.append("No supply current was logged: nothing of this is measured here.")
        return [Text(said)]
    return [
        Text(said),
        Table(
            "energy", "Measured supply", "Means over each run.",
            [Column("run"), Column("transmitter"), Column("current", "A"), Column("battery", "V"), Column("power", "W")], rows,
        ),
    ]  # fmt: skip


_MEANS = ("current", "voltage", "power")
