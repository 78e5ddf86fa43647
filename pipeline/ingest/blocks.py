"""Blocks of rows, channel name -> values (n,): joined and cut to sizes that are worth their handling."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.ingest.reader import BLOCK_ROWS

Block = dict[str, np.ndarray]


def rebatched(blocks: Iterator[Block], least: int = BLOCK_ROWS // 8, most: int = BLOCK_ROWS) -> Iterator[Block]:
    """Join blocks of fewer than `least` rows and split those of more than `most`; order and content stay."""
    waiting: list[Block] = []
    held = 0
    for block in blocks:
        held += rows_of(block)
        waiting.append(block)
        if held >= least:
            yield from _split(_joined(waiting), most)
            waiting, held = [], 0
    if held:
        yield from _split(_joined(waiting), most)


def rows_of(block: Block) -> int:
    """Return the number of rows of a block."""
    return next(iter(block.values())).size if block else 0


def _joined(blocks: list[Block]) -> Block:
    blocks = [block for block in blocks if rows_of(block)]
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _split(block: Block, most: int) -> Iterator[Block]:
    size = rows_of(block)
    if size <= most:
        yield block
        return
    for start in range(0, size, most):
        yield {name: values[start : start + most] for name, values in block.items()}
