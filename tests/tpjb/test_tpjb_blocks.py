"""Blocks of a stream: lines come back exactly, whatever the pieces, gaps and stamps; memory is the block's."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Recording, Stream, storage
from pipeline.rigs.tpjb.dynamic import tones
from pipeline.rigs.tpjb.dynamic.blocks import Lines, common_divisor, fit_blocks
from pipeline.rigs.tpjb.dynamic.shaft import ShaftPhase, followed

TONES = np.array([7.0, 11.0, 13.0, 19.0, 23.0, 29.0, 37.0, 43.0])
SHAFT = 1000 / 60


def wandering(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed (rad/s) that swings by 0.05 % over 9 s, and the exact turns."""
    swing = 2 * np.pi / 9
    speed = 2 * np.pi * SHAFT * (1 + 5e-4 * np.sin(swing * time))
    return speed, SHAFT * (time - 5e-4 / swing * np.cos(swing * time))


def record(time: np.ndarray, seed: int = 0) -> tuple[Stream, np.ndarray]:
    """Two channels of tones, drift and shaft orders; the amplitudes, shape (8, 2)."""
    rng = np.random.default_rng(seed)
    P = rng.normal(size=(8, 2)) + 1j * rng.normal(size=(8, 2))
    speed, turns = wandering(time)
    channels = {"speed": Channel("speed", speed, "rad/s")}
    for c in range(2):
        y = 40.0 + 0.3 * time + (P[:, c] @ np.exp(2j * np.pi * TONES[:, None] * time)).real
        for order in range(1, 5):
            y += 3 / order**1.5 * np.cos(2 * np.pi * order * turns + order)
        channels[f"y{c}"] = Channel(f"y{c}", y, "m")
    return Stream("hf", time, channels), P


@pytest.mark.parametrize("kept", ["all rows", "0.1 % of the rows lost", "a gap of half a second"])
def test_tones_come_back_beside_a_shaft_that_wanders(kept: str) -> None:
    time = np.arange(30_000) / 1000.0
    if kept == "0.1 % of the rows lost":
        time = time[np.random.default_rng(3).random(time.size) > 1e-3]
    if kept == "a gap of half a second":
        time = time[(time < 4.2) | (time > 4.7)]
    stream, P = record(time)
    fits = fit_blocks(stream, ["y0", "y1"], Lines(TONES, ShaftPhase.of(stream)), 0.0, 3.0, 10)
    # What is left is the angle's own error: trapezia over a lost row of a speed that changes by 0.05 %.
    np.testing.assert_allclose(fits.tones, np.broadcast_to(P, (10, 8, 2)), atol=2e-4)
    assert fits.residual.max() < 2e-3


def test_a_fixed_shaft_frequency_leaks_where_the_speed_wanders() -> None:
    stream, P = record(np.arange(30_000) / 1000.0)
    followed_ = fit_blocks(stream, ["y0"], Lines(TONES, ShaftPhase.of(stream)), 0.0, 3.0, 10)
    fixed = fit_blocks(stream, ["y0"], Lines(TONES, ShaftPhase.steady(SHAFT)), 0.0, 3.0, 10)
    assert np.abs(fixed.tones[..., 0] - P[:, 0]).max() > 20 * np.abs(followed_.tones[..., 0] - P[:, 0]).max()


def test_the_shaft_is_followed_by_its_own_line_where_no_speed_is_logged() -> None:
    stream, _ = record(np.arange(30_000) / 1000.0)
    phase = ShaftPhase.steady(SHAFT * 1.002)
    for _ in range(3):
        fits = fit_blocks(stream, ["y0"], Lines(TONES, phase), 0.0, 1.0, 30)
        phase = followed(fits.start, 1.0, fits.shaft[:, 0], phase)
    measured = ShaftPhase.of(stream)
    assert measured is not None
    at = np.arange(1.0, 29.0)
    apart = phase.turns(at) - measured.turns(at)
    assert np.ptp(apart) < 2e-3


def test_pieces_of_a_file_give_what_the_whole_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "ROW_GROUP", 1777)
    stream, _ = record(np.arange(12_000) / 1000.0)
    lazy = storage.read(storage.write(Recording("r", {"hf": stream}), tmp_path), lazily=True).streams["hf"]
    lines = Lines(TONES, ShaftPhase.of(stream), others=np.array([18.0, 30.0]))
    one, other = (fit_blocks(s, ["y0", "y1"], lines, 0.0, 3.0, 4) for s in (stream, lazy))
    for name in ("tones", "shaft", "mean", "residual"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-9)


def test_memory_is_bounded_by_the_block_and_not_by_the_log() -> None:
    class Endless(Stream):
        """A stream of `pieces` pieces that are made when they are asked for."""

        def __init__(self, pieces: int) -> None:
            object.__setattr__(self, "pieces", pieces)

        size = property(lambda self: self.pieces * 20_000)
        span = property(lambda self: (0.0, (self.size - 1) / 1000.0))
        duration = property(lambda self: self.span[1])

        def blocks(self, names):
            for piece in range(self.pieces):
                time = (piece * 20_000 + np.arange(20_000)) / 1000.0
                yield time, [np.sin(2 * np.pi * 7 * time) + i for i, _ in enumerate(names)]

    def peak(pieces: int) -> int:
        stream = Endless(pieces)
        tracemalloc.start()
        fits = fit_blocks(stream, list("abcdefghijklm"), Lines(TONES), 0.0, 1.0, 20 * pieces)
        top = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert np.abs(fits.tones[:, 0] + 1j).max() < 1e-9
        return top

    # Eight times the log: what grows are the 208 amplitudes of each block, 40 kB a second of log.
    assert peak(40) - peak(5) < 35 * 20 * 40_000 / 5


def test_other_lines_are_seen_in_what_the_fit_leaves() -> None:
    rate = 5000.0  # thinned by groups of samples
    time = np.arange(int(6 * rate)) / rate
    y = np.cos(2 * np.pi * 7 * time) + 0.01 * np.cos(2 * np.pi * 18 * time + 0.4)
    stream = Stream("hf", time, {"y": Channel("y", y, "m")})
    fits = fit_blocks(stream, ["y"], Lines(TONES, others=np.array([16.0, 18.0])), 0.0, 2.0, 3)
    np.testing.assert_allclose(fits.others[:, 1, 0], 0.01 * np.exp(0.4j), atol=1e-4)
    assert np.abs(fits.others[:, 0, 0]).max() < 1e-4


def test_rows_without_a_number_do_not_count_and_an_empty_block_is_nan() -> None:
    time = np.arange(9000) / 1000.0
    y = np.cos(2 * np.pi * 7 * time)
    y[100:200] = np.nan
    y[3000:6000] = np.nan
    stream = Stream("hf", time, {"y": Channel("y", y, "m")})
    fits = fit_blocks(stream, ["y"], Lines(TONES), 0.0, 3.0, 3)
    assert fits.count.tolist() == [2900, 0, 3000]
    assert fits.invalid.tolist() == [3100]
    assert np.isnan(fits.tones[1]).all()
    np.testing.assert_allclose(fits.tones[[0, 2], 0, 0], 1.0, atol=1e-12)


def test_blocks_are_whole_cycles_of_tones_and_shaft() -> None:
    block = tones.block_length(TONES, SHAFT, 4, 30.0)
    assert (block.length, block.blocks, block.whole, block.shaft_whole) == (3.0, 10, True, True)
    short = tones.block_length(TONES, SHAFT, 4, 12.0)  # four blocks of 3 s would be too few
    assert (short.length, short.blocks) == (1.0, 12)
    assert tones.block_length(np.array([7.0, 9.5, 12.0]), None, 4, 30.0).length == 2.0


def test_blocks_without_a_common_cycle_still_part_the_tones() -> None:
    odd = np.array([7.031, 11.177, 15.23])
    assert common_divisor(odd) == 0.001
    block = tones.block_length(odd, SHAFT, 4, 30.0)
    assert not block.whole
    assert block.blocks >= 8
    assert block.length * (SHAFT - 15.23) >= 2


def test_tones_on_shaft_orders_are_told() -> None:
    on = tones.on_shaft_orders(np.array([13.0, 17.0, 33.0, 40.0]), SHAFT, 4, 3.0)
    assert on.tolist() == [False, True, True, False]


def test_second_order_products_of_odd_tones_are_even() -> None:
    products = tones.second_order_products(TONES, SHAFT, 4, 3.0)
    assert products.size > 20
    np.testing.assert_allclose(products % 2, 0.0, atol=1e-9)


@pytest.mark.parametrize("switch", [np.inf, 31.3])
@pytest.mark.parametrize("wanted", [TONES, np.array([7.5, 11.2, 33.1]), np.array([12.34, 20.02])])
def test_tones_are_found_in_the_forces_even_across_a_change_of_excitation(wanted: np.ndarray, switch: float) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(60_000) / 1000.0
    u = sum(400 * np.cos(2 * np.pi * f * time + rng.uniform(0, 6)) for f in wanted)
    v = np.where(time < switch, 1.0, -1.0) * u + 5 * rng.standard_normal(time.size)
    stream = Stream("hf", time, {"u": Channel("u", u, "N"), "v": Channel("v", v, "N")})
    found = tones.tones_in(stream, ["u", "v"])
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_a_log_too_short_for_its_blocks_says_how_long_it_must_be() -> None:
    from pipeline.rigs.tpjb.dynamic.sorting import read_record
    from pipeline.rigs.tpjb.dynamic.synthetic import synthesize

    short = synthesize({"bearings": ["4pad-L1"], "duration": 3.0}, 1)[0]
    with pytest.raises(InputError, match=r"a2_in_phase.*at least 4"):
        read_record(short, ["gap_up1"], 4)
