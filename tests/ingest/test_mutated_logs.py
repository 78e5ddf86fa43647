"""Good logs spoilt at random: each is refused in words or read, and rows that are lost are told."""

from __future__ import annotations

import os
import random
import warnings

import numpy as np
import pytest
from mcap_logs import stamped, write_json

from pipeline.errors import InputError
from pipeline.ingest.scan import scan_log

N = 400
SEEDS = range(int(os.environ.get("RIGFIT_MUTATIONS", "8")))
TIME = np.arange(N) / 200.0
ROWS = list(zip(TIME.tolist(), np.sin(9 * TIME).tolist(), (50 * np.cos(9 * TIME)).tolist(), strict=True))
WORDS = [
    b"ERR",
    b"nan",
    b'"',
    b";",
    b",",
    b"\n",
    b"\n\n",
    b"# note\n",
    b"time,x\n",
    b"1e400",
    b"\0",
    b"\xff",
    b"--",
    b"0,0",
    b"\t",
]


def lines(form: str, *header: str, end: str = "\n") -> bytes:
    return end.join([*header, *(form.format(*row) for row in ROWS), ""]).encode()


LOGS = {
    "comma": lines("{:.3f},{:.6f},{:.4f}", "# coil_current: 2 A", "time [s],displacement [mm],force [N]"),
    "semicolon": lines("{:.3f};{:.6f};{:.4f}", "Zeit;Weg;Kraft", "s;mm;N", end="\r\n").replace(b".", b","),
    "tab": lines("{:.3f}\t{:.6f}\t{:.4f}", "Operator\tSmith", "Speed\t10\tmm/s", "", "time\tx\tF", "(s)\t(mm)\t(N)"),
    "blanks": lines("{:10.3f} {:12.6f} {:12.4f}", "% time x F"),
    "quoted": lines('"{:.3f}","{:.6f}","{:.4f}"', '"时间","位移","力"', '"秒","毫米","牛"'),
    "dated": lines("2024-05-01 10:00:0{:.3f},{:.6f},{:.4f}", "timestamp,x [mm],F [N]"),
}


def mutated(content: bytes, rng: random.Random) -> bytes:
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 5])):
        at = rng.randrange(len(data)) if data else 0
        kind = rng.randrange(7)
        if kind == 0:
            del data[at:]
        elif kind == 1 and data:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 2:
            one, other = rng.sample([b",", b";", b"\t", b".", b" "], 2)
            data[at : at + 40] = data[at : at + 40].replace(one, other)
        elif kind == 3:
            data[at:at] = rng.choice(WORDS)
        elif kind == 4:
            begin, end = data.rfind(b"\n", 0, at) + 1, data.find(b"\n", at) + 1
            data[begin:begin] = data[begin:end]
        elif kind == 5:
            del data[at : at + rng.choice([1, 3, 30, 300])]
        else:
            begin, end = data.rfind(b"\n", 0, at) + 1, data.find(b"\n", at) + 1
            data[begin:end] = b""
    return bytes(data)


def scanned(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return scan_log(path)
        except InputError as error:
            refusal = str(error)
    assert "\n" not in refusal.strip()
    assert len(refusal) > 30
    return None


def numeric_lines(data: bytes) -> int:
    """Count the lines that begin as rows of this table do: two numbers at least, unharmed."""
    return sum(
        line.strip().strip(b'"')[:1].isdigit() and line.count(b".") + line.count(b",") >= 3
        for line in data.splitlines()
    )


@pytest.mark.parametrize("name", LOGS)
def test_a_spoilt_text_log_is_refused_in_words_or_read_and_its_losses_told(tmp_path, name):
    path = tmp_path / "log.csv"
    path.write_bytes(LOGS[name])
    usual = {finding.message for finding in scanned(path).quality}
    for seed in SEEDS:
        data = mutated(LOGS[name], random.Random(f"{name}{seed}"))
        path.write_bytes(data)
        scan = scanned(path)
        if scan is None:
            continue
        read = sum(table.summary.n for table in scan.tables)
        if read < numeric_lines(data):
            told = {finding.message for finding in scan.quality} - usual
            assert told, f"seed {seed}: {read} of {numeric_lines(data)} rows read and nothing said"


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_a_spoilt_mcap_is_refused_in_words_or_read_and_its_losses_told(tmp_path, compression):
    messages = stamped([{"x": x, "F": force} for _, x, force in ROWS])
    good = write_json(tmp_path / "good.mcap", {"/rig": messages}, compression=compression, chunk_size=4000).read_bytes()
    path = tmp_path / "log.mcap"
    for seed in SEEDS:
        path.write_bytes(mutated(good, random.Random(f"{compression}{seed}")))
        scan = scanned(path)
        if scan is not None and sum(table.summary.n for table in scan.tables) < N:
            assert any(finding.level != "note" for finding in scan.quality), f"seed {seed}"
