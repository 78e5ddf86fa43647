"""The compiled pass and the careful one agree to the bit, whatever stands in the rows."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.ingest.delimited import quick, rows
from pipeline.ingest.delimited.chunks import Chunk
from pipeline.ingest.delimited.decimals import LARGEST_POWER, nearest
from pipeline.ingest.delimited.layout import Layout, survey
from pipeline.ingest.delimited.rows import Parsed

CELLS = (
    "0", "-0.0", "1.5", "+2.25e-3", "1E5", ".5", "5.", "12345678901234567890", "0.000000000000000000001", "1e400", "1e-400",
    "4.9406564584124654e-324", "1.7976931348623157e308", "9007199254740993", "123456.7890123456789", "1D3", "", " ", "nan",
    "NaN", "-nan", "NA", "inf", "-Infinity", "1.#QNAN", "abc", "1,5", '"2.5"', '" 2.5 "', '""', '"a""b"', '"x', 'y"z', "-", "+",
    "e5", ".", "1e", "1.5.2", "12:00", "−1", "1_0", "٣", "\u00a07\u00a0", "\t8", "0x10", "1f", "1e54268256817", "run", "#", "nano",
)  # fmt: skip
DELIMITERS = (",", ";", "\t", " ")


def layout_of(folder: Path, delimiter: str, decimal: str) -> Layout:
    path = folder / f"{ord(delimiter)}{ord(decimal)}.csv"
    row = delimiter.join(("0.5", "run", "1.25", "-3")).replace(".", decimal) + "\n"
    path.write_text(delimiter.join(("t", "state", "F", "x")) + "\n" + row * 20)
    layout = survey(path).layout
    assert (layout.dialect.delimiter, layout.notation.decimal, layout.width) == (delimiter, decimal, 4)
    return layout


@pytest.fixture(scope="module")
def layouts(tmp_path_factory: pytest.TempPathFactory) -> list[Layout]:
    folder = tmp_path_factory.mktemp("layouts")
    return [layout_of(folder, d, p) for d in DELIMITERS for p in ".," if d != "," or p == "."]


def assert_equal(one: Parsed, other: Parsed) -> None:
    assert one.rows == other.rows
    assert one.texts == other.texts
    assert one.oddities == other.oddities
    for place, numbers in one.numbers.items():
        np.testing.assert_array_equal(numbers.view(np.int64), other.numbers[place].view(np.int64))


def canonical(parsed: Parsed) -> Parsed:
    """Give all missing numbers the same bits."""
    for place, numbers in parsed.numbers.items():
        parsed.numbers[place] = np.where(np.isnan(numbers), np.nan, numbers)
    return parsed


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_where_the_compiled_pass_reads_it_reads_what_the_careful_one_reads(layouts: list[Layout], data) -> None:
    layout = data.draw(st.sampled_from(layouts))
    delimiter = layout.dialect.delimiter
    table = data.draw(st.lists(st.lists(st.sampled_from(CELLS), min_size=4, max_size=4), min_size=1, max_size=6))
    lines = [delimiter.join(("1", *cells[1:])) for cells in table]
    for line in data.draw(
        st.lists(st.sampled_from(("", "   ", "# note", "1", f"1{delimiter}" * 6, delimiter * 3)), max_size=1)
    ):
        lines.insert(data.draw(st.integers(0, len(lines))), line)
    end = data.draw(st.sampled_from(("\n", "\r\n")))
    chunk = Chunk((end.join(lines) + end).encode(), 2, len(lines))
    wanted = data.draw(st.sampled_from((layout.columns, layout.columns[:1], layout.columns[2:])))
    read = quick.parse(chunk, layout, wanted)
    if read is not None:
        assert_equal(canonical(read), canonical(rows.parse(chunk, layout, wanted)))


def test_plain_rows_are_left_to_the_compiled_pass(layouts: list[Layout]) -> None:
    for layout in layouts:
        row = layout.dialect.delimiter.join(("0.5", "run", '"1.25"', "NaN")).replace(".", layout.notation.decimal)
        read = quick.parse(Chunk(f"{row}\r\n\n{row}\n".encode(), 2, 3), layout, layout.columns)
        assert read is not None
        np.testing.assert_array_equal(read.numbers[2], [1.25, 1.25])
        assert read.texts[1] == ["run", "run"]


@pytest.mark.parametrize(
    "line", ["1,run,2", "1,run,2,3,4", "# note", ",,,", "t,state,F,x", "1,run,abc,3", '1,"ru""n",2,3', '1,"run,2,3']
)
def test_rows_that_are_odd_are_left_to_the_careful_pass(layouts: list[Layout], line: str) -> None:
    (layout,) = (layout for layout in layouts if layout.dialect.delimiter == ",")
    assert quick.parse(Chunk(f"1,run,2,3\n{line}\n1,run,2,3\n".encode(), 2, 3), layout, layout.columns) is None


def bits(value: float) -> int:
    return struct.unpack("<q", struct.pack("<d", value))[0]


def test_decimals_become_the_nearest_double() -> None:
    generator = random.Random(1)
    for _ in range(20_000):
        w = generator.randrange(1, 10 ** generator.randrange(1, 20))
        power = generator.randrange(-LARGEST_POWER, LARGEST_POWER + 1)
        assert bits(nearest(np.uint64(w), power)) == bits(float(f"{w}e{power}")), (w, power)


def test_halves_between_two_doubles_go_to_the_even_one() -> None:
    generator = random.Random(2)
    for _ in range(5_000):
        odd = generator.getrandbits(54) | 1 | (1 << 53)  # one bit more than a double holds
        for power in range(5):
            if odd * 5**power < 2**64:
                assert bits(nearest(np.uint64(odd * 5**power), -power)) == bits(odd / 2**power)


@settings(max_examples=300, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(1, 19))
def test_every_double_comes_back_from_its_text(layouts: list[Layout], value: float, digits: int) -> None:
    (layout,) = (layout for layout in layouts if layout.dialect.delimiter == ";" and layout.notation.decimal == ".")
    for text in (repr(value), f"{value:.{digits}e}", f"{value:.{digits}f}", f"{value:.{digits}G}"):
        if len(text) < 300:
            read = quick.parse(Chunk(f"1;run;{text};3\n".encode(), 2, 1), layout, layout.columns)
            assert read is not None
            assert bits(read.numbers[2][0]) == bits(float(text))


def test_a_second_header_is_refused_with_its_line(layouts: list[Layout]) -> None:
    layout = layouts[0]
    with pytest.raises(InputError, match="second header begins in line 41"):
        rows.parse(Chunk(b"1,run,2,3\na,state,b,c\n", 40, 2), layout, layout.columns)
