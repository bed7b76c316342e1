"""CSV tables: an error names the file and the cell, and no table is written in part."""

import os

import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.files.csv_table import MOST_BYTES, read_table, write_table


def table(tmp_path, text, **options):
    path = tmp_path / "data.csv"
    path.write_text(text, **options)
    return read_table(path)


def test_columns_are_read_as_numbers_and_the_others_are_kept(tmp_path):
    read = table(tmp_path, "time_s, temperature_c,note\n0,20.5,a\n1,21.5,b\n")
    np.testing.assert_array_equal(read.column("temperature_c"), [20.5, 21.5])
    write_table(tmp_path / "out.csv", read.cells, {"displacement_mm": np.array([0.1, 1 / 3])})
    back = read_table(tmp_path / "out.csv")
    assert back.cells["note"] == ["a", "b"]
    assert back.column("displacement_mm")[1] == 1 / 3
    assert [file.name for file in tmp_path.iterdir() if file.name.startswith("out")] == ["out.csv"]


def test_byte_order_mark_is_no_part_of_the_first_name(tmp_path):
    assert table(tmp_path, "time_s\n1\n", encoding="utf-8-sig").column("time_s")[0] == 1.0


@pytest.mark.parametrize(
    ("text", "place", "named"),
    [
        ("time_s,temperature_c\n0,20\n1,hot\n", ", line 3, column 'temperature_c'", "'hot'"),
        ("time_s,temperature_c\n0,nan\n1,2\n", ", line 2, column 'temperature_c'", "'nan'"),
        ("time_s,temperature_c\n0,inf\n1,2\n", ", line 2, column 'temperature_c'", "'inf'"),
        ("time_s,temperature_c\n0,\n1,2\n", ", line 2, column 'temperature_c'", "''"),
        ("time_s,temprature_c\n0,1\n1,2\n", "", "'temperature_c'"),
        ("time_s;temperature_c\n0,5;20,1\n1;21\n", "", "';'"),
        ("time_s;temperature_c\n0;20\n1;21\n", "", "';'"),
        ("time_s\ttemperature_c\n0\t20\n1\t21\n", "", r"'\t'"),
        ("time_s,temperature_c\n", "", "no samples"),
        ("", "", "no samples"),
    ],
)
def test_error_names_file_and_cell(tmp_path, text, place, named):
    with pytest.raises(DataError) as caught:
        table(tmp_path, text).column("temperature_c")
    assert caught.value.where == f"{tmp_path / 'data.csv'}{place}"
    assert named in caught.value.what
    assert caught.value.cure


def test_numbers_in_the_first_line_are_no_names(tmp_path):
    with pytest.raises(DataError) as caught:
        table(tmp_path, "0.0,21.5\n0.1,21.6\n")
    assert (caught.value.value, "time_s" in caught.value.cure) == ("0.0,21.5", True)


def test_decimal_commas_between_commas_are_named(tmp_path):
    with pytest.raises(DataError) as caught:
        table(tmp_path, "time_s,temperature_c\n0,0,21,5\n0,1,21,6\n")
    assert caught.value.cure == "write decimal points, not commas"


def test_misspelled_column_is_suggested(tmp_path):
    with pytest.raises(DataError) as caught:
        table(tmp_path, "time_s,temprature_c\n0,1\n").column("temperature_c")
    assert "'temprature_c'" in caught.value.cure


def test_line_with_a_missing_cell_is_an_error(tmp_path):
    with pytest.raises(DataError) as caught:
        table(tmp_path, "time_s,temperature_c\n0,1\n1\n")
    assert caught.value.where == f"{tmp_path / 'data.csv'}, line 3"
    assert (caught.value.value, caught.value.limit) == ("line: 1, header: 2", None)


def test_missing_binary_and_unwritable_files_are_errors(tmp_path):
    with pytest.raises(DataError) as caught:
        read_table(tmp_path / "absent.csv")
    assert caught.value.where == str(tmp_path / "absent.csv")
    (tmp_path / "data.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(DataError) as caught:
        read_table(tmp_path / "data.csv")
    assert caught.value.where == str(tmp_path / "data.csv")
    with pytest.raises(DataError) as caught:
        write_table(tmp_path / "no" / "out.csv", {}, {"x": np.zeros(1)})
    assert caught.value.where == str(tmp_path / "no" / "out.csv")


@pytest.mark.parametrize("cell", ["2_0", "٢٠", "²", "0x10", "1e300", "-2e12", "1,5".replace(",", "·"), "9" * 5000])
def test_cell_without_a_usable_number_is_an_error(tmp_path, cell):
    with pytest.raises(DataError) as caught:
        table(tmp_path, f"time_s,temperature_c\n0,20\n1,{cell}\n", encoding="utf-8").column("temperature_c")
    assert caught.value.where.endswith("line 3, column 'temperature_c'")


@pytest.mark.parametrize("cell", ["20", " 20.0 ", "+2e1", ".2E2", "20.", "200e-1"])
def test_every_usual_form_of_a_number_is_read(tmp_path, cell):
    assert table(tmp_path, f"temperature_c\n{cell}\n").column("temperature_c")[0] == 20.0


@pytest.mark.parametrize("header", ["time_s,temperature_c,time_s", "time_s,temperature_c, time_s", ",temperature_c,"])
def test_two_columns_of_one_name_are_an_error(tmp_path, header):
    with pytest.raises(DataError) as caught:
        table(tmp_path, f"{header}\n0,20,1\n1,21,2\n")
    assert repr(header.split(",")[0]) in caught.value.what


def test_empty_columns_of_a_spreadsheet_are_skipped(tmp_path):
    read = table(tmp_path, "time_s,temperature_c,,\n0,20,,\n1,21,,\n")
    assert list(read.cells) == ["time_s", "temperature_c"]


def test_error_names_the_line_of_the_file(tmp_path):
    with pytest.raises(DataError) as caught:
        table(tmp_path, "time_s\n\n0\n\nhot\n").column("time_s")
    assert caught.value.where == f"{tmp_path / 'data.csv'}, line 5, column 'time_s'"


def test_table_that_looks_like_a_deep_toml_key_is_an_error_at_once(tmp_path):
    """A TOML parser would need minutes to find out that this is no TOML."""
    with pytest.raises(DataError):
        table(tmp_path, "a." * 500_000 + "a = 1\n")


def test_table_beyond_the_largest_size_is_an_error(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("time_s\n0\n")
    os.truncate(path, MOST_BYTES + 1)
    with pytest.raises(DataError) as caught:
        read_table(path)
    assert caught.value.limit == MOST_BYTES


@pytest.mark.parametrize("name", ["time_ms", "time"])
def test_column_in_another_unit_is_to_be_converted_and_renamed(tmp_path, name):
    path = tmp_path / "ms.csv"
    path.write_text(f"{name},displacement_mm\n0,1\n1000,2\n")
    with pytest.raises(DataError) as error:
        read_table(path).column("time_s")
    assert error.value.cure == f"convert the column '{name}' to s, and rename it to 'time_s'"
