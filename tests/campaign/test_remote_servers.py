"""Logs on servers of this machine: S3 as moto serves it, web pages, and servers that refuse, break off or say nothing."""

from __future__ import annotations

import base64
import functools
import http.server
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest

from pipeline.campaign.remote import source as remote_source
from pipeline.campaign.remote.at_once import within
from pipeline.campaign.remote.mirror import Mirrored, mirror
from pipeline.campaign.remote.source import Source
from pipeline.errors import InputError

LOG = b"time [s],x [mm]\n0,1\n"
KEYS = [
    *(
        "sample-b/r1.csv",
        "sample-b/monday/r2.csv",
        "sample-b/runs.csv",
        "sample-b/notes.md",
        "sample-b/",
        "sample-b/monday/",
    ),
    *("sample-b/../evil.csv", "sample-b//abs.csv", "sample-b/a.csv", "sample-b/a.csv/b.csv", "sample-b/c\\..\\d.csv"),
    *("sample-b/Ü %41:?.csv", "sample-b/empty.csv", "sample-b2/other.csv"),
]


@pytest.fixture(scope="module")
def s3_server() -> Iterator[str]:
    """The address of an S3 server."""
    pytest.importorskip("s3fs", reason="reading S3 takes s3fs (pip install 'rigfit[s3]')")
    server = pytest.importorskip(
        "moto.server", reason="the S3 server of these tests is moto's (pip install 'moto[server]')"
    )
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    yield f"http://{host}:{port}"
    running.stop()


@pytest.fixture(scope="module")
def client(s3_server: str) -> Any:
    """A client of it whose bucket lab-logs holds KEYS; who changes something there takes a bucket of its own."""
    import boto3

    made = boto3.client(
        "s3",
        endpoint_url=s3_server,
        region_name="us-east-1",
        aws_access_key_id="testing",
        aws_secret_access_key="not-to-be-shown",
    )
    made.create_bucket(Bucket="lab-logs")
    for key in KEYS:
        made.put_object(
            Bucket="lab-logs", Key=key, Body=b"" if key.endswith("/") or "empty" in key else LOG + key.encode()
        )
    return made


@pytest.fixture
def s3(client: Any, s3_server: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The same client; the environment gives the server's address and credentials."""
    monkeypatch.setenv("AWS_ENDPOINT_URL", s3_server)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "testing")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "not-to-be-shown")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.delenv("AWS_PROFILE", raising=False)
    return client


@pytest.fixture
def here(tmp_path: Path) -> Path:
    return tmp_path / "campaign" / "fetched"


def fetch(url: str, here: Path) -> Mirrored:
    return mirror(Source(url, here.parent), here, lambda _number: nullcontext(lambda _name: None))


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_a_bucket_is_mirrored_whatever_its_keys_are(s3: Any, here: Path, tmp_path: Path) -> None:
    fetch("s3://lab-logs/sample-b", here)
    assert names(here) == [
        *("%2E%2E/evil.csv", "%2Fabs.csv", "a.csv", "a.csv%2Fb.csv", "c%5C..%5Cd.csv", "empty.csv", "monday/r2.csv"),
        *("r1.csv", "runs.csv", "Ü %41:?.csv"),
    ]
    assert (here / "a.csv%2Fb.csv").read_bytes() == LOG + b"sample-b/a.csv/b.csv"
    assert {path.name for path in tmp_path.iterdir()} == {"campaign"}
    assert {path.name for path in here.parent.iterdir()} == {"fetched", ".fetched.json"}
    assert "not-to-be-shown" not in (here.parent / ".fetched.json").read_text()


def test_only_what_changed_in_a_bucket_is_fetched(s3: Any, here: Path) -> None:
    s3.create_bucket(Bucket="changing")
    for key in ("b/r1.csv", "b/r2.csv", "b/a.csv", "b/a.csv/b.csv"):
        s3.put_object(Bucket="changing", Key=key, Body=LOG + key.encode())
    assert len(fetch("s3://changing/b/", here).fetched) == 4
    assert fetch("s3://changing/b/", here).fetched == []
    s3.put_object(Bucket="changing", Key="b/r1.csv", Body=LOG + b"b/r5.csv")  # as long as before
    s3.put_object(Bucket="changing", Key="b/r4.csv", Body=LOG)
    s3.delete_object(Bucket="changing", Key="b/a.csv")
    done = fetch("s3://changing/b/", here)
    # Without a.csv the folder a.csv/ can be one here too.
    assert (sorted(done.fetched), sorted(done.removed)) == (
        ["a.csv/b.csv", "r1.csv", "r4.csv"],
        ["a.csv", "a.csv%2Fb.csv"],
    )
    assert (here / "r1.csv").read_bytes() == LOG + b"b/r5.csv"
    assert (here / "a.csv" / "b.csv").read_bytes() == LOG + b"b/a.csv/b.csv"


@pytest.mark.thorough
def test_more_logs_than_one_page_of_a_listing_holds_come(s3: Any, here: Path) -> None:
    for number in range(1005):
        s3.put_object(Bucket="lab-logs", Key=f"many/r{number:04}.csv", Body=LOG)
    source = Source("s3://lab-logs/many", here)
    assert len(source.logs()) == 1005


def test_one_log_of_a_bucket_a_pattern_and_an_archive_in_it_are_places_too(s3: Any, here: Path, tmp_path: Path) -> None:
    import zipfile

    assert fetch("s3://lab-logs/sample-b/r1.csv", here).fetched == ["r1.csv"]
    assert fetch("s3://lab-logs/sample-b/*/r*.csv", here).fetched == ["monday/r2.csv"]
    with zipfile.ZipFile(tmp_path / "m.zip", "w") as file:
        file.writestr("deep/r5.csv", LOG)
    s3.upload_file(str(tmp_path / "m.zip"), "lab-logs", "m.zip")
    assert fetch("zip::s3://lab-logs/m.zip", here).fetched == ["deep/r5.csv"]
    assert names(here) == ["deep/r5.csv"]


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("s3://lab-logs/nothing", "there is nothing of this name"),
        ("s3://no-such-bucket/sample-b", "there is no such bucket"),
        ("s3://no-such-bucket", "there is no such bucket"),
        ("s3://", "cannot be read"),
        ("s3://key:not-to-be-shown@lab-logs/x", "s3://lab-logs/x: "),
    ],
)
def test_a_bucket_or_prefix_that_is_not_there_is_told(s3: Any, here: Path, url: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as told:
        fetch(url, here)
    assert "not-to-be-shown" not in str(told.value)


def test_missing_credentials_are_told_with_their_names(s3: Any, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    for name in ("AWS_SHARED_CREDENTIALS_FILE", "AWS_CONFIG_FILE"):
        monkeypatch.setenv(name, str(here / "none"))
    with pytest.raises(
        InputError, match=r"without credentials.*AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE"
    ):
        fetch("s3://lab-logs/sample-b", here)


def test_a_server_that_cannot_be_reached_is_told(s3: Any, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(InputError, match=r"cannot be reached.*AWS_ENDPOINT_URL"):
        fetch("s3://lab-logs/sample-b", here)


@contextmanager
def answering(answer: Callable[[http.server.BaseHTTPRequestHandler], None]) -> Iterator[str]:
    """Run a server that gives one answer to everything; yield its address."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            answer(self)

        def do_HEAD(self) -> None:
            answer(self)

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def coded(status: int, code: str) -> Callable[[http.server.BaseHTTPRequestHandler], None]:
    def answer(request: http.server.BaseHTTPRequestHandler) -> None:
        body = f"<?xml version='1.0'?><Error><Code>{code}</Code><Message>{code}</Message></Error>".encode()
        request.send_response(status)
        request.send_header("Content-Length", str(len(body)))
        request.end_headers()
        if request.command == "GET":
            request.wfile.write(body)

    return answer


@pytest.mark.parametrize(
    ("status", "code", "words"),
    [
        (403, "AccessDenied", "there is no permission to read it"),
        (503, "InternalError", "has an error of its own|cannot be read"),
    ],
)
def test_a_bucket_that_refuses_is_told(
    s3: Any, here: Path, monkeypatch: pytest.MonkeyPatch, status: int, code: str, words: str
) -> None:
    with answering(coded(status, code)) as address:
        monkeypatch.setenv("AWS_ENDPOINT_URL", address)
        with pytest.raises(InputError, match=words):
            fetch("s3://lab-logs/sample-b", here)


@pytest.mark.parametrize("url", ["s3://lab-logs/x", "http://{}/logs", "ftp://{}/logs"])
def test_a_server_that_says_nothing_is_given_up(s3: Any, here: Path, monkeypatch: pytest.MonkeyPatch, url: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        place = f"127.0.0.1:{server.getsockname()[1]}"
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{place}")
        monkeypatch.setattr(remote_source, "within", lambda function, _seconds=0.0: within(function, 0.5))
        with pytest.raises(InputError, match="does not answer in time"):
            fetch(url.format(place), here)


@pytest.fixture
def pages(tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """A web server of a folder with logs: its address, and the folder."""
    folder = tmp_path / "pages"
    (folder / "logs" / "mon day").mkdir(parents=True)
    for name in ("r 1.csv", "mon day/ü%41.csv", "runs.csv", "notes.md"):
        (folder / "logs" / name).write_bytes(LOG)

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

        def send_head(self) -> Any:
            given = self.headers.get("Authorization", "")
            if "closed" in self.path and given != f"Basic {base64.b64encode(b'lab:not-to-be-shown').decode()}":
                self.send_error(401)
                return None
            return super().send_head()

    handler = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}", folder
        server.shutdown()


def test_logs_that_a_web_page_links_to_are_mirrored(pages: tuple[str, Path], here: Path) -> None:
    pytest.importorskip("aiohttp", reason="reading the web takes aiohttp")
    address, folder = pages
    assert sorted(fetch(f"{address}/logs", here).fetched) == ["mon day/ü%41.csv", "r 1.csv", "runs.csv"]
    assert fetch(f"{address}/logs", here).fetched == []
    (folder / "logs" / "r 1.csv").write_bytes(LOG + LOG)
    (folder / "logs" / "mon day" / "ü%41.csv").unlink()
    done = fetch(f"{address}/logs", here)
    assert (done.fetched, done.removed) == (["r 1.csv"], ["mon day/ü%41.csv"])
    assert fetch(f"{address}/logs/r%201.csv", here).fetched == ["r 1.csv"]


def test_a_page_without_logs_or_that_is_not_there_is_told(pages: tuple[str, Path], here: Path) -> None:
    pytest.importorskip("aiohttp", reason="reading the web takes aiohttp")
    address, folder = pages
    (folder / "empty").mkdir()
    with pytest.raises(InputError, match="a page that links to logs as a directory listing does"):
        fetch(f"{address}/empty", here)
    with pytest.raises(InputError, match="there is nothing of this name"):
        fetch(f"{address}/nowhere.csv", here)


def test_a_password_in_the_address_is_used_and_shown_nowhere(pages: tuple[str, Path], here: Path) -> None:
    pytest.importorskip("aiohttp", reason="reading the web takes aiohttp")
    address, folder = pages
    (folder / "closed").mkdir()
    (folder / "closed" / "r1.csv").write_bytes(LOG)
    with pytest.raises(InputError, match=r"credentials are refused.*FSSPEC_HTTP_HEADERS"):
        fetch(f"{address}/closed", here)
    with pytest.raises(InputError, match="credentials are refused") as told:
        fetch(f"{address}/closed".replace("//", "//lab:wrong-one@"), here)
    assert "wrong-one" not in str(told.value)
    assert fetch(f"{address}/closed".replace("//", "//lab:not-to-be-shown@"), here).fetched == ["r1.csv"]
    assert "not-to-be-shown" not in (here.parent / ".fetched.json").read_text()


def test_a_transfer_that_breaks_off_leaves_nothing_half(here: Path) -> None:
    pytest.importorskip("aiohttp", reason="reading the web takes aiohttp")

    def half(request: http.server.BaseHTTPRequestHandler) -> None:
        request.send_response(200)
        request.send_header("Content-Length", "1000")
        request.send_header("Content-Type", "text/csv")
        request.end_headers()
        if request.command == "GET":
            request.wfile.write(LOG)

    with answering(half) as address, pytest.raises(InputError, match=r"'r1.csv'"):
        fetch(f"{address}/r1.csv", here)
    assert not here.exists()


def test_what_a_server_tells_no_mark_of_is_fetched_each_time_but_replaced_only_where_it_differs(here: Path) -> None:
    pytest.importorskip("aiohttp", reason="reading the web takes aiohttp")

    def plain(request: http.server.BaseHTTPRequestHandler) -> None:
        request.send_response(200)
        request.send_header("Content-Length", str(len(LOG)))
        request.send_header("Content-Type", "text/csv")
        request.end_headers()
        if request.command == "GET":
            request.wfile.write(LOG)

    with answering(plain) as address:
        fetch(f"{address}/r1.csv", here)
        before = (here / "r1.csv").stat().st_mtime_ns
        done = fetch(f"{address}/r1.csv", here)
    assert (done.fetched, done.unmarked) == (["r1.csv"], ["r1.csv"])
    assert (here / "r1.csv").stat().st_mtime_ns == before
