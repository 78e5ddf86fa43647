"""Clocks of one log that drift apart, and stated rates that the stamps do not have, are named."""

from __future__ import annotations

import numpy as np
import pytest
from mcap_logs import write_json

from pipeline.ingest.scan import scan_log

N = 2000


def said(path) -> str:
    return " ".join(finding.message for finding in scan_log(path).quality if finding.level == "warning")


@pytest.mark.parametrize(("drift", "is_told"), [(0.0, False), (1e-3, True), (-2e-4, True), (1e-5, False)])
@pytest.mark.parametrize("carried", ["time", "stamp"])
def test_a_devices_clock_that_drifts_against_the_recorders_is_named(tmp_path, drift, is_told, carried):
    late = np.random.default_rng(3).exponential(1e-4, N)
    schema = {"properties": {carried: {"type": "number", "unit": "s"}, "F": {"type": "number", "unit": "N"}}}
    messages = [
        (int(1e9 * (100 + 0.01 * k * (1 + drift) + late[k])), {carried: 0.01 * k, "F": float(np.sin(k))})
        for k in range(N)
    ]
    path = write_json(tmp_path / "a.mcap", {"/rig": messages}, schemas={"/rig": schema})
    assert ("drift apart" in said(path)) == is_told
    if is_told:
        assert f"{abs(drift) * 20:.1g}" in said(path)


@pytest.mark.parametrize(
    ("stated", "is_told"),
    [("fs: 100 Hz", False), ("Sample rate: 0.1 kHz", False), ("fs: 100.05", False), ("fs: 200 Hz", True),
     ("sampling rate: 101 Hz", True), ("dt: 10 ms", False), ("dt: 20 ms", True)],
)  # fmt: skip
def test_a_stated_rate_that_the_stamps_do_not_have_is_named(tmp_path, stated, is_told):
    path = tmp_path / "a.csv"
    rows = "".join(f"{k / 100:.2f},{np.sin(k):.4f}\n" for k in range(N))
    path.write_text(f"# {stated}\ntime [s],F [N]\n{rows}")
    assert ("samples a second, " in said(path)) == is_told
