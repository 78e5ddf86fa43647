"""Definitions of ROS 2 messages: from the bag, else from ``.msg`` files beside it, else those that ROS 2 brings along.

Bags of ROS 2 before Iron (2023) hold none. ROS 2's own types then come from the library rosbags; a laboratory's own types
must be given as the files that its packages define them in.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from pipeline.ingest.extras import library
from pipeline.ingest.mcap_log.encodings.ros_types import COMMON

_SEPARATOR = "=" * 80
# The last distribution whose bags lack definitions; those of measured quantities were the same in all before.
_DISTRIBUTION = "humble"
_BUILT_IN = {*COMMON, "byte", "string", "wstring"}
_TYPE = re.compile(r"^\s*([\w/]+)(?:<=\d+)?(?:\[(?:<=)?\d*\])?\s+\w+")

Definition = tuple[str, bytes]


class Definitions:
    """Looks up what types of a bag mean; `sources` tells where that was found."""

    def __init__(self, path: Path, embedded: Mapping[str, Definition]) -> None:
        self.path = path
        self.embedded = embedded
        self.sources: set[str] = set()

    def of(self, kind: str) -> Definition | str:
        """Return language and text of a type ``pkg/msg/Name``, or a sentence that says why there are none.

        Raises
        ------
        InputError
            If the library that knows ROS 2's own types is needed and not installed.
        """
        if kind in self.embedded:
            self.sources.add("in the file")
            return self.embedded[kind]
        bodies: dict[str, str] = {}
        missing = self._collect(kind, bodies)
        if missing is not None:
            part = "" if missing == kind else f", part of '{kind}',"
            package, name = missing.split("/")[0], missing.split("/")[-1]
            return (
                f"its message type '{missing}'{part} is not defined in the file, as bags of ROS 2 before Iron are, nor is it one "
                f"of ROS 2's own; put its definition beside the log as {package}/msg/{name}.msg, or write the bag anew as MCAP "
                "where the type is installed ('ros2 bag convert', or record with '-s mcap')"
            )
        parts = [bodies.pop(kind), *(f"{_SEPARATOR}\nMSG: {other}\n{body}" for other, body in bodies.items())]
        return "ros2msg", "\n".join(parts).encode()

    def _collect(self, kind: str, bodies: dict[str, str]) -> str | None:
        """Gather a type and all that it is made of; return the first that is not found."""
        if kind in bodies:
            return None
        body = self._beside(kind)
        if body is None:
            library(
                "rosbags.typesys", "ros", self.path, "a ROS 2 bag that does not hold the definitions of its messages"
            )
            body = _of_ros().get(kind)
            if body is None:
                return kind
            self.sources.add(f"of ROS 2 {_DISTRIBUTION.capitalize()}")
        bodies[kind] = body
        for line in body.splitlines():
            match = _TYPE.match(line.split("#")[0])
            if not match or match[1] in _BUILT_IN:
                continue
            missing = self._collect(_full(match[1], kind), bodies)
            if missing is not None:
                return missing
        return None

    def _beside(self, kind: str) -> str | None:
        """Return the text of a ``.msg`` file in the log's folder or the one above, as its package has it or alone."""
        package, name = kind.split("/")[0], kind.split("/")[-1]
        for folder in (self.path.parent, self.path.parent.parent):
            for place in (f"{package}/msg/{name}.msg", f"{package}/{name}.msg", f"{name}.msg"):
                if (folder / place).is_file():
                    self.sources.add(f"in {place}")
                    return (folder / place).read_text("utf-8", "replace")
        return None


def definitions_beside(path: Path) -> list[Path]:
    """Return the ``.msg`` files that may define messages of the bag at `path`."""
    places = ("*.msg", "*/*.msg", "*/msg/*.msg")
    folders = (path.parent, path.parent.parent)
    return sorted({file for folder in folders for place in places for file in folder.glob(place)})


def _full(kind: str, inside: str) -> str:
    """Return a type as bags call it, ``pkg/msg/Name``; without a package it is that of the type it stands in."""
    if kind == "Header":
        return "std_msgs/msg/Header"
    package, name = (kind.split("/")[0], kind.split("/")[-1]) if "/" in kind else (inside.split("/")[0], kind)
    return f"{package}/msg/{name}"


@cache
def _of_ros() -> Mapping[str, str]:
    """Return the definitions of ROS 2's own types, each without those of its parts."""
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores(f"ros2_{_DISTRIBUTION}"))
    return {kind: types.generate_msgdef(kind, ros_version=2)[0].split(_SEPARATOR)[0] for kind in types.fielddefs}
