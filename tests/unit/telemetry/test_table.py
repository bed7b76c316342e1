"""CSV tables: every bad file and cell is named, nothing is half-written."""

import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.telemetry.table import read_table, write_table


def table(tmp_path, text, **options):
    path = tmp_path / "data.csv"
    path.write_text(text, **options)
    return read_table(path)


def test_columns_are_numbers_by_name_and_the_others_are_carried(tmp_path):
    read = table(tmp_path, "time_s, temperature_c,note\n0,20.5,a\n1,21.5,b\n")
    np.testing.assert_array_equal(read.column("temperature_c"), [20.5, 21.5])
    write_table(tmp_path / "out.csv", read.cells, {"displacement_mm": np.array([0.1, 1 / 3])})
    back = read_table(tmp_path / "out.csv")
    assert back.cells["note"] == ["a", "b"]
    assert back.column("displacement_mm")[1] == 1 / 3
    assert [file.name for file in tmp_path.iterdir() if file.name.startswith("out")] == ["out.csv"]


def test_a_byte_order_mark_is_no_part_of_the_first_name(tmp_path):
    assert table(tmp_path, "time_s\n1\n", encoding="utf-8-sig").column("time_s")[0] == 1.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "time_s,temperature_c\n0,20\n1,hot\n",
            "data.csv, line 3, column 'temperature_c': 'hot' is not a finite number",
        ),
        ("time_s,temperature_c\n0,nan\n1,2\n", "line 2, column 'temperature_c': 'nan'"),
        ("time_s,temperature_c\n0,inf\n1,2\n", "'inf'"),
        ("time_s,temperature_c\n0,\n1,2\n", "line 2, column 'temperature_c': ''"),
        ("time_s,temprature_c\n0,1\n1,2\n", "no column 'temperature_c'; did you mean 'temprature_c'"),
        ("time_s,temperature_c\n0,1\n1\n", "line 3: 1 cells, the header has 2"),
        (
            "time_s;temperature_c\n0,5;20,1\n1;21\n",
            "data.csv: separated by ';': write it with commas between cells, and",
        ),
        ("time_s;temperature_c\n0;20\n1;21\n", "and decimal points"),
        ("time_s\ttemperature_c\n0\t20\n1\t21\n", r"separated by '\\t'"),
        ("time_s,temperature_c\n", "no samples"),
        ("", "no samples"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, told):
    with pytest.raises(DataError, match=told):
        table(tmp_path, text).column("temperature_c")


def test_missing_binary_and_unwritable_files_are_named(tmp_path):
    with pytest.raises(DataError, match=r"absent\.csv: no such file"):
        read_table(tmp_path / "absent.csv")
    (tmp_path / "data.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(DataError, match="cannot be read as CSV"):
        read_table(tmp_path / "data.csv")
    with pytest.raises(DataError, match="cannot be written"):
        write_table(tmp_path / "no" / "out.csv", {}, {"x": np.zeros(1)})
