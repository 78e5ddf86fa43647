"""What a file system or its library complains of, in plain words: what was found, what was expected, what to do.

Each library has errors of its own; they are told apart by class name, code and status, never by their place.
"""

from __future__ import annotations

import errno
import re
import socket
import ssl
from collections.abc import Iterator

from pipeline.campaign.remote.urls import protocols, secrets, shown
from pipeline.errors import InputError, listing, nearest

_NO_CREDENTIALS = {
    "NoCredentialsError",
    "PartialCredentialsError",
    "ProfileNotFound",
    "CredentialRetrievalError",
    "TokenRetrievalError",
    "SSOTokenLoadError",
    "UnauthorizedSSOTokenError",
    "DefaultCredentialsError",
}
_WRONG_CREDENTIALS = {"InvalidAccessKeyId", "SignatureDoesNotMatch", "ExpiredToken", "InvalidToken", "401", "530"}
_REFUSED = {"ClientAuthenticationError", "AuthenticationException", "BadAuthenticationType"}
_DENIED = {"AccessDenied", "AllAccessDisabled", "403"}
_NOTHING = "there is nothing of this name"
_S3 = {"s3", "s3a"}
_WEB = {"http", "https"}


def unknown_protocol(url: str, protocol: str, known: list[str]) -> InputError:
    """Return what to say of a URL that begins with a word that fsspec does not know."""
    common = [name for name in ("s3", "gs", "az", "sftp", "ftp", "smb", "https", "file", "memory") if name in known]
    return InputError(
        f"{shown(url)}: '{protocol}://' is no file system that is known here.{nearest(protocol, known)} Expected is "
        f"{listing(f'{name}://' for name in common)} or another of fsspec: {listing(sorted(set(known) - set(common)), 60)}."
    )


def no_path(url: str, found: str, expected: str) -> InputError:
    """Return what to say of what would be a URL with the right number of slashes."""
    return InputError(
        f"{shown(url)}: there is no such file or folder, and a URL begins with '{expected}' where this has '{found}'; write "
        "the one or the other."
    )


def missing_package(url: str, protocol: str, hint: str) -> InputError:
    """Return what to say where the library of a file system is not installed; `hint` is what fsspec says of it."""
    install = "Install it with: pip install 'rigfit[s3]'" if protocol in _S3 else f"fsspec says: {hint.rstrip('.')}."
    return InputError(f"{shown(url)}: reading '{protocol}://' takes a package that is not installed. {install}")


def nothing(url: str) -> InputError:
    """Return what to say of a place that is there, or cannot be told from one, and holds no log."""
    if set(protocols(url)) & _WEB:
        expected = "Expected is the address of a log, or of a page that links to logs as a directory listing does"
    else:
        expected = "Expected is at least one log (CSV, MCAP, MAT, TDMS, MDF, HDF5, Parquet) below it"
    return InputError(
        f"{shown(url)}: holds no logs (runs.csv, notes, pictures and hidden files do not count). {expected}; check the "
        "spelling of the URL, capitals too."
    )


def half(url: str, name: str, found: int, expected: int) -> InputError:
    """Return what to say of a log that came with another size than was announced."""
    return InputError(
        f"{shown(url)}: of '{name}' came {found} bytes, expected are {expected}. The transfer broke off, or the log is still "
        "being written; run the same command again when it is done."
    )


def said(error: Exception, url: str, name: str = "") -> InputError:
    """Return what to say of `error`, which came from the file system of `url`, or of one log there.

    Raises
    ------
    OSError
        `error` itself where it is not of the other side: the disk here is full.
    """
    if isinstance(error, InputError):
        return error
    chain = list(_chain(error))
    if any(isinstance(one, OSError) and one.errno in (errno.ENOSPC, errno.EDQUOT) for one in chain):
        raise error
    place = f"{shown(url)}: {f'{name!r}: ' if name else ''}"
    last = protocols(url)[-1]
    found, remedy = _found(chain, last)
    detail = "" if found == _NOTHING else _detail(error, chain, url)
    return InputError(f"{place}{found}{f' ({detail})' if detail else ''}. {remedy}".strip())


def _found(chain: list[BaseException], protocol: str) -> tuple[str, str]:
    """Return what is the matter, and what to do."""
    names = {cls.__name__ for one in chain for cls in type(one).__mro__}
    codes = {code for one in chain for code in _codes(one)}

    def is_a(*classes: type[BaseException]) -> bool:
        return any(isinstance(one, classes) for one in chain)

    if names & _NO_CREDENTIALS or any("No authentication methods available" in str(one) for one in chain):
        return "cannot be read without credentials, and none (or not all) were found", _give_credentials(protocol)
    if codes & _WRONG_CREDENTIALS or names & _REFUSED:
        return (
            "the credentials are refused",
            f"Check them, and whether they have expired. {_give_credentials(protocol)}",
        )
    if codes & _DENIED or is_a(PermissionError):
        return (
            "there is no permission to read it",
            f"Ask its owner for the right to list and read it, or give other credentials. {_give_credentials(protocol)}",
        )
    if is_a(ssl.SSLError) or any("Certificate" in name or name == "SSLError" for name in names):
        return (
            "the server's certificate is not trusted",
            "Check the host's name and this machine's date; a laboratory's own certificate authority is named by the "
            "variable SSL_CERT_FILE (for S3: AWS_CA_BUNDLE).",
        )
    if is_a(TimeoutError, socket.timeout) or any("Timeout" in name for name in names):
        return "does not answer in time", f"Check the network, and that the server is well. {_where(protocol)}"
    unreached = {
        *("EndpointConnectionError", "ClientConnectorError", "ServerDisconnectedError", "HTTPClientError"),
        "NoValidConnectionsError",
    }
    if is_a(ConnectionError, socket.gaierror) or names & unreached:
        return "cannot be reached", f"Check the host's name, the network and that the server runs. {_where(protocol)}"
    no_bucket = any("bucket does not exist" in str(one) for one in chain)
    if no_bucket or ("404" in codes and "HeadBucket" in {getattr(one, "operation_name", "") for one in chain}):
        return (
            "there is no such bucket",
            "Check its name, and that the credentials are of the account (and server) that has it.",
        )
    if is_a(FileNotFoundError, NotADirectoryError) or codes & {"404", "550", "NoSuchKey"}:
        return _NOTHING, "Check the spelling of the URL, capitals too."
    if any(code.startswith("5") and len(code) == 3 for code in codes):
        return "the server has an error of its own", "Try again later, or ask who runs it."
    return (
        "cannot be read",
        "Check the URL; options of its file system are given by variables such as "
        f"FSSPEC_{protocol.upper()}_<OPTION>, as fsspec's documentation says.",
    )


def _give_credentials(protocol: str) -> str:
    if protocol in _S3:
        return (
            "They are taken from the environment: AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE; another server "
            "than Amazon's is named by AWS_ENDPOINT_URL, and a bucket open to all is read with FSSPEC_S3_ANON=true."
        )
    if protocol in _WEB:
        return 'They are taken from the environment: FSSPEC_HTTP_HEADERS=\'{"Authorization": "..."}\'.'
    if protocol == "file":
        return "The rights of files and folders decide."
    name = protocol.upper()
    return f"They are taken from the environment: FSSPEC_{name}_<OPTION>, such as FSSPEC_{name}_USERNAME."


def _where(protocol: str) -> str:
    return "Another server than Amazon's is named by the variable AWS_ENDPOINT_URL." if protocol in _S3 else ""


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and those that caused it."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__


def _codes(error: BaseException) -> Iterator[str]:
    """Yield the codes that an error bears: of S3, of HTTP, of FTP."""
    response = getattr(error, "response", None)
    if isinstance(response, dict):
        yield str(response.get("Error", {}).get("Code", ""))
        yield str(response.get("ResponseMetadata", {}).get("HTTPStatusCode", ""))
    if type(error).__name__ == "error_perm":
        yield str(error)[:3]
    for attribute in ("status", "status_code"):
        if isinstance(code := getattr(error, attribute, None), int):
            yield str(code)


def _detail(error: BaseException, chain: list[BaseException], url: str) -> str:
    """Return what the library said, in one short line; nothing where it may hold what the URL keeps secret."""
    if secrets(url):
        return type(error).__name__
    text = next((" ".join(str(one).split()) for one in chain if str(one).strip()), type(error).__name__)
    text = re.sub(r"(https?://[^\s?'\"]+)\?[^\s'\"]*", r"\1", re.sub(r"(\w://)[^\s/@]+@", r"\1", text)).rstrip(". ")
    return "" if text == shown(url) else text if len(text) <= 200 else f"{text[:200]}..."
