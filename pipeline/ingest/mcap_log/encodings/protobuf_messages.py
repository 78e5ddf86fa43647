"""Messages in Protobuf: parsed by Google's library, handed on as nested dicts.

The description of the messages comes with the log (a FileDescriptorSet).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from pipeline.ingest.mcap_log.columns import MOST_FIELDS, Columns, Path, TooManyFieldsError, columns_of
from pipeline.ingest.mcap_log.encodings.ros_types import DefinitionError
from pipeline.ingest.mcap_log.records import Schema

_BYTES = 12  # google.protobuf.descriptor.FieldDescriptor.TYPE_BYTES
_VALUE, _OPTIONAL, _LIST, _MAP = range(4)
# The members of a message type: name, kind, and the type of a member that is a message itself.
_Type = list[tuple[str, int, "_Type | None"]]


class ProtobufDecoder:
    """Decodes the messages of one type; `raw` names the fields of raw bytes that were left out.

    Raises
    ------
    DefinitionError
        If the schema holds no such message type.
    """

    def __init__(self, schema: Schema) -> None:
        from mcap.exceptions import McapError
        from mcap.records import Schema as McapSchema
        from mcap_protobuf.decoder import DecoderFactory

        self.raw: set[Path] = set()
        self._types: dict[str, _Type] = {}
        try:
            record = McapSchema(id=schema.id, data=schema.data, encoding="protobuf", name=schema.name)
            parse = DecoderFactory().decoder_for("protobuf", record)
        except (McapError, TypeError, KeyError, ValueError) as error:
            raise DefinitionError(f"its Protobuf description is damaged ({_one_line(error)})") from error
        except Exception as error:  # google's DecodeError derives from Exception only
            if type(error).__name__ != "DecodeError":
                raise
            raise DefinitionError(f"its Protobuf description is damaged ({_one_line(error)})") from error
        if parse is None:
            raise DefinitionError("its Protobuf description is missing")
        self._parse: Callable[[bytes], Any] = parse

    def decode(
        self, payloads: Sequence[bytes], wanted: Collection[Path] | None = None
    ) -> tuple[Columns, np.ndarray | None]:
        """Return the columns of the messages and, where some are malformed, which ones are not (m,)."""
        objects, good = [], np.ones(len(payloads), dtype=bool)
        for i, payload in enumerate(payloads):
            try:
                message = self._parse(payload)
            except Exception as error:  # google's DecodeError derives from Exception only
                if type(error).__name__ != "DecodeError":
                    raise
                good[i] = False
            else:
                objects.append(_members(message, self._type_of(message.DESCRIPTOR, ())))
        return columns_of(objects, wanted), None if good.all() else good

    def _type_of(self, descriptor: Any, path: Path) -> _Type:
        """Return how messages of a type are read; asking descriptors for each message would be slow."""
        known = self._types.get(descriptor.full_name)
        if known is not None:
            return known
        members: _Type = []
        self._types[descriptor.full_name] = members  # first, since a type may hold itself
        for field in descriptor.fields:
            here = (*path, field.name)
            if field.type == _BYTES:
                self.raw.add(here)
                continue
            kind, of = _VALUE, field.message_type
            if _is_repeated(field):
                kind = _LIST
                if of is not None and of.GetOptions().map_entry:
                    if "value" not in of.fields_by_name:
                        continue  # a damaged description
                    kind, of = _MAP, of.fields_by_name["value"].message_type
            elif field.has_presence:
                kind = _OPTIONAL
            members.append((field.name, kind, None if of is None else self._type_of(of, here)))
            if len(members) > MOST_FIELDS:
                raise TooManyFieldsError
        return members


def _members(message: Any, of: _Type) -> dict[str, Any]:
    """Return a message as a dict; a field that is not set and can tell so is None."""
    found: dict[str, Any] = {}
    for name, kind, inner in of:
        if kind == _OPTIONAL and not message.HasField(name):
            found[name] = None
            continue
        value = getattr(message, name)
        if kind == _LIST:
            value = list(value) if inner is None else [_members(one, inner) for one in value]
        elif kind == _MAP:
            value = {str(key): one if inner is None else _members(one, inner) for key, one in value.items()}
        elif inner is not None:
            value = _members(value, inner)
        found[name] = value
    return found


def _is_repeated(field: Any) -> bool:
    repeated = getattr(field, "is_repeated", None)
    return bool(field.label == field.LABEL_REPEATED if repeated is None else repeated)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
