"""What is fuzzed: for each kind of input good ones to begin with, and what rigfit does with one.

A target answers "read" or raises InputError; anything else that happens is a defect.
"""

from __future__ import annotations

import json
import shutil
import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.fuzz import seeds


@dataclass(frozen=True)
class Target:
    """`seeds()` are good inputs, `run(data, folder)` reads one; `folder` is empty and the only place to write.

    `as_json` tells that mutations of the JSON tree make sense, `words` are what such inputs are made of. One that is not
    `followed` works mostly outside of the package: following its lines would take longer than it.
    """

    seeds: Callable[[], Sequence[bytes]]
    run: Callable[[bytes, Path], None]
    as_json: bool = False
    words: tuple[bytes, ...] = ()
    followed: bool = True


class _Wanted(NamedTuple):
    name: str
    unit: str
    description: str = "a quantity"
    required: bool = False
    limit: float | None = None
    counts_samples: bool = False
    lists_entries: bool = False
    no_value: float | None = None
    may_rest: bool = False


_WANTED = (_Wanted("x", "m"), _Wanted("F", "N"), _Wanted("state", ""))


def _log(suffix: str) -> Callable[[bytes, Path], None]:
    def read_log(data: bytes, folder: Path) -> None:
        """Do what `rigfit check` and `rigfit ingest` do with a log."""
        from pipeline.ingest.ingest import ingest_run
        from pipeline.ingest.scan import scan_log

        path = folder / f"log{suffix}"
        path.write_bytes(data)
        scan = scan_log(path)
        for table in scan.tables:
            assert table.summary.n >= 0
        for finding in scan.quality:
            finding.message.encode()
        ingest_run("r1", [("", path)], _WANTED, {}, {}, {}, folder / "out")

    return read_log


def _recipe(data: bytes, folder: Path) -> None:
    from pipeline.campaign.recipe import load

    path = folder / "r.yaml"
    path.write_bytes(data)
    recipe = load(path)
    json.dumps(recipe.settings.model_dump(mode="json"))


def _runs(data: bytes, folder: Path) -> None:
    from pipeline.campaign import runs_table
    from pipeline.campaign.conditions import of_run
    from pipeline.campaign.recipe import Recipe
    from pipeline.rigs.registry import experiment

    shear = experiment("mre.shear")
    path = folder / "runs.csv"
    path.write_bytes(data)
    table = runs_table.read(path, shear, "runs.csv")
    table.remarks({"r1": ["r1.csv"]})
    of_run("r1", Recipe.default(shear), table, {}, ["r1.csv"])


def _params(data: bytes, folder: Path) -> None:
    from pipeline.campaign.project import Project
    from pipeline.errors import InputError

    (folder / "params.yaml").write_bytes(data)
    (folder / "dvc.yaml").touch()
    project = Project.around(folder)
    for name in project.campaigns():
        project.not_handed_over(name, ["a"])
    for act in (lambda: project.dataset("b"), lambda: project.add("new-one", _shear(), "title", "s3://lab/new")):
        try:
            act()
        except InputError:
            continue


def _shear() -> Any:
    from pipeline.rigs.registry import experiment

    return experiment("mre.shear")


@cache
def _campaigns() -> Path:
    """Return a folder with the recordings and the findings of a small campaign, made once."""
    from dataclasses import replace

    from pipeline.campaign import identify_stage, ingest_stage, logs, synthesize_stage
    from pipeline.campaign.recipe import Recipe
    from pipeline.campaign.seen import Seen
    from pipeline.rigs.registry import experiment

    root = Path(tempfile.mkdtemp(prefix="fuzz-"))
    recipe = replace(Recipe.default(experiment("mre.axial")), path="r.yaml")
    synthesize_stage.synthesize(recipe, root / "logs", 1)
    runs = logs.runs_of(logs.of_folder(root / "logs"))
    made = ingest_stage.ingest(recipe, runs, root / "recordings", base=root, seen=Seen(root / "recordings"))
    identify_stage.identify("axial", recipe, made, {}, root / "reports")
    return root


def _findings(data: bytes, folder: Path) -> None:
    """Do what `rigfit report`, `export` and `--with` do with findings; the arrays beside them are good ones."""
    from pipeline.campaign import report_stage
    from pipeline.errors import InputError
    from pipeline.findings.export import as_csv, bearing_tables
    from pipeline.findings.storage import read
    from pipeline.report.index import index_entry, render_index
    from pipeline.rigs.registry import experiment

    shutil.copytree(_campaigns() / "reports" / "arrays", folder / "arrays")
    (folder / "findings.json").write_bytes(data)
    findings = read(folder)
    page = report_stage.report(findings, experiment("mre.axial"), "title", "command", folder)
    refuse_live(page.read_text(encoding="utf-8"))
    refuse_live(render_index([index_entry(findings, experiment("mre.axial"), "title", "x/report.html")]))
    as_csv(findings).encode()
    try:
        bearing_tables(findings)
    except InputError:
        return


def refuse_live(page: str) -> None:
    """Raise AssertionError where a page holds what fuzzing puts into texts as live markup."""
    assert "<script>alert" not in page
    assert "<img src=x" not in page
    page.encode()


def _findings_seeds() -> list[bytes]:
    return [(_campaigns() / "reports" / "findings.json").read_bytes()]


def _manifest(data: bytes, folder: Path) -> None:
    """Do what `rigfit ingest` and `identify` do with the manifest beside recordings."""
    from pipeline.campaign import ingest_stage, ingested, logs
    from pipeline.campaign.recipe import Recipe
    from pipeline.errors import InputError
    from pipeline.rigs.registry import experiment

    made = folder / "made"
    shutil.copytree(_campaigns() / "recordings", made)
    (made / ingested.MANIFEST).write_bytes(data)
    try:
        for recording in ingested.load(made).recordings():
            list(recording)
    except InputError:
        pass
    runs = logs.runs_of(logs.of_folder(_campaigns() / "logs"))[:1]
    ingest_stage.ingest(Recipe.default(experiment("mre.axial")), runs, made, base=_campaigns())


def _manifest_seeds() -> list[bytes]:
    return [(_campaigns() / "recordings" / "manifest.json").read_bytes()]


def _seen(data: bytes, folder: Path) -> None:
    """Remember what a file says that is whole as far as its check sum goes."""
    from pipeline.campaign import ingest_stage, logs, seen
    from pipeline.campaign.recipe import Recipe
    from pipeline.rigs.registry import experiment

    made = folder / "made"
    shutil.copytree(_campaigns() / "recordings", made)
    text = data.decode("utf-8", "replace").replace("\n", " ")
    digest = seen._digest(text) if text.isprintable() or text.isascii() else "0"
    (folder / ".made.seen.json").write_text(f"{digest}\n{text}\n", encoding="utf-8", errors="replace")
    runs = logs.runs_of(logs.of_folder(_campaigns() / "logs"))[:1]
    ingest_stage.ingest(Recipe.default(experiment("mre.axial")), runs, made, base=_campaigns(), seen=seen.Seen(made))


def _seen_seeds() -> list[bytes]:
    return [(_campaigns() / ".recordings.seen.json").read_text().split("\n")[1].encode()]


def _recording(data: bytes, folder: Path) -> None:
    """Read a recording's Parquet file whose metadata are `data`, or which is `data`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from pipeline.recording import storage

    path = folder / "r1.parquet"
    if data.startswith(b"PAR1"):
        path.write_bytes(data)
    else:
        table = pa.table({"time": seeds.TIME, "x": seeds.X}).replace_schema_metadata({storage.KEY: data})
        pq.write_table(table, path)
    recording = storage.read(path)
    for name in recording.names:
        recording.values(name)
    storage.run_of(path)
    list(storage.read_blocks(path))


def _recording_seeds() -> list[bytes]:
    import pyarrow.parquet as pq

    whole = next(iter(sorted((_campaigns() / "recordings").glob("*.parquet"))))
    return [whole.read_bytes(), pq.read_schema(whole).metadata[b"rigfit"]]


_YAML = (b"&a ", b"*a", b"<<: ", b"!!python/object/apply:os.system [x]", b"!!set ", b"!!binary aGk=", b"- ", b"? ", b"{", b"[", b"|\n",
         b".nan", b".inf", b"1e400", b"9" * 5000, b"0o7", b"2001-01-01", b"~", b"'", b'"', b"\t", b"#", b"%YAML 1.1\n---\n", b": ")  # fmt: skip
_CSV = (b"ERR", b"nan", b'"', b";", b",", b"\n", b"\r", b"# n: 1\n", b"1e400", b"\0", b"\xff", b"0x1F", b"--", b"\t", b"inf", b"9" * 400,
        b"\xef\xbb\xbf", b"=cmd|' /C calc'!A0", b"\x1b[31m", b"\xe2\x80\xae", b"sep=;\n")  # fmt: skip
_BINARY = (
    b"\xff" * 4,
    b"\0" * 8,
    b"\xff" * 8,
    b"\x7f\xff\xff\xff",
    b"\0\0\0\x80",
    b"\x28\xb5\x2f\xfd",
    b"\x89HDF",
    b"PAR1",
)

TARGETS = {
    "csv": Target(seeds.csv, _log(".csv"), words=_CSV),
    "mcap": Target(seeds.mcap, _log(".mcap"), words=(*_BINARY, b'{"x":', b"[[[[", b'"\\ud800"', b"float64[4294967295] ", b"\x03", b"\x06")),
    "mat": Target(seeds.mat, _log(".mat"), words=_BINARY),
    "bag": Target(seeds.bag, _log(".bag"), words=(*_BINARY, b"op=\x02", b"conn=", b"time=")),
    "db3": Target(seeds.db3, _log(".db3"), words=(*_BINARY, b"CREATE VIEW", b"messages")),
    "hdf5": Target(seeds.hdf5, _log(".h5"), words=_BINARY),
    "columnar": Target(seeds.columnar, _log(".parquet"), words=_BINARY),
    "recipe": Target(seeds.recipe, _recipe, words=_YAML),
    "runs": Target(seeds.runs, _runs, words=(*_CSV, b"../../x", b"CON", b"/etc/passwd", b"2 A", b"1e999 Hz")),
    "params": Target(seeds.params, _params, words=_YAML),
    "findings": Target(_findings_seeds, _findings, as_json=True, words=(b"Infinity", b"NaN", b"1e400", b"null", b"["), followed=False),
    "manifest": Target(_manifest_seeds, _manifest, as_json=True, words=(b"../../x", b"null"), followed=False),
    "seen": Target(_seen_seeds, _seen, as_json=True, words=(b"../../x", b"null")),
    "recording": Target(_recording_seeds, _recording, as_json=True, words=(*_BINARY, b"null")),
}  # fmt: skip


def run_quietly(target: Target, data: bytes, folder: Path) -> str:
    """Return "read" or "refused"; raises whatever else happens."""
    from pipeline.errors import InputError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", category=RuntimeWarning, module="pipeline")
        try:
            target.run(data, folder)
        except InputError as error:
            if not str(error).strip():
                raise AssertionError("an InputError without a word") from error
            return "refused"
    return "read"
