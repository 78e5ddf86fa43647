"""Work on runs over processes: in order, and a task that takes its process along takes nothing else."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from pipeline.campaign import ingest_stage
from pipeline.campaign.parallel import in_parallel
from pipeline.errors import InputError

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
pytestmark = pytest.mark.skipif(CORES < 2, reason="one core: all work is done in this process")
ENOUGH = 100.0  # s


def square(number: int, deadly: frozenset[int] = frozenset()) -> tuple[int, int]:
    if number in deadly:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number, os.getpid()


def lost(number: int, _deadly: frozenset[int]) -> tuple[int, int]:
    return -number, 0


def test_results_come_in_the_order_of_the_tasks_from_other_processes() -> None:
    found = list(in_parallel(square, [(number,) for number in range(30)], ENOUGH))
    assert [value for value, _ in found] == [number * number for number in range(30)]
    assert os.getpid() not in {process for _, process in found}


def test_a_task_that_kills_its_process_is_told_and_all_others_are_done() -> None:
    deadly = frozenset({1, 2, 8})
    found = list(in_parallel(square, [(number, deadly) for number in range(12)], ENOUGH, lost))
    assert [value for value, _ in found] == [-n if n in deadly else n * n for n in range(12)]


def test_without_a_word_for_it_a_killed_process_is_no_traceback() -> None:
    tasks = [(number, frozenset({2})) for number in range(6)]
    with pytest.raises(
        InputError, match="a worker process was killed in the middle of its work, most often for lack of"
    ):
        list(in_parallel(square, tasks, ENOUGH))


def test_a_log_that_crashes_its_reader_is_left_out_and_named() -> None:
    task = ingest_stage._Task("r7", (), {"": "datasets/a/r7.h5"}, None, None, "")
    run, said = ingest_stage._died(task, Path())
    assert run == "r7"
    assert said.startswith("datasets/a/r7.h5: the process that read it was killed")
