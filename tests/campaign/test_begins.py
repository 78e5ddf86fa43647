"""When a run was recorded goes from the log into the findings, and is null where no log bears a date."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path


def test_a_log_with_dates_tells_when_its_run_began(tmp_path: Path, rigfit: Callable) -> None:
    rows = [f"2024-03-09T12:00:{k / 10:04.1f}Z,{1e-3 * k},{0.2 * k}" for k in range(50)]
    dated, plain = tmp_path / "dated.csv", tmp_path / "plain.csv"
    head = "# wire_diameter: 1 mm"
    dated.write_text("\n".join([head, "time,extension [m],force [N]", *rows]) + "\n")
    plain.write_text(
        "\n".join(
            [
                head,
                "time [s],extension [m],force [N]",
                *(f"{k / 10},{row.partition(',')[2]}" for k, row in enumerate(rows)),
            ]
        )
        + "\n"
    )
    told = rigfit("run", "spring.pull", dated, plain, "--out", tmp_path / "out")
    assert told.status == 0, told.err
    runs = json.loads((tmp_path / "out" / "findings.json").read_text())["runs"]
    assert {run["run"]: run["begins"] for run in runs} == {"dated": 1_709_985_600.0, "plain": None}
