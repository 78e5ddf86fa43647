"""Messages in Protobuf: parsed by Google's library, handed on as nested dicts.

The description of the messages comes with the log (a FileDescriptorSet).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from pipeline.ingest.mcap_log.columns import Columns, Path, columns_of
from pipeline.ingest.mcap_log.encodings.ros_types import DefinitionError
from pipeline.ingest.mcap_log.records import Schema

_BYTES, _MESSAGE = 12, 10  # google.protobuf.descriptor.FieldDescriptor.TYPE_BYTES, CPPTYPE_MESSAGE


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
                objects.append(self._members(message, ()))
        return columns_of(objects, wanted), None if good.all() else good

    def _members(self, message: Any, path: Path) -> dict[str, Any]:
        """Return a message as a dict; a field that is not set and can tell so is None."""
        found: dict[str, Any] = {}
        for descriptor in message.DESCRIPTOR.fields:
            name = descriptor.name
            if descriptor.type == _BYTES:
                self.raw.add((*path, name))
            elif _is_map(descriptor):
                entries = getattr(message, name)
                plain = descriptor.message_type.fields_by_name["value"].cpp_type != _MESSAGE
                found[name] = {
                    str(key): value if plain else self._members(value, (*path, name)) for key, value in entries.items()
                }
            elif _is_repeated(descriptor):
                values = getattr(message, name)
                is_message = descriptor.cpp_type == _MESSAGE
                found[name] = [self._members(v, (*path, name)) for v in values] if is_message else list(values)
            elif descriptor.has_presence and not message.HasField(name):
                found[name] = None
            elif descriptor.cpp_type == _MESSAGE:
                found[name] = self._members(getattr(message, name), (*path, name))
            else:
                found[name] = getattr(message, name)
        return found


def _is_repeated(descriptor: Any) -> bool:
    repeated = getattr(descriptor, "is_repeated", None)
    return bool(descriptor.label == descriptor.LABEL_REPEATED if repeated is None else repeated)


def _is_map(descriptor: Any) -> bool:
    kind = descriptor.message_type
    return bool(kind is not None and kind.GetOptions().map_entry and _is_repeated(descriptor))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
