"""Ingest on a Dask cluster: a scheduler and two workers on this machine, one of which is killed in the middle of the work."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from pipeline.campaign.cluster import on_cluster
from pipeline.campaign.parallel import in_parallel
from pipeline.errors import InputError

pytest.importorskip("distributed")
PATIENCE = 60.0
TOY_RIG = str(Path(__file__).resolve().parents[1] / "toy_rig")


@dataclass
class Cluster:
    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


def start(*words: str, log: Path) -> subprocess.Popen[bytes]:
    # The workers import this file's own work by its name.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), TOY_RIG])}
    command = [sys.executable, "-m", *words]
    return subprocess.Popen(command, stdout=log.open("wb"), stderr=subprocess.STDOUT, env=environment)


def said(log: Path, pattern: str) -> str:
    """Wait until a process says something, and return it."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if found := re.search(pattern, log.read_text(errors="replace")):
            return found[1]
        time.sleep(0.05)
    raise AssertionError(f"nothing like {pattern} in: {log.read_text(errors='replace')}")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    folder = tmp_path_factory.mktemp("cluster")
    log = folder / "scheduler.log"
    scheduler = start("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", log=log)
    workers = []
    try:
        address = said(log, r"Scheduler at:\s+tcp://(127\.0\.0\.1:\d+)")
        for at in range(2):
            words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
            log = folder / f"worker{at}.log"
            workers.append(start("distributed.cli.dask_worker", f"tcp://{address}", *words, log=log))
        for at in range(2):
            said(folder / f"worker{at}.log", r"(Registered to)")
        yield Cluster(f"dask://{address}", scheduler, workers)
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def slow_square(number: int, marks: str) -> tuple[int, int]:
    """Work that leaves a mark when it begins, so that the test knows who is at it."""
    with (Path(marks) / f"{number}.{os.getpid()}").open("w"):
        time.sleep(0.15)
    return number * number, os.getpid()


def test_who_does_not_answer_is_named_with_what_to_start() -> None:
    for engine in ("127.0.0.1:8786", "dask://nowhere", "spark://127.0.0.1:1"):
        with pytest.raises(InputError, match=r"RIGFIT_ENGINE=.*expected is dask://HOST:PORT"):
            list(on_cluster(engine, pow, [(2, 3)]))


def test_recordings_made_on_a_cluster_are_those_made_here(
    cluster: Cluster, project: Path, rigfit: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    rigfit("new", "spring.pull", "wire")
    rigfit("synthesize", "wire")
    (project / "datasets/wire/bad.csv").write_text("no log\n")
    assert rigfit("ingest", "wire").status == 0
    folder = project / "recordings" / "wire"
    here = {path.name: path.read_bytes() for path in folder.iterdir()}
    for path in folder.iterdir():
        path.unlink()
    monkeypatch.setenv("RIGFIT_ENGINE", cluster.address)
    assert rigfit("ingest", "wire").status == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == here
    assert len(here) > 2


def test_a_worker_that_is_killed_in_the_middle_costs_nothing(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIGFIT_ENGINE", cluster.address)
    tasks = [(number, str(tmp_path)) for number in range(24)]
    found = []
    for result in in_parallel(slow_square, tasks, seconds=0):
        found.append(result)
        if len(found) == 6:
            cluster.workers[0].send_signal(signal.SIGKILL)
            cluster.workers[0].wait()
    assert [square for square, _ in found] == [number * number for number in range(24)]
    began = [path.name.split(".") for path in tmp_path.iterdir()]
    assert {pid for _, pid in began} == {str(worker.pid) for worker in cluster.workers}
    assert {pid for _, pid in found[-8:]} == {cluster.workers[1].pid}


def test_when_the_last_worker_is_gone_it_does_not_wait_for_ever(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.campaign.cluster._SECONDS_WITHOUT_WORKERS", 1.0)
    monkeypatch.setattr("pipeline.campaign.cluster._GLANCE", 0.5)
    tasks = [(number, str(tmp_path)) for number in range(24)]
    results = on_cluster(cluster.address, slow_square, tasks)
    assert next(results)[0] == 0
    for worker in cluster.workers:
        worker.kill()
        worker.wait()
    with pytest.raises(
        InputError, match=r"no worker is left, for 1 s now.*run the same command again; what was done is not"
    ):
        list(results)


@pytest.mark.thorough
def test_when_the_scheduler_goes_in_the_middle_it_is_told(cluster: Cluster, tmp_path: Path) -> None:
    address = cluster.address.removeprefix("dask://")
    worker = start("distributed.cli.dask_worker", f"tcp://{address}", "--nthreads", "1", "--no-nanny", "--no-dashboard",
                   "--local-directory", str(tmp_path), log=tmp_path / "worker.log")  # fmt: skip
    try:
        said(tmp_path / "worker.log", r"(Registered to)")
        results = on_cluster(cluster.address, slow_square, [(number, str(tmp_path)) for number in range(24)])
        assert next(results)[0] == 0
        cluster.scheduler.kill()
        with pytest.raises(InputError, match=r"the scheduler is gone\. Start what is missing"):
            list(results)
    finally:
        worker.kill()
        worker.wait()
