"""Names and units rows in the languages that logs are written in, and rows that are neither."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.ingest.delimited import READER
from pipeline.ingest.scan import scan_log
from pipeline.recording.units import conversion

TIME = np.arange(200) / 100.0
FORCE = np.round(50.0 * np.sin(3.0 * TIME), 4)


def opened(tmp_path, *header: str, encoding: str = "utf-8"):
    rows = [f"{t:.3f},{np.cos(t):.5f},{force:.4f}" for t, force in zip(TIME, FORCE, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*header, *rows]) + "\n", encoding=encoding)
    return READER.open(path)


@pytest.mark.parametrize(
    ("names", "units", "encoding"),
    [
        ("时间,位移,力", "秒,毫米,牛", "gb18030"),
        ("時間,変位,荷重", "秒,ミリメートル,ニュートン", "shift_jis"),
        ("时间,位移,力", "（秒）,（毫米）,（牛顿）", "utf-8"),
        ("Время,Перемещение,Сила", "с,мм,Н", "utf-8"),
        ("Zeit,Weg,Kraft", "Sekunden,Millimeter,Newton", "utf-8"),
        ("Temps,Déplacement,Force", "secondes,millimètres,newtons", "utf-8"),
        ("시간,변위,힘", "초,밀리미터,뉴턴", "utf-8"),
    ],
)
def test_a_units_row_in_another_language_is_understood(tmp_path, names, units, encoding):
    log = opened(tmp_path, names, units, encoding=encoding)
    assert [channel.name for channel in log.tables[0].channels] == names.split(",")
    si = [conversion(channel.unit or "") for channel in log.tables[0].channels]
    assert [(to.factor, to.unit) for to in si] == [(1.0, "s"), (1e-3, "m"), (1.0, "N")]


def test_a_units_row_of_unknown_words_is_recognised_and_told_with_the_way_to_give_units(tmp_path):
    log = opened(tmp_path, "time,position,load", "s,zoll-fuss,pood")
    assert [channel.name for channel in log.tables[0].channels] == ["time", "position", "load"]
    assert [channel.unit for channel in log.tables[0].channels] == ["s", "zoll-fuss", "pood"]
    (note,) = log.notes
    assert "Line 2 is taken for the units" in note.message
    assert "'zoll-fuss', 'pood'" in note.message
    assert "unit: N" in note.message


def test_an_unknown_unit_of_time_is_refused_with_the_recipes_line(tmp_path):
    log = opened(tmp_path, "time,position,load", "tick,furlong-x,pood")
    with pytest.raises(InputError, match=r"unknown unit 'tick'.*`time: \{channel: \"time\", unit: s\}`"):
        scan_log(log.path)


@pytest.mark.parametrize(
    ("header", "names", "units"),
    [
        (("s,mm,N", "time,position,force"), ["time", "position", "force"], ["s", "mm", "N"]),
        (("Device A,Device B,Device C", "time,position,force"), ["time", "position", "force"], [None] * 3),
        (("time [s],position [mm],force [N]", "measured by hand"), ["time", "position", "force"], ["s", "mm", "N"]),
        (("time,position,force", "s1,mm,N"), ["time", "position", "force"], ["s1", "mm", "N"]),
        (("Weg,Kraft,Druck", "[aa],[bb],[cc]"), ["Weg", "Kraft", "Druck"], ["aa", "bb", "cc"]),
    ],
)
def test_names_and_units_are_told_apart(tmp_path, header, names, units):
    channels = opened(tmp_path, *header).tables[0].channels
    assert [channel.name for channel in channels] == names
    assert [channel.unit for channel in channels] == units
