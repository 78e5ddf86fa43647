"""Findings handed on as JSON, MATLAB and MCAP: read back with the programs' own readers, every number as it was."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.findings import Findings, Parameter, Quality, Run, storage
from pipeline.findings import export_mcap as mcap_export
from pipeline.findings.export_json import as_json
from pipeline.findings.export_matlab import as_mat, matlab_names
from pipeline.findings.signals import Signals
from pipeline.recording import Channel, Provenance, Recording, Stream

TIME = np.arange(200) / 1000.0
FORCE = np.where(np.arange(200) == 7, np.nan, 100 * np.sin(40 * TIME))
STATE = np.array(["rest"] * 100 + ["run"] * 100, dtype=object)
BEGINS = 1_700_000_000.25
SIGNALS = (
    Signals("fit", {"measured": "N", "model": "N"}, "force"),
    Signals("pads", {"x": "m"}, by="pad"),
    Signals("not kept", {"x": "m"}),
)
UNITS = {"coil_current": "A", "frequency": "Hz", "force": "N"}


def unit_of(name: str) -> str:
    return UNITS.get(name, "")


def findings() -> Findings:
    """Two runs; a parameter of the campaign, one of each run, one that is not determined, and arrays."""
    parameters = [
        Parameter(name="k1", symbol="k_1", value=1.25e5, std_error=350.0, ci95=(1.243e5, 1.257e5), unit="N/m", at={"coil_current": 6.0}),
        Parameter(name="eta", symbol=r"\eta", value=0.25, unit="1", at={"run": "a"}),
        Parameter(name="eta", symbol=r"\eta", value=0.5, unit="1", at={"run": "b"}),
        Parameter(name="lag", symbol="τ", value=None, unit="s", at={"synchronous": True}, description="too short"),
    ]  # fmt: skip
    fit = pd.DataFrame(
        {"run": ["a"] * 20 + ["b"] * 5, "time": np.r_[TIME[::10], TIME[:5]], "measured": np.arange(25.0)}
    )
    fit["model"] = fit["measured"] + 0.5
    pads = pd.DataFrame(
        {"run": "a", "time": [0.2, 0.1, 0.1], "pad": [1, 1, 2], "x": [3e-6, np.nan, 2e-6], "good": [True, False, True]}
    )
    runs = [
        Run(run="a", conditions={"coil_current": 6.0, "test": "loop", "synthetic": True}, files=["a.csv"], sha256=["1" * 64],
            begins=BEGINS, duration=0.2),
        Run(run="b", used=False, reason="too short", conditions={"coil_current": 2.0}, files=["b.csv"], sha256=["2" * 64]),
    ]  # fmt: skip
    arrays = {"fit": fit, "pads": pads, "k_mr at 2 A": pd.DataFrame({"end": ["x", None], "1st": [1, 2]})}
    return Findings(
        campaign="pads", experiment="mre.shear", verdict="ok", parameters=parameters, runs=runs, arrays=arrays,
        reasons=["All µ are small."],
    )  # fmt: skip


def recording() -> Recording:
    channels = {"force": Channel("force", FORCE, "N"), "state": Channel("state", STATE, "")}
    slow = Stream("/bench/slow", TIME[::50], {"temperature": Channel("temperature", 293.15 + TIME[::50], "K")})
    return Recording(
        "a", {"fast": Stream("fast", TIME, channels), "/bench/slow": slow}, provenance=Provenance(begins=BEGINS)
    )


def test_the_json_is_a_table_of_all_parameters_with_units() -> None:
    content = json.loads(as_json(findings(), unit_of))
    table = pd.DataFrame(content["parameters"])
    assert list(table["name"]) == ["k1", "eta", "eta", "lag"]
    assert list(table["unit"]) == ["N/m", "1", "1", "s"]
    assert table.loc[0, ["value", "std_error", "ci95_low", "ci95_high", "at.coil_current"]].tolist() == [
        1.25e5,
        350.0,
        1.243e5,
        1.257e5,
        6.0,
    ]
    assert content["units"] == {"at.coil_current": "A", "at.run": "", "at.synchronous": ""}
    assert math.isnan(table["value"].astype(float)[3])
    assert table.loc[3, "description"] == "too short"


def test_the_mat_file_loads_with_every_number_and_valid_names() -> None:
    from scipy.io import loadmat

    found = findings()
    loaded = loadmat(io.BytesIO(as_mat(found, unit_of)), simplify_cells=True)["findings"]
    assert [p["name"] for p in loaded["parameters"]] == ["k1", "eta", "eta", "lag"]
    np.testing.assert_array_equal([p["value"] for p in loaded["parameters"]], [1.25e5, 0.25, 0.5, np.nan])
    np.testing.assert_array_equal([p["at_coil_current"] for p in loaded["parameters"]], [6.0, np.nan, np.nan, np.nan])
    assert loaded["parameters"][1]["at_run"] == "a"
    assert loaded["units"]["at_coil_current"] == "A"
    np.testing.assert_array_equal(loaded["arrays"]["fit"]["model"], found.arrays["fit"]["model"])
    np.testing.assert_array_equal(loaded["arrays"]["pads"]["x"], found.arrays["pads"]["x"])
    assert set(loaded["arrays"]) == {"fit", "pads", "k_mr_at_2_A"}
    assert list(loaded["columns"]["k_mr_at_2_A"]) == ["end", "1st"]
    np.testing.assert_array_equal(loaded["arrays"]["k_mr_at_2_A"]["x_1st"], [1.0, 2.0])
    assert loaded["runs"][0]["conditions"]["coil_current"] == 6.0
    assert loaded["runs"][0]["conditions"]["test"] == "loop"
    assert loaded["runs"][0]["begins"] == BEGINS
    assert loaded["reasons"] == "All µ are small."


def test_the_same_findings_give_the_same_mat_file_and_empty_ones_load(monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy.io import loadmat

    first = as_mat(findings(), unit_of)
    monkeypatch.setattr("time.asctime", lambda *_: "another day")
    assert as_mat(findings(), unit_of) == first
    assert b"written by rigfit" in first[:116]
    empty = Findings(campaign="none", experiment="mre.shear", verdict="rejected")
    assert loadmat(io.BytesIO(as_mat(empty, unit_of)), simplify_cells=True)["findings"]["verdict"] == "rejected"


def test_names_are_what_matlab_takes_and_differ() -> None:
    names = ["k_mr at 2 A", "k_mr_at_2_A", "end", "2x", "µ", "", "a" * 80, "a" * 81, "_x"]
    given = list(matlab_names(names).values())
    assert len(set(given)) == len(names)
    assert all(name.isidentifier() and name.isascii() and name[0].isalpha() and len(name) <= 63 for name in given)
    assert "end" not in given


def read_back(
    path: Path,
) -> tuple[dict[str, list[tuple[int, dict]]], dict[str, dict], dict[str, dict[str, str]], dict[str, bytes]]:
    """Return messages by topic, schemas by topic, metadata and attachments, as the official reader gives them."""
    from mcap.reader import make_reader

    messages: dict[str, list[tuple[int, dict]]] = {}
    schemas = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            schemas[channel.topic] = json.loads(schema.data)
            messages.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
    return messages, schemas, metadata, attachments


@pytest.fixture
def written(tmp_path: Path) -> Path:
    found = findings()
    topics = mcap_export.topics_of("a", recording(), found, SIGNALS)
    mcap_export.write(tmp_path / "a.mcap", found.runs[0], found, topics, unit_of)
    return tmp_path / "a.mcap"


def test_the_mcap_reader_finds_measured_and_modelled_signals_as_they_were(written: Path) -> None:
    messages, schemas, _, _ = read_back(written)
    assert set(messages) == {
        "/measured/fast",
        "/measured/bench/slow",
        "/findings/fit",
        "/findings/pads/pad_1",
        "/findings/pads/pad_2",
    }
    fast = messages["/measured/fast"]
    np.testing.assert_array_equal([fields.get("force", np.nan) for _, fields in fast], FORCE)
    np.testing.assert_array_equal([fields["timestamp"] for _, fields in fast], TIME)
    assert [fields["state"] for _, fields in fast] == list(STATE)
    assert "force" not in fast[7][1]  # what was not measured is not there
    assert [at for at, _ in fast[:3]] == [round((BEGINS + t) * 1e3) * 10**6 for t in TIME[:3]]
    fit = messages["/findings/fit"]
    assert [fields["model"] - fields["measured"] for _, fields in fit] == [0.5] * 20
    assert [fields["x"] for _, fields in messages["/findings/pads/pad_1"] if "x" in fields] == [3e-6]
    assert schemas["/findings/fit"]["properties"]["model"] == {"type": "number", "unit": "N"}
    assert schemas["/measured/bench/slow"]["properties"]["temperature"]["unit"] == "K"
    assert schemas["/measured/fast"]["properties"]["state"] == {"type": "string"}


def test_messages_of_all_topics_come_in_time(written: Path) -> None:
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    with written.open("rb") as file:
        times = [record.log_time for record in StreamReader(file).records if isinstance(record, Message)]
    assert len(times) == 200 + 4 + 20 + 3
    assert times == sorted(times)


def test_conditions_parameters_and_what_was_noticed_are_metadata(tmp_path: Path) -> None:
    quality = [
        Quality(level="warning", run="a", channel="force", span=(0.5, 1.0), message="stuck"),
        Quality(level="note", run="b", message="of another run"),
    ]
    found = findings().model_copy(update={"quality": quality})
    mcap_export.write(tmp_path / "a.mcap", found.runs[0], found, [], unit_of)
    _, _, metadata, attachments = read_back(tmp_path / "a.mcap")
    assert metadata["quality"] == {"001": "warning, force, 0.5 to 1 s: stuck"}
    assert metadata["verdict"] == {"001": "All µ are small."}
    assert metadata["conditions"] == {"coil_current": "6 A", "test": "loop", "synthetic": "true"}
    assert metadata["parameters"] == {
        "k1 [coil_current=6]": "125000 ± 350 N/m", "eta [run=a]": "0.25", "lag [synchronous=True]": "not determined: too short",
    }  # fmt: skip
    assert metadata["rigfit"]["sha256 of a.csv"] == "1" * 64
    assert len(json.loads(attachments["parameters.json"])["parameters"]) == 4


def test_the_same_run_gives_the_same_bytes(written: Path, tmp_path: Path) -> None:
    found = findings()
    mcap_export.write(
        tmp_path / "again.mcap", found.runs[0], found, mcap_export.topics_of("a", recording(), found, SIGNALS), unit_of
    )
    assert (tmp_path / "again.mcap").read_bytes() == written.read_bytes()


def test_a_run_that_begins_before_its_second_0_and_has_no_date_is_written(tmp_path: Path) -> None:
    early = Recording("a", {"": Stream("", np.array([-0.5, 0.0]), {"force": Channel("force", np.ones(2), "N")})})
    found = findings()
    mcap_export.write(tmp_path / "e.mcap", Run(run="a"), found, mcap_export.topics_of("a", early, found, ()), unit_of)
    messages, *_ = read_back(tmp_path / "e.mcap")
    assert [(at, fields["timestamp"]) for at, fields in messages["/measured"]] == [(5 * 10**8, -0.5), (10**9, 0.0)]


def test_what_is_exported_is_read_again_with_its_units(written: Path, rigfit: Callable) -> None:
    told = rigfit("check", written)
    assert "coil_current" in told.out
    assert told.status < 2, told.err + told.out


def test_the_command_exports_a_run_of_rigfit_run_with_its_recordings(tmp_path: Path, rigfit: Callable) -> None:
    """From logs to MCAP: /measured holds the recording, /findings the model, sample by sample."""
    assert rigfit("synthesize", "spring.pull", "--out", tmp_path / "logs").status == 0
    assert rigfit("run", "spring.pull", *(tmp_path / "logs").glob("*.*"), "--out", tmp_path / "out").status == 0
    for form in ("json", "matlab", "mcap"):
        told = rigfit("export", tmp_path / "out", "--to", form, "--out", tmp_path / "made")
        assert told.status == 0, told.err
    assert {path.name for path in (tmp_path / "made").iterdir()} == {
        "out.json", "out.mat", "out-pull_1.mcap", "out-pull_2.mcap",
    }  # fmt: skip
    from pipeline.recording.storage import read

    kept = read(tmp_path / "out" / "recordings" / "pull_2.parquet")
    messages, _, metadata, _ = read_back(tmp_path / "made" / "out-pull_2.mcap")
    measured = [fields["force"] for _, fields in messages["/measured"]]
    np.testing.assert_array_equal(measured, kept.values("force"))
    table = storage.read(tmp_path / "out").arrays["pulls"]
    model = [fields["model"] for _, fields in messages["/findings/pulls"]]
    np.testing.assert_array_equal(model, table[table["run"] == "pull_2"]["model"])
    assert metadata["conditions"]["wire_diameter"] == "0.001 m"
    recording = tmp_path / "out" / "recordings" / "pull_2.parquet"
    whole = recording.read_bytes()
    recording.write_bytes(whole[:-400])
    told = rigfit("export", tmp_path / "out", "--to", "mcap")
    assert told.status == 2
    assert "damaged" in told.err
    recording.write_bytes(whole)
    content = json.loads((tmp_path / "out" / "findings.json").read_text())
    content["runs"][0]["sha256"] = ["0" * 64]
    (tmp_path / "out" / "findings.json").write_text(json.dumps(content))
    told = rigfit("export", tmp_path / "out", "--to", "mcap")
    assert told.status == 2
    assert "is of other logs than the findings" in told.err


def test_without_recordings_what_the_findings_tell_is_exported_and_said(tmp_path: Path, rigfit: Callable) -> None:
    found = findings()
    found.arrays["loops"] = pd.DataFrame(
        {"run": "a", "time": TIME, "displacement": TIME, "force": FORCE, "model": FORCE, "residual": 0 * TIME}
    )
    storage.write(found, tmp_path)
    told = rigfit("export", tmp_path, "--to", "mcap", "--out", tmp_path / "made")
    assert told.status == 0, told.err
    assert "no recordings of 'pads' are here" in told.err
    assert "findings hold none of them: b" in told.err
    assert [path.name for path in (tmp_path / "made").glob("*")] == ["pads-a.mcap"]
    storage.write(findings(), tmp_path)
    told = rigfit("export", tmp_path, "--to", "mcap", "--out", tmp_path / "none")
    assert told.status == 2
    assert "nothing to export" in told.err
