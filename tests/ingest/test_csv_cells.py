"""Encodings, numbers, time stamps and headers: what single pieces of a delimited file mean."""

from __future__ import annotations

import math
from datetime import datetime, timedelta

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.ingest.delimited.cells import Notation, is_number, notation
from pipeline.ingest.delimited.encoding import detect
from pipeline.ingest.delimited.header import is_units_row, name_and_unit, names_and_units
from pipeline.ingest.delimited.stamps import NOT_A_TIME, Clock, count_format, iso, stamp_format

HEADERS = (
    ("Zeit;Kraft;Temperatur °C", "cp1252"), ("Größe;Prüfweg;Fläche in mm²", "cp1252"), ("µm", "cp1252"), ("±5 %", "cp1252"),
    ("Température (°C);Déplacement", "cp1252"), ("Velocità,Forza", "latin-1"), ("Força,Posição", "cp1252"),
    ("Prüfkraft;Öffnung;Höhe", "cp850"),
    ("时间,位移,力", "gb18030"), ("时间(秒),载荷(千牛),温度(℃)", "gb18030"), ("力", "gb18030"), ("编号;试样;速度", "gb2312"),
    ("試験時間,荷重,変位", "shift_jis"), ("時間[s],変位[mm],荷重[kN]", "shift_jis"), ("ストローク,ロードセル", "shift_jis"),
    ("Время;Перемещение;Усилие", "cp1251"), ("Ускорение [g];Датчик 1", "cp1251"), ("ТЕМПЕРАТУРА °C", "cp1251"),
    ("Время;мм", "koi8_r"), ("Время;мм", "cp866"), ("시간(초),변위(mm),하중(N)", "euc-kr"), ("時間,公厘", "big5"),
    ("时间,变位", "gb18030"), ("À vide;Durée;Señal ñ", "cp1252"), ("時間,変位", "euc_jp"),
    ("时间,Kraft,Δ", "utf-8"), ("时间", "utf-8-sig"), ("时间,Zeit", "utf-16"), ("Zeit,Größe,Kraft", "utf-16-le"),
    ("Zeit,Größe,Kraft", "utf-16-be"), ("Zeit,Größe", "utf-32"),
)  # fmt: skip


@pytest.mark.parametrize(("text", "codec"), HEADERS)
def test_a_header_is_decoded_as_it_was_written(text: str, codec: str) -> None:
    data = (text + "\n" + "1,2,3\n" * 5).encode(codec)
    found = detect(data)
    assert found is not None
    assert data[found.mark :].decode(found.codec).startswith(text)


@pytest.mark.parametrize("data", [bytes(range(256)), b"\x00\x01abc\xff" * 30, b"t,F\n1,2\n\0\0\0x"])
def test_bytes_that_are_no_text_have_no_encoding(data: bytes) -> None:
    assert detect(data) is None


@pytest.mark.parametrize(
    ("text", "decimal", "grouping", "value"),
    [
        ("1.5", ".", "", 1.5), ("+1.5E-03", ".", "", 1.5e-3), ("1.5D+02", ".", "", 150.0), (".5", ".", "", 0.5), ("5.", ".", "", 5.0),
        ("−2.5", ".", "", -2.5), ("+ 2.5", ".", "", 2.5), ("-1,25", ",", "", -1.25), ("1.234,5", ",", ".", 1234.5),
        ("1,234,567.5", ".", ",", 1234567.5), ("1 234,5", ",", " ", 1234.5), ("1\u202f234,5", ",", " ", 1234.5), ("1'234.5", ".", "'", 1234.5),
        ("inf", ".", "", math.inf), ("-1.#INF", ".", "", -math.inf), ("Infinity", ".", "", math.inf),
    ],
)  # fmt: skip
def test_numbers_of_every_notation_are_read(text: str, decimal: str, grouping: str, value: float) -> None:
    assert is_number(text)
    assert Notation(decimal, grouping).number(text) == value


@pytest.mark.parametrize(
    "text", ["", "NaN", "nan", "-nan(ind)", "NA", "N/A", "null", "-", "---", "#N/A", "1.#QNAN", "#WERT!"]
)
def test_what_stands_for_no_value_is_missing(text: str) -> None:
    assert math.isnan(Notation().number(text) or 0.0)


@pytest.mark.parametrize("text", ["abc", "1,5", "1.5.2", "0x10", "1_000", "٣", "12:00", "1 2", "1e", "--5", "5 mm"])
def test_what_is_no_number_is_not_taken_for_one(text: str) -> None:
    assert Notation().number(text) is None


@pytest.mark.parametrize(
    ("texts", "decimal", "grouping"),
    [
        (["1.5", "2"], ".", ""), (["1,5", "2"], ",", ""), (["1,234.5"], ".", ","), (["1.234,5"], ",", "."),
        (["1,234,567"], ".", ","), (["0,123"], ",", ""), (["1.234", "0,5"], ",", "."), (["1,234", "0.5"], ".", ","),
        (["1 234,5"], ",", " "), (["12", "13"], ".", ""), (["1.234"], ".", ""), (["12,3456"], ",", ""),
    ],
)  # fmt: skip
def test_decimal_and_thousands_signs_are_told_apart(texts: list[str], decimal: str, grouping: str) -> None:
    assert notation(texts, "log.csv") == (Notation(decimal, grouping), None)


def test_a_comma_that_may_be_either_is_read_as_a_decimal_and_named() -> None:
    assert notation(["1,234", "5,678"], "log.csv") == (Notation(","), "1,234")


@pytest.mark.parametrize("texts", [["1.5", "1,5"], ["1.234", "1,234"], ["1.234.567,5", "0.5"]])
def test_numbers_written_both_ways_are_refused(texts: list[str]) -> None:
    with pytest.raises(InputError, match=r"^log.csv: .*unclear"):
        notation(texts, "log.csv")


STAMPS = (
    ("2024-03-01 12:00:01,250", "2024-03-01T12:00:01.25"), ("2024-03-01T12:00:01.000000001", "2024-03-01T12:00:01.000000001"),
    ("2024-03-01T12:00:01Z", "2024-03-01T12:00:01"), ("2024-03-01T12:00:01+01:00", "2024-03-01T11:00:01"),
    ("2024/3/1 9:05:01", "2024-03-01T09:05:01"), ("2024/03/01/12:00:00.5", "2024-03-01T12:00:00.5"), ("2024-03-01 12:00", "2024-03-01T12:00:00"),
    ("01.03.2024 12:00:00.5", "2024-03-01T12:00:00.5"), ("01.03.24 12:00:00", "2024-03-01T12:00:00"),
    ("3/25/2024 1:05:00 PM", "2024-03-25T13:05:00"), ("3/1/2024 12:05:00 AM", "2024-03-01T00:05:00"), ("25/03/2024 12:00:00:123", "2024-03-25T12:00:00.123"),
    ("01-Mar-2024 12:00:00.75", "2024-03-01T12:00:00.75"), ("20240301T120001.5", "2024-03-01T12:00:01.5"), ("2024年3月1日 12:00:01", "2024-03-01T12:00:01"),
)  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), STAMPS)
def test_stamps_of_every_order_are_understood(text: str, expected: str) -> None:
    found = stamp_format([text])
    assert found is not None
    assert iso(found.instant(text), has_zone=False) == expected
    assert found.instants([text, text]).tolist() == [found.instant(text)] * 2


@pytest.mark.parametrize(
    "text", ["1.5", "12:30", "2024-03-01", "31.02.2024 12:00:00", "9999-01-01 00:00:00", "run 12:00:00", "1709294400"]
)
def test_what_may_be_something_else_is_no_stamp(text: str) -> None:
    assert stamp_format([text]) is None


def test_stamps_are_exact_to_the_nanosecond() -> None:
    start = datetime(2024, 2, 29, 23, 59, 58)
    texts = [(start + timedelta(microseconds=137 * k)).isoformat(" ", "microseconds") for k in range(30_000)]
    found = stamp_format(texts[:50])
    assert found is not None
    seconds = Clock(found.instant(texts[0]), found.period).seconds(found.instants(texts))
    np.testing.assert_array_equal(seconds, np.arange(30_000) * 137 / 1e6)


@pytest.mark.parametrize("tail", ["", "Z", "+01:00", " PM"])
def test_many_stamps_are_read_as_one_by_one(tail: str) -> None:
    texts = [f"2024-03-01 0{k % 5}:{k % 60:02d}:{k % 7:02d}.{k * 7919 % 10**6:06d}{tail}" for k in range(500)]
    texts[100:103] = ["", "2024-03-01 01:00:00.5.5", "2024-13-01 01:00:00.25" + tail]
    found = stamp_format(texts[:50])
    assert found is not None
    assert found.instants(texts).tolist() == [found.instant(text) for text in texts]


def test_the_order_of_day_and_month_that_keeps_stamps_together_wins() -> None:
    days = [f"01/{day:02d}/2024 12:00:00" for day in (2, 3, 4)]
    found = stamp_format(days)
    assert found is not None
    assert found.name.startswith("month/day/year")


@pytest.mark.parametrize(
    ("texts", "seconds"),
    [
        (["23:59:59.5", "00:00:00.5", "00:00:01.5"], [0, 1, 2]),
        (["59:59.9", "00:00.4", "00:01.0"], [0, 0.5, 1.1]),
        (["23:00:00", "24:00:00", "25:00:00"], [0, 3600, 7200]),
        (["12:00:01", "12:00:00", "12:00:02"], [0, -1, 1]),
    ],
)
def test_clocks_that_turn_over_go_on(texts: list[str], seconds: list[float]) -> None:
    found = stamp_format(texts)
    assert found is not None
    clock = Clock(found.instant(texts[0]), found.period)
    parts = [clock.seconds(found.instants(texts[:2])), clock.seconds(found.instants(texts[2:]))]
    np.testing.assert_allclose(np.concatenate(parts), seconds, atol=1e-12)


def test_a_missing_stamp_is_a_missing_time() -> None:
    instants = np.array([0, NOT_A_TIME, 10**9])
    np.testing.assert_array_equal(Clock(0, 0).seconds(instants), [0, np.nan, 1])


@pytest.mark.parametrize(
    ("name", "unit", "first", "counts"),
    [
        ("timestamp", None, "1709294400.25", True), ("time", None, "1709294400250", True), ("%time", "ns", "1709294400250000000", True),
        ("__time", "s", "1709294400.25", True), ("time", "us", "1709294400", False), ("force", None, "1709294400", False), ("time", None, "12.5", False),
    ],
)  # fmt: skip
def test_counts_since_1970_are_told_from_elapsed_time(name: str, unit: str | None, first: str, counts: bool) -> None:
    assert (count_format(name.strip("%"), unit, [first, first]) is not None) is counts


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Force [kN]", ("Force", "kN")), ("x (mm)", ("x", "mm")), ("Time(ms)", ("Time", "ms")), ("T/°C", ("T", "°C")), ("v/(m/s)", ("v", "m/s")),
        ("a / m/s²", ("a", "m/s²")), ("F / N", ("F", "N")), ("Kraft in N", ("Kraft", "N")), ("force_kN", ("force", "kN")), ("t_s", ("t", "s")),
        ("Strain [-]", ("Strain", "-")), ("时间(秒)", ("时间", "秒")), ("Position (mm):", ("Position", "mm")), ("p (N/mm²)", ("p", "N/mm²")),
        ("Position(Linear:Position) (mm)", ("Position(Linear:Position)", "mm")), ("cDAQ1Mod1/ai0 (V)", ("cDAQ1Mod1/ai0", "V")),
        ("stress/strain", ("stress/strain", None)), ("dF/dt", ("dF/dt", None)), ("F/A", ("F/A", None)), ("x_1", ("x_1", None)), ("ch[1]", ("ch[1]", None)),
        ("Force (2)", ("Force (2)", None)), ("F (min)", ("F (min)", None)), ("Sensor (left)", ("Sensor (left)", None)), ("b (9^9^9^9)", ("b (9^9^9^9)", None)),
        ("I/O", ("I/O", None)), ("Datum/Zeit", ("Datum/Zeit", None)), ("Load cell", ("Load cell", None)), ("", ("", None)),
    ],
)  # fmt: skip
def test_units_are_split_off_where_they_are_beyond_doubt(text: str, expected: tuple[str, str | None]) -> None:
    assert name_and_unit(text) == expected


def test_columns_of_a_header_settle_doubts_among_them() -> None:
    assert names_and_units(["t [s]", "F [kX]"]) == [("t", "s"), ("F", "kX")]
    assert names_and_units(["Force (A)", "Force (B)"]) == [("Force (A)", None), ("Force (B)", None)]
    assert names_and_units(["Force (N)", "Force (kN)"]) == [("Force (N)", "N"), ("Force (kN)", "kN")]


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["(s)", "(mm)", "(N)"], True), (["s", "mm", "N"], True), (["[s]", "[kX]", "[N]"], True), (["", "ms", "degC", "V"], True),
        (["second", "Volt", "Volt"], True), (["t", "A", "D", "Y", "V", "F"], False), (["t", "F"], False), (["time", "force"], False),
        (["9**9**9**9", "x"], False), ([], False), (["", ""], False),
    ],
)  # fmt: skip
def test_a_row_of_units_is_told_from_a_row_of_names(cells: list[str], expected: bool) -> None:
    assert is_units_row(cells) is expected
