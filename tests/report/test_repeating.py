"""What a report says to whoever repeats it, followed to the letter: the findings are the same, bit for bit."""

from __future__ import annotations

import re
import subprocess
from html import unescape
from pathlib import Path

import pytest
import yaml

from pipeline.campaign import report_stage
from pipeline.campaign.code_digest import FLOORS, code_digest
from pipeline.findings import Findings
from pipeline.report.citation import bibtex
from pipeline.report.repeating import check
from pipeline.rigs.registry import all_experiments

ROOT = Path(__file__).resolve().parents[2]
CHEAP = "rap-cytotoxicity"


def bytes_of(folder: Path) -> dict[str, bytes]:
    kept = [folder / "findings.json", *sorted(folder.glob("arrays/*"))]
    return {path.name: path.read_bytes() for path in kept}


def test_the_commands_of_a_report_give_the_same_findings_in_an_empty_folder(
    rigfit, project, tmp_path_factory, monkeypatch
):
    def begin(folder: Path) -> None:
        (folder / "recipes").mkdir(exist_ok=True)
        (folder / "recipes" / f"{CHEAP}.yaml").write_bytes((ROOT / "recipes" / f"{CHEAP}.yaml").read_bytes())
        for name in ("params.yaml", "dvc.yaml"):
            (folder / name).write_bytes((ROOT / name).read_bytes())
        monkeypatch.chdir(folder)

    begin(project)
    for stage in ("synthesize", "ingest", "identify", "report"):
        assert rigfit(stage, CHEAP).status == 0
    first = project / "reports" / CHEAP
    told = re.search(r"step by step.*?<code>(.*?)</code>", (first / "report.html").read_text("utf-8"), re.S)
    assert told
    text = unescape(told[1])
    page = unescape((first / "report.html").read_text("utf-8"))
    exact = re.search(r"rigfit --version  # says: (rigfit \S+, code [0-9a-f]{64})", page)
    assert exact
    assert rigfit("--version").out.strip() == exact[1]
    empty = tmp_path_factory.mktemp("again")
    begin(empty)
    before, check, after = re.split(r"(sha256sum .*?\nEND\n)", text, flags=re.S)
    for part in (before, check, after):
        if part == check:
            seen = subprocess.run(["bash", "-c", part], cwd=empty, capture_output=True, text=True, check=False)
            assert seen.returncode == 0, seen.stdout + seen.stderr
            continue
        for line in part.strip().splitlines():
            program, *words = line.split()
            assert program == "rigfit"
            assert rigfit(*words).status == 0, line
    assert bytes_of(empty / "reports" / CHEAP) == bytes_of(first)


def test_the_code_that_findings_are_tied_to_is_the_code_whose_change_makes_dvc_identify_anew():
    stages = yaml.safe_load((ROOT / "dvc.yaml").read_text("utf-8"))["stages"]
    depends = {
        path.removeprefix("pipeline/") for path in stages["identify"]["do"]["deps"] if path.startswith("pipeline/")
    }
    assert depends == set(FLOORS)


def test_used_findings_are_checked_with_the_logs():
    used = {"reports/bench/findings.json": "a" * 64}
    findings = Findings(
        campaign="road", experiment="tire.road", verdict="ok", provenance={"logs": {"r1.csv": "b" * 64}, "uses": used}
    )
    assert check(findings).splitlines()[1:3] == [f"{'a' * 64}  reports/bench/findings.json", f"{'b' * 64}  r1.csv"]


def test_the_revision_of_the_code_is_told_only_for_findings_of_this_code(tmp_path, monkeypatch):
    monkeypatch.setattr(report_stage, "code_revision", lambda: "0123abcd")
    own = {"rigfit": "1", "code_sha256": code_digest(), "libraries": {"numpy": "2.0"}}
    for provenance, told in ((own, True), ({**own, "code_sha256": "f" * 64}, False)):
        experiment = all_experiments()["mre.shear"]
        findings = Findings(campaign="c", experiment="mre.shear", verdict="rejected", provenance=provenance)
        page = report_stage.report(findings, experiment, "", "rigfit", tmp_path)
        assert ("git checkout 0123abcd" in page.read_text("utf-8")) == told


@pytest.mark.parametrize("experiment", sorted(all_experiments()))
def test_references_are_valid_bibtex(experiment):
    references = all_experiments()[experiment].references
    text = bibtex(references)
    entries = re.findall(r"^@(article|misc)\{([A-Za-z][\w:-]*),\n((?:  \w+ = \{.*\},?\n)+)\}$", text, re.M)
    assert len(entries) == len(references) == text.count("@")
    assert len({key for _, key, _ in entries}) == len(references)
    for kind, _, body in entries:
        fields = dict(re.findall(r"^  (\w+) = \{(.*)\},?$", body, re.M))
        assert {"author", "title", "year"} <= set(fields)
        assert kind == "misc" or fields["journal"]
        assert re.fullmatch(r"\d{4}", fields["year"])
        for name, value in fields.items():
            depth = 0
            for sign in value:
                depth += (sign == "{") - (sign == "}")
                assert depth >= 0, value
            assert depth == 0, value
            assert name == "doi" or not re.search(r"(?<!\\)[&%#_$]", value), value
