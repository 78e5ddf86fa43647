"""Tables as machines, loggers, scopes and spreadsheets write them: names, units, entries, clocks, values."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from pipeline.ingest.delimited import READER
from pipeline.ingest.reader import RawLog

LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\t{columns}\nOperator\tMeier\n"
    "***End_of_Header***\t\n\t\nChannels\t2\t\t\t\nSamples\t8\t8\t\t\nY_Unit_Label\tNewton\tmm\t\t\nX_Dimension\tTime\tTime\t\t\n"
    "X0\t2.0E+0\t2.0E+0\t\t\nDelta_X\t0.250000\t0.250000\t\t\n***End_of_Header***\t\t\t\t\nX_Value\tForce\tDispl\tComment\n"
)


def table(
    delimiter: str, *, start: str = "", end: str = "", decimal: str = ".", form: str = "{:.3f}", n: int = 8
) -> str:
    """Write rows k/4, k, -k/2."""
    rows = ([form.format(value).replace(".", decimal) for value in (k / 4, k, -k / 2)] for k in range(n))
    return "".join(start + delimiter.join(row) + end + "\n" for row in rows)


def stamped(form: str, delimiter: str = ",", value: str = "{k}", n: int = 8) -> str:
    return "".join(form.format(k=k) + delimiter + value.format(k=k) + "\n" for k in range(n))


QUARTERS = [k / 4 for k in range(8)]


@dataclass(frozen=True)
class Export:
    text: str
    names: list[str]
    units: list[str | None]
    metadata: dict[str, str] = field(default_factory=dict)
    encoding: str = "utf-8"
    time_channel: str | None = None
    absolute_start: str | None = None
    first: list[float] = field(default_factory=lambda: QUARTERS)
    suffix: str = ".csv"


EXPORTS = {
    "tensile machine with preamble, units row and decimal comma": Export(
        '"Prüfnorm";"DIN 53504"\nPrüfgeschwindigkeit;10;mm/min\n\n"Prüfzeit";"Standardweg";"Standardkraft"\n"s";"mm";"N"\n'
        + table(";", decimal=","),
        ["Prüfzeit", "Standardweg", "Standardkraft"], ["s", "mm", "N"],
        {"Prüfnorm": "DIN 53504", "Prüfgeschwindigkeit": "10 mm/min"}, "cp1252",
    ),
    "statistics above the table": Export(
        "Nr;Fmax;Weg\n;N;mm\n1;123,4;5,6\n2;120,1;5,5\n\nZeit;Kraft;Weg\ns;N;mm\n" + table(";", decimal=",", n=40),
        ["Zeit", "Kraft", "Weg"], ["s", "N", "mm"], {}, first=[k / 4 for k in range(40)],
    ),
    "results table with bracketed units row": Export(
        "Results Table 1\nSpecimen label,A-1\nRate 1,10.00000,mm/min\n\nTime,Extension,Load\n(s),(mm),(kN)\n" + table(","),
        ["Time", "Extension", "Load"], ["s", "mm", "kN"], {"Specimen label": "A-1", "Rate 1": "10.00000 mm/min"},
    ),
    "controller with blanks in names": Export(
        "Test Run Name: run 1\n\nTime\tAxial Displacement\tAxial Force\nsec\tmm\tkN\n" + table("\t"),
        ["Time", "Axial Displacement", "Axial Force"], ["sec", "mm", "kN"], {"Test Run Name": "run 1"},
    ),
    "amplifier with units in brackets": Export(
        "HBM\nDatei: x.bin\nT0 = 01.03.2024 12:00:00\n\nZeit [s]\tKraft [kN]\tWeg [mm]\n" + table("\t", decimal=","),
        ["Zeit", "Kraft", "Weg"], ["s", "kN", "mm"], {"Datei": "x.bin", "T0": "01.03.2024 12:00:00"}, "cp1252", suffix=".asc",
    ),
    "three heading rows": Export(
        "Time;Force;Disp\ns;N;mm\n-;S1234;S5678\n" + table(";"), ["Time", "Force", "Disp"], ["s", "N", "mm"]
    ),
    "USB scope with a blank line below the units": Export(
        "Time,Channel A,Channel B\n(ms),(mV),(V)\n\n" + table(",", form="{:.8f}"),
        ["Time", "Channel A", "Channel B"], ["ms", "mV", "V"],
    ),
    "scope with entries above": Export(
        "Model,MDO3024\n\nWaveform Type,ANALOG,,\nHorizontal Units,s\nSample Interval,2.5e-01\nLabel,,\nTIME,CH1,CH2\n"
        + table(",", form="{:.6e}"),
        ["TIME", "CH1", "CH2"], [None] * 3,
        {"Model": "MDO3024", "Waveform Type": "ANALOG", "Horizontal Units": "s", "Sample Interval": "2.5e-01"},
    ),
    "scope with entries in the first columns": Export(
        "".join(
            f"{a},{b},,{k / 4:.6f},{k},\n"
            for k, (a, b) in enumerate([("Record Length", "2.5e+03"), ("", ""), ("Vertical Units", "V"), *[("", "")] * 20])
        ),
        ["column_4", "column_5"], [None, None], {"Record Length": "2.5e+03", "Vertical Units": "V"},
        first=[k / 4 for k in range(23)],
    ),
    "scope whose clock is start and increment": Export(
        "X,CH1,Start,Increment,\nSequence,Volt,1.0e+00,2.5e-01\n" + "".join(f"{k},{k}.5,,\n" for k in range(8)),
        ["X", "CH1"], ["s", "Volt"], {"Start": "1.0e+00", "Increment": "2.5e-01"}, time_channel="X",
        first=[1 + k / 4 for k in range(8)],
    ),
    "scope with numbers for names": Export(
        "x-axis,1,2\nsecond,Volt,Volt\n" + table(",", form="{:+.6E}"), ["x-axis", "1", "2"], ["second", "Volt", "Volt"]
    ),
    "LabVIEW": Export(
        LABVIEW.format(columns="One") + table("\t"), ["X_Value", "Force", "Displ"], ["s", "N", "mm"],
        {"Writer_Version": "2", "Separator": "Tab", "Decimal_Separator": ".", "X_Columns": "One", "Operator": "Meier",
         "Channels": "2"}, suffix=".lvm",
    ),
    "LabVIEW without times": Export(
        LABVIEW.format(columns="No") + "".join(f"\t{k}\t{-k}\n" for k in range(8)), ["X_Value", "Force", "Displ"], ["s", "N", "mm"],
        {"Writer_Version": "2", "Separator": "Tab", "Decimal_Separator": ".", "X_Columns": "No", "Operator": "Meier",
         "Channels": "2"}, time_channel="X_Value", first=[2 + k / 4 for k in range(8)], suffix=".lvm",
    ),
    "LabVIEW with a remark in the first row": Export(
        LABVIEW.format(columns="One") + table("\t").replace("-0.000\n", "-0.000\tstart\n", 1),
        ["X_Value", "Force", "Displ"], ["s", "N", "mm"],
        {"Writer_Version": "2", "Separator": "Tab", "Decimal_Separator": ".", "X_Columns": "One", "Operator": "Meier",
         "Channels": "2"}, suffix=".lvm",
    ),
    "microcontroller with boot messages": Export(
        "0.03,2\nStarting...\nSensor ok\ntime_s,force_N,x\n" + table(","), ["time", "force", "x"], ["s", "N", None], suffix=".log"
    ),
    "serial monitor with arrows": Export(
        "12:34:00.000 -> force,pos\n" + stamped("12:34:0{k}.500 -> {k}.25"), ["time", "force", "pos"], ["s", None, None],
        time_channel="time", first=[float(k) for k in range(8)], suffix=".log",
    ),
    "serial plotter": Export(
        "".join(f"t:{k / 4:.2f},pos:{k}\n" for k in range(8)), ["t", "pos"], [None, None], suffix=".log"
    ),
    "units behind the numbers": Export(
        "t;F\n" + "".join(f"{k / 4:.2f} s;{k}.5 N\n".replace(".", ",") for k in range(8)), ["t", "F"], ["s", "N"]
    ),
    "spreadsheet that tells its delimiter": Export(
        "sep=;\r\nZeit [s];Kraft [N];x\r\n" + table(";", decimal=",", end="\r"), ["Zeit", "Kraft", "x"], ["s", "N", None],
        encoding="utf-8-sig",
    ),
    "spreadsheet in UTF-16": Export(
        "Zeit [s]\tKraft [N]\tx\r\n" + table("\t", decimal=",", end="\r"), ["Zeit", "Kraft", "x"], ["s", "N", None], encoding="utf-16",
    ),
    "spreadsheet with empty rows and columns": Export(
        "t,F,x,,\n" + table(",", end=",,") + ",,,,\n,,,,\n", ["t", "F", "x"], [None] * 3
    ),
    "header cells over two lines": Export(
        '"Time\n[s]","Force\n[kN]","x"\n' + table(","), ["Time", "Force", "x"], ["s", "kN", None]
    ),
    "matrix without names": Export(table(","), ["column_1", "column_2", "column_3"], [None] * 3),
    "numpy": Export(
        "# t [s] F [N] x [mm]\n" + table(" ", form="{:.18e}"), ["t", "F", "x"], ["s", "N", "mm"], suffix=".txt"
    ),
    "columns named in a comment": Export(
        "# Columns: t [s], F [N], x [mm]\n" + table("  "), ["t", "F", "x"], ["s", "N", "mm"], suffix=".dat"
    ),
    "fixed width": Export(
        "  Time      Load cell   Disp\n   (s)        (kN)      (mm)\n" + table("", form="{:12.3f}"),
        ["Time", "Load cell", "Disp"], ["s", "kN", "mm"], suffix=".dat",
    ),
    "R": Export(
        '"t" "F"\n' + "".join(f'"{k + 1}" {k / 4} {k}\n' for k in range(8)), ["column_1", "t", "F"], [None] * 3,
        first=[float(k + 1) for k in range(8)], suffix=".txt",
    ),
    "pandas with its index": Export(
        ",t,F\n" + "".join(f"{k},{k / 4},{k}\n" for k in range(8)), ["column_1", "t", "F"], [None] * 3, first=[float(k) for k in range(8)]
    ),
    "markdown": Export("| t | F | x |\n|---|---|---|\n" + table(" | ", start="| ", end=" |"), ["t", "F", "x"], [None] * 3, suffix=".txt"),
    "quoted decimal commas": Export(
        '"t [s]","F [N]","x"\n' + table('","', start='"', end='"', decimal=","), ["t", "F", "x"], ["s", "N", None]
    ),
    "DIN headings": Export(
        "t/s;F/N;v/(m/s)\n" + table(";", decimal=","), ["t", "F", "v"], ["s", "N", "m/s"]
    ),
    "one column with decimal commas": Export("F\n1,25\n1,50\n1,75\n2,00\n", ["F"], [None], first=[1.25, 1.5, 1.75, 2.0]),
    "old Macintosh line ends": Export(("t,F,x\n" + table(",")).replace("\n", "\r"), ["t", "F", "x"], [None] * 3),
    "comments with entries": Export(
        "# static_load: 52 [kN]\n# coil_current = 6 A\n% remark\n# a=1, b=2\n# Länge [mm]: 25,5\ntime [s],F [N],x\n" + table(","),
        ["time", "F", "x"], ["s", "N", None],
        {"static_load": "52 kN", "coil_current": "6 A", "a": "1", "b": "2", "Länge": "25,5 mm"},
    ),
    "one value beside the table": Export(
        '"t","F","fs",\n' + "".join(f"{k / 4},{k},{3004.8 if k == 0 else ''},\n" for k in range(8)), ["t", "F"], [None] * 2, {"fs": "3004.8"}
    ),
    "ISO stamps with an offset": Export(
        "stamp,F\n" + stamped("2024-03-01T12:00:0{k}.250+01:00"), ["stamp", "F"], ["s", None], time_channel="stamp",
        absolute_start="2024-03-01T11:00:00.25Z", first=[float(k) for k in range(8)],
    ),
    "stamps with a decimal comma": Export(
        "Zeit;F\n" + stamped("2024-03-01 12:00:01,{k}25", ";", "{k},5"), ["Zeit", "F"], ["s", None], time_channel="Zeit",
        absolute_start="2024-03-01T12:00:01.025", first=[round(k / 10, 1) for k in range(8)],
    ),
    "date and time in two columns": Export(
        "Datum;Uhrzeit;F [N]\n" + stamped("01.03.2024;23:59:5{k}.5", ";", "{k},5"), ["Datum", "Uhrzeit", "F"], [None, "s", "N"],
        time_channel="Uhrzeit", absolute_start="2024-03-01T23:59:50.5", first=[],
    ),
    "times of day over midnight": Export(
        "time,F\n23:59:58.5,0\n23:59:59.5,1\n0:00:00.5,2\n0:00:01.5,3\n", ["time", "F"], ["s", None], time_channel="time",
        first=[0.0, 1.0, 2.0, 3.0],
    ),
    "rostopic": Export(
        "%time,field.x\n" + "".join(f"{1709294400000000000 + k * 250_000_000},{k}\n" for k in range(8)), ["time", "field.x"],
        ["s", None], time_channel="time", absolute_start="2024-03-01T12:00:00Z",
    ),
    "stamps of whole seconds beside elapsed time": Export(
        "Timestamp,Time [s],F\n" + "".join(f"2024-03-01 12:00:0{k // 4},{k / 4},{k}\n" for k in range(8)),
        ["Timestamp", "Time", "F"], [None, "s", None], first=[],
    ),
}  # fmt: skip


def opened(folder: Path, export: Export) -> RawLog:
    path = folder / f"log{export.suffix}"
    path.write_bytes(export.text.encode(export.encoding))
    assert READER.recognises(path.read_bytes()[: 1 << 16], "")
    return READER.open(path)


@pytest.mark.parametrize("export", EXPORTS.values(), ids=EXPORTS.keys())
def test_an_export_is_read_as_it_is_meant(tmp_path: Path, export: Export) -> None:
    log = opened(tmp_path, export)
    (table,) = log.tables
    assert [channel.name for channel in table.channels] == export.names
    assert [channel.unit for channel in table.channels] == export.units
    assert log.metadata == export.metadata
    assert (table.time_channel, table.absolute_start) == (export.time_channel, export.absolute_start)
    blocks = list(table.blocks())
    if export.first:
        values = np.concatenate([block[export.names[0]] for block in blocks])
        np.testing.assert_allclose(values, export.first, rtol=1e-15, atol=1e-15)
    assert not [note for note in (*log.notes, *table.notes()) if note.level != "note"]


def test_text_columns_stay_text(tmp_path: Path) -> None:
    text = "t [s],state,F,ok\n" + "".join(f"{k / 4},{'run' if k > 3 else 'idle'},{k},{k > 5}\n" for k in range(8))
    (table,) = opened(tmp_path, Export(text, [], [])).tables
    assert [channel.is_text for channel in table.channels] == [False, True, False, True]
    (block,) = table.blocks(["state", "ok"])
    assert block["state"].dtype == object
    assert block["state"].tolist() == ["idle"] * 4 + ["run"] * 4
    assert block["ok"].tolist() == ["False"] * 6 + ["True"] * 2


def test_missing_values_are_missing_and_infinities_stay(tmp_path: Path) -> None:
    cells = ("1", "NaN", "-", "#N/A", "1.#QNAN", "inf", "-1.#INF", "")
    (table,) = opened(tmp_path, Export("t,F\n" + "".join(f"{k},{c}\n" for k, c in enumerate(cells)), [], [])).tables
    (block,) = table.blocks()
    np.testing.assert_array_equal(block["F"], [1, np.nan, np.nan, np.nan, np.nan, np.inf, -np.inf, np.nan])
    assert not table.notes()


def test_a_column_that_is_filled_late_is_a_channel(tmp_path: Path) -> None:
    rows = "".join(f"{k},{20.5 if k % 20_000 == 0 else ''}\n" for k in range(60_000))
    log = opened(tmp_path, Export("t,T\n" + rows, [], []))
    values = np.concatenate([block["T"] for block in log.tables[0].blocks()])
    assert log.metadata == {}
    assert np.flatnonzero(values == 20.5).tolist() == [0, 20_000, 40_000]


def test_how_the_file_was_understood_is_told(tmp_path: Path) -> None:
    details = opened(tmp_path, EXPORTS["tensile machine with preamble, units row and decimal comma"]).details
    assert details["encoding"] == "cp1252"
    assert details["delimiter"] == "semicolon"
    assert details["decimal sign"] == "comma"
    assert (details["names"], details["units"], details["first row"]) == ("line 4", "line 5", "line 6")


@pytest.mark.parametrize(
    "text",
    [
        "This is a text.\nIt has 5 words or more.\nNo table.\n",
        '{"t": 0.1, "F": 2.0}\n' * 30,
        "<a>\n<b>1</b>\n<b>2</b>\n</a>\n",
    ],
)
def test_text_without_a_table_is_not_recognised(text: str) -> None:
    assert not READER.recognises(text.encode(), ".log")


def test_bytes_are_not_recognised() -> None:
    assert not READER.recognises(bytes(range(256)) * 20, ".csv")
