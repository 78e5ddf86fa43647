"""DVC and logs that lie elsewhere: each repro asks the place, and what is new there goes through the chain, nothing else."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).resolve().parents[2]


class Bench:
    """A project with a campaign 'near', whose logs are dropped, and 'far', whose logs lie in a bucket."""

    def __init__(self, folder: Path, client: Any) -> None:
        self.folder, self.client = folder, client
        self.environment = dict(os.environ)

    def run(self, *words: str, status: int = 0) -> str:
        done = subprocess.run(
            words, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == status, f"{words}: {done.stdout}\n{done.stderr}"
        return done.stdout + done.stderr

    def repro(self, status: int = 0) -> tuple[set[str], str]:
        """Run the chain; return the stages that ran, and what was said."""
        said = self.run("dvc", "repro", "--keep-going", status=status)
        return {line.split("'")[1] for line in said.splitlines() if line.startswith("Running stage")}, said

    def put(self, key: str, log: str) -> None:
        self.client.put_object(Bucket="lab-logs", Key=key, Body=(self.folder / "made" / log).read_bytes())

    def runs(self) -> list[str]:
        findings = json.loads((self.folder / "reports" / "far" / "findings.json").read_text())
        return [run["run"] for run in findings["runs"]]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    pytest.importorskip("s3fs", reason="reading S3 takes s3fs (pip install 'rigfit[s3]')")
    server = pytest.importorskip(
        "moto.server", reason="the S3 server of these tests is moto's (pip install 'moto[server]')"
    )
    import boto3

    folder = tmp_path_factory.mktemp("dvc-remote") / "project"
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    given = {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT / "tests" / "toy_rig"),
        "GIT_CONFIG_GLOBAL": os.devnull,
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "not-to-be-shown",
        "AWS_DEFAULT_REGION": "us-east-1",
        "NO_PROXY": "127.0.0.1",
    }
    client = boto3.client(
        "s3",
        endpoint_url=given["AWS_ENDPOINT_URL"],
        region_name="us-east-1",
        aws_access_key_id="testing",
        aws_secret_access_key="not-to-be-shown",
    )
    client.create_bucket(Bucket="lab-logs")
    folder.mkdir()
    for name in ("dvc.yaml", ".dvcignore", ".gitignore"):
        shutil.copy(ROOT / name, folder / name)
    (folder / "params.yaml").write_text("campaigns: []\nsynthetic: []\ndatasets: {}  # elsewhere\nuses: []\n")
    for part in ("ingest", "recording", "rigs", "estimation", "signals", "findings", "report"):
        (folder / "pipeline" / part).mkdir(parents=True)
        (folder / "pipeline" / part / "code.py").write_text("")
    made = Bench(folder, client)
    made.environment |= given
    made.run("git", "init", "-q")
    made.run("dvc", "init", "-q")
    made.run("rigfit", "new", "spring.pull", "near")
    made.run("rigfit", "new", "spring.pull", "far", "--datasets", "s3://lab-logs/far")
    made.run("rigfit", "synthesize", "spring.pull", "--out", "made")
    shutil.copy(folder / "made" / "pull_1.csv", folder / "datasets" / "near" / "first.csv")
    made.put("far/first.csv", "pull_1.csv")
    ran, _ = made.repro()
    assert {"fetch@far", "ingest@far", "ingest@near", "report@far", "index"} <= ran
    yield made
    running.stop()


def test_nothing_new_there_costs_one_question(bench: Bench) -> None:
    ran, said = bench.repro()
    assert ran == {"fetch@far"}
    assert "0 logs fetched, 0 removed, 1 as before" in said


def test_logs_added_replaced_and_removed_there_go_through_the_chain(bench: Bench) -> None:
    before = (bench.folder / "recordings" / "far" / "first.parquet").stat().st_mtime_ns
    bench.put("far/monday/second.csv", "pull_2.csv")
    ran, said = bench.repro()
    assert "1 log fetched, 0 removed, 1 as before" in said
    assert ran == {"fetch@far", "ingest@far", "identify@far", "report@far", "index"}
    assert (bench.runs(), (bench.folder / "recordings" / "far" / "first.parquet").stat().st_mtime_ns) == (
        ["first", "second"],
        before,
    )
    bench.put("far/first.csv", "pull_2.csv")
    bench.client.delete_object(Bucket="lab-logs", Key="far/monday/second.csv")
    ran, said = bench.repro()
    assert "1 log fetched, 1 removed, 0 as before" in said
    assert bench.runs() == ["first"]
    assert (bench.folder / "recordings" / "far" / "first.parquet").stat().st_mtime_ns != before
    assert bench.repro()[0] == {"fetch@far"}


def test_a_log_that_was_altered_here_is_fetched_again(bench: Bench) -> None:
    copy = bench.folder / "datasets" / "far" / "fetched" / "first.csv"
    kept = copy.read_bytes()
    copy.write_bytes(kept.replace(b"1", b"7"))
    ran, said = bench.repro()
    assert "1 log fetched" in said
    assert copy.read_bytes() == kept
    assert ran == {"fetch@far"}, "what DVC hashes is as it was"


def test_a_place_that_cannot_be_reached_stops_its_campaign_only(bench: Bench) -> None:
    page = bench.folder / "reports" / "far" / "report.html"
    kept = page.read_bytes()
    shutil.copy(bench.folder / "made" / "pull_2.csv", bench.folder / "datasets" / "near" / "second.csv")
    server = bench.environment["AWS_ENDPOINT_URL"]
    bench.environment["AWS_ENDPOINT_URL"] = "http://127.0.0.1:9"
    ran, said = bench.repro(status=255)
    bench.environment["AWS_ENDPOINT_URL"] = server
    assert "rigfit: far: s3://lab-logs/far: cannot be reached" in said
    assert "Recordings and reports are as they were." in said
    assert {"ingest@near", "identify@near", "report@near"} <= ran
    assert page.read_bytes() == kept
    assert (bench.folder / "datasets" / "far" / "fetched" / "first.csv").is_file()
    assert bench.repro()[0] == {"fetch@far", "index"}


def test_nothing_that_is_written_holds_the_credentials(bench: Bench) -> None:
    for path in bench.folder.rglob("*"):
        if path.is_file() and ".git" not in path.parts:
            assert b"not-to-be-shown" not in path.read_bytes(), path
