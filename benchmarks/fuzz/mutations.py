"""How an input is spoilt: bytes flipped, cut, repeated, swapped with those of another, numbers made huge, JSON trees twisted."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from typing import Any

_LARGEST = 1 << 18
_NUMBERS = (
    0,
    1,
    7,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    (1 << 63) - 1,
    1 << 63,
    (1 << 64) - 1,
)
_VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1e308, -0.0, 10**400, "", "x", "../../x", "/etc/x", "C:\\x", "a\nb", "\x1b[31m", "\u202e", "\ud800", "x" * 3000,
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "]]>", "{{7*7}}", "$\\frac{", "\\", "=cmd", [], {}, [[]],
    float("nan"), float("inf"),
)  # fmt: skip


def mutated(data: bytes, others: Sequence[bytes], words: Sequence[bytes], as_json: bool, rng: random.Random) -> bytes:
    """Return `data` spoilt in one to eight places."""
    if as_json and rng.random() < 0.7 and (twisted := _twisted(data, rng)) is not None:
        return twisted
    spoilt = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        _spoil(spoilt, others, words, rng)
    return bytes(spoilt[:_LARGEST])


def _spoil(data: bytearray, others: Sequence[bytes], words: Sequence[bytes], rng: random.Random) -> None:
    at = rng.randrange(len(data) + 1)
    kind = rng.randrange(10)
    if kind == 0 and data:
        data[at % len(data)] ^= 1 << rng.randrange(8)
    elif kind == 1 and data:
        data[at % len(data)] = rng.randrange(256)
    elif kind == 2:
        size, order = rng.choice((1, 2, 4, 8)), rng.choice(("little", "big"))
        number = rng.choice(_NUMBERS) & ((1 << 8 * size) - 1)
        data[at : at + size] = number.to_bytes(size, order)
    elif kind == 3:
        del data[at : at + rng.choice((1, 2, 4, 8, 30, 300, 3000))]
    elif kind == 4 and words:
        data[at:at] = rng.choice(words)
    elif kind == 5 and words:
        word = rng.choice(words)
        data[at : at + len(word)] = word
    elif kind == 6:
        end = at + rng.choice((1, 8, 40, 400))
        data[at:at] = data[at:end] * rng.choice((1, 2, 50))
    elif kind == 7 and others:
        other = rng.choice(others)
        begin = rng.randrange(len(other) + 1)
        data[at : at + rng.choice((4, 40, 400))] = other[begin : begin + rng.choice((4, 40, 400))]
    elif kind == 8 and rng.random() < 0.3:
        del data[at:]
    elif len(data) > 8:  # a number in the text or in the bytes becomes a little larger or smaller
        data[at % len(data)] = (data[at % len(data)] + rng.choice((-1, 1))) % 256


def _twisted(data: bytes, rng: random.Random) -> bytes | None:
    """Return a JSON text with some values replaced, taken out, doubled or nested; None where it is no JSON."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return None
    for _ in range(rng.choice((1, 1, 2, 4))):
        tree = _with_a_twist(tree, rng)
    try:
        return json.dumps(tree).encode()
    except (ValueError, RecursionError):
        return None


def _with_a_twist(tree: Any, rng: random.Random) -> Any:
    node, parents = tree, []
    while isinstance(node, dict | list) and node and (not parents or rng.random() < 0.8):
        key = rng.choice(list(node)) if isinstance(node, dict) else rng.randrange(len(node))
        parents.append((node, key))
        node = node[key]
    if not parents:
        return rng.choice(_VALUES)
    holder, key = parents[-1]
    kind = rng.randrange(5)
    if kind == 0:
        del holder[key]
    elif kind == 1 and isinstance(holder, dict):
        holder[str(rng.choice(_VALUES))] = holder.pop(key)
    elif kind == 2 and isinstance(holder, list):
        holder.insert(key, node)
    elif kind == 3:
        for _ in range(rng.choice((1, 3, 60))):
            node = [node] if rng.random() < 0.5 else {"x": node}
        holder[key] = node
    else:
        holder[key] = rng.choice(_VALUES)
    return tree
