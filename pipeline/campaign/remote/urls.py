"""URLs as people write and read them: what is one, which protocols it names, how it is shown without its secrets.

Nothing is opened here, so this costs no import.
"""

from __future__ import annotations

import re

# Protocols in whose URLs an '@' parts something else than a user from a host.
_NO_USER = {"abfs", "abfss", "adl", "az", "git", "github"}
_BEGIN = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*(://|::)")


def is_url(word: str) -> bool:
    """Tell a URL (``s3://bucket/logs``, ``zip::file.zip``) from a path."""
    return _BEGIN.match(word) is not None


def protocols(url: str) -> list[str]:
    """Return the protocol of each link of a chained URL, ``file`` for a path: ``zip::s3://b/x.zip`` -> zip, s3.

    >>> protocols("zip://r1.csv::s3://lab-logs/monday.zip"), protocols("simplecache::/mnt/share")
    (['zip', 's3'], ['simplecache', 'file'])
    """
    links = url.split("::")
    found = []
    for at, link in enumerate(links):
        name, mark, _ = link.partition("://")
        bare = at < len(links) - 1 and re.fullmatch(r"[a-z][a-z0-9]*", link)
        found.append(name if mark else link if bare else "file")
    return found


def shown(url: str) -> str:
    """Return a URL without user, password and the query of a signed web address.

    >>> shown("sftp://lab:secret@host/logs"), shown("https://host/r1.csv?X-Amz-Signature=0f")
    ('sftp://host/logs', 'https://host/r1.csv')
    """
    return "::".join(_without_secrets(link) for link in url.split("::"))


def secrets(url: str) -> list[str]:
    """Return the parts of a URL that `shown` leaves out."""
    return [part for link in url.split("::") for part in (_user(link), _query(link)) if part]


def _without_secrets(link: str) -> str:
    protocol, mark, rest = link.partition("://")
    rest = rest[len(_user(link)) :]
    return f"{protocol}{mark}{rest[: len(rest) - len(_query(link))]}"


def _user(link: str) -> str:
    """Return ``user:password@`` of one link."""
    protocol, _, rest = link.partition("://")
    host, _, path = rest.partition("/")
    if protocol in _NO_USER:
        return ""
    if "@" in host:
        return host[: host.rindex("@") + 1]
    # A password with a '/' in it: what follows the ':' is no port.
    if "@" in path and re.search(r":(?!\d*$)", host):
        return rest[: rest.rindex("@") + 1]
    return ""


def _query(link: str) -> str:
    """Return ``?...`` of a web address, which may be a signature."""
    match = re.match(r"https?://[^?#]*", link)
    return link[match.end() :] if match else ""
