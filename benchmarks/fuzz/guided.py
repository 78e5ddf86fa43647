"""Trying inputs one after the other, those that reach new lines kept and spoilt further.

Under atheris (libFuzzer) where it is installed, else by a loop of our own that follows lines through `sys.settrace`.
"""

from __future__ import annotations

import hashlib
import json
import random
import re
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from benchmarks.fuzz.guarded import Guard, tried
from benchmarks.fuzz.mutations import mutated
from benchmarks.fuzz.targets import TARGETS, Target
from pipeline.errors import InputError

_PACKAGE = f"{Path(__file__).parents[2] / 'pipeline'}/"
_SAVED_EVERY = 1.0
_MANY = 50
_SOUND = 0.6


def engine() -> str:
    """Tell what guides the search here."""
    return "atheris" if find_spec("atheris") else "line coverage by sys.settrace"


class Session:
    """Tries inputs of one target and counts; all it learns stands in `state`, for whoever watches this process."""

    def __init__(self, name: str, state: Path) -> None:
        self.target: Target = TARGETS[name]
        self.name, self.state = name, state
        self.counts: Counter[str] = Counter()
        self.broken: set[str] = set()
        self.scratch = Path(tempfile.mkdtemp(prefix="case-", dir=state))
        self.guard = Guard(self.scratch)
        self._saved = 0.0

    def one(self, data: bytes) -> str:
        """Try one input; what breaks is kept once for each place."""
        (self.state / "current").write_bytes(data)
        outcome, told = tried(self.target, data, self.scratch, self.guard)
        self.counts[outcome] += 1
        place = re.sub(r" \(.*|\d+ MB", "", told)
        if told and place not in self.broken:
            self.broken.add(place)
            keep(self.state, self.name, data, told)
        if time.monotonic() - self._saved > _SAVED_EVERY:
            self.save()
        return outcome

    def save(self) -> None:
        """Write the counts for whoever watches."""
        self._saved = time.monotonic()
        (self.state / "counts.json").write_text(json.dumps(self.counts))


def keep(state: Path, name: str, data: bytes, told: str) -> None:
    """Keep an input that broke something, with what happened."""
    stem = f"{name}-{hashlib.sha256(data).hexdigest()[:12]}"
    (state / f"{stem}.bin").write_bytes(data)
    (state / f"{stem}.txt").write_text(f"{told}\n", encoding="utf-8", errors="backslashreplace")


def run(name: str, state: Path, seconds: float, seed: int) -> None:
    """Try inputs of a target for so many seconds."""
    session = Session(name, state)
    corpus = list(session.target.seeds())
    corpus += [path.read_bytes() for path in sorted(state.glob("corpus/*"))]
    for (
        data
    ) in session.target.seeds():  # imports, compiles and caches what is loaded at first use, before anything is counted
        with suppress(InputError):
            session.target.run(data, Path(tempfile.mkdtemp(dir=state)))
    (_with_atheris if find_spec("atheris") else _traced)(session, corpus, seconds, seed)
    session.save()


def _traced(session: Session, corpus: list[bytes], seconds: float, seed: int) -> None:
    rng = random.Random(seed)
    seen: set[int] = set()
    sound = []
    for data in corpus:
        outcome, _ = _reached(session, data, seen)
        sound += [data] if outcome == "read" else []
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        # What was found last is where something new may lie; but most of that is refused early.
        parent = (
            rng.choice(sound or corpus) if rng.random() < _SOUND else corpus[-1 - int(len(corpus) * rng.random() ** 2)]
        )
        data = mutated(parent, corpus, session.target.words, session.target.as_json, rng)
        outcome, is_new = _reached(session, data, seen)
        if is_new:
            corpus.append(data)
            sound += [data] if outcome == "read" else []
            session.counts["new lines"] = len(seen)
            (session.state / "corpus").mkdir(exist_ok=True)
            (session.state / "corpus" / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)


def _reached(session: Session, data: bytes, seen: set[int]) -> tuple[str, bool]:
    """Try an input; return what came of it, and whether it went from a line to a line of the package as none before."""
    if not session.target.followed:
        return session.one(data), False
    before = len(seen)
    calls: Counter[CodeType] = Counter()

    def traced(frame: FrameType, _event: str, _argument: Any) -> Any:
        code = frame.f_code
        calls[code] += 1
        # What is called for every cell is followed now and then only.
        if not code.co_filename.startswith(_PACKAGE) or (calls[code] > _MANY and calls[code] % _MANY):
            return None
        last = 0

        def line(frame: FrameType, event: str, _argument: Any) -> Any:
            nonlocal last
            if event == "line":
                seen.add(hash((code, last, frame.f_lineno)))
                last = frame.f_lineno
            return line

        return line

    sys.settrace(traced)
    try:
        outcome = session.one(data)
    finally:
        sys.settrace(None)
    return outcome, len(seen) > before


def _with_atheris(session: Session, corpus: list[bytes], seconds: float, seed: int) -> None:
    import atheris

    rng = random.Random(seed)
    folder = session.state / "corpus"
    folder.mkdir(exist_ok=True)
    for data in corpus:
        (folder / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)

    def spoilt(data: bytes, most: int, seed: int) -> bytes:
        if rng.random() < 0.5:
            return atheris.Mutate(data, most)
        return mutated(data, corpus, session.target.words, session.target.as_json, random.Random(seed))[:most]

    options = [
        f"-max_total_time={max(1, int(seconds))}",
        f"-seed={seed + 1}",
        "-verbosity=0",
        "-rss_limit_mb=0",
        "-max_len=65536",
    ]
    with atheris.instrument_imports(include=["pipeline"]):
        for module in [name for name in sys.modules if name.split(".")[0] == "pipeline"]:
            del sys.modules[module]  # to be loaded again, with its lines counted
        atheris.Setup([sys.argv[0], str(folder), *options], session.one, custom_mutator=spoilt)
        atheris.Fuzz()
