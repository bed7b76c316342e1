"""A TOML text with mistakes is read as far as possible, and every replaced line is reported."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smadrive.files.toml.repair import MOST_REPAIRS, repaired_toml

TEXT = """name = "bench"
rate_hz = 20.0
[[devices]]
name = "supply"
url = "serial:///dev/ttyUSB0"
[[devices]]
name = "bead"
unit_id = 7
[limits]
current_max_a = 0.6
"""
TABLES = tomllib.loads(TEXT)


@pytest.mark.parametrize(
    ("right", "wrong", "line", "table"),
    [
        ("20.0", "20,0", 2, ""),
        ("20.0", "20..0", 2, ""),
        ("20.0", "[20.0", 2, ""),
        ("20.0", '"""20.0', 2, ""),
        ("20.0", "{a = 20.0", 2, ""),
        ('"serial:', "serial:", 5, "devices"),
        ('USB0"', "USB0", 5, "devices"),
        ('"serial:///dev/ttyUSB0"', "serial:///dev/ttyUSB0", 5, "devices"),
        ("[[devices]]", "[[devices]", 3, "devices"),
        ("[[devices]]", "[[devices", 3, "devices"),
        ("unit_id = 7", "unit_id = 7\nunit_id = 8", 9, "devices"),
        ("[limits]", "[limits", 9, "limits"),
        ("0.6", "", 10, "limits"),
    ],
)
def test_devices_are_read_beside_a_mistake(right, wrong, line, table):
    assert right in TEXT
    tables, repairs = repaired_toml(TEXT.replace(right, wrong, 1))
    assert tables["devices"] == TABLES["devices"]
    assert [(repair.line, repair.table) for repair in repairs] == [(line, table)]


def test_keys_below_a_rejected_header_do_not_join_the_table_above():
    tables, repairs = repaired_toml('[[devices]]\nname = "supply"\n[{devices}]\nunit_id = 7\n')
    assert tables["devices"] == [{"name": "supply"}]
    assert [repair.line for repair in repairs] == [3]


def test_valid_text_needs_no_repair():
    assert repaired_toml(TEXT) == (TABLES, [])


def test_text_with_too_many_mistakes_is_rejected():
    assert len(repaired_toml("a\n" * MOST_REPAIRS)[1]) == MOST_REPAIRS
    with pytest.raises(ValueError, match="line 1,"):
        repaired_toml("a\n" * (MOST_REPAIRS + 1))


@given(st.text(st.sampled_from("a=[]{}\"'.,#\n 1"), max_size=60))
def test_repair_ends_and_keeps_the_devices_above(text):
    tables, _ = repaired_toml(f'[[devices]]\nname = "supply"\n[rest]\n{text}')
    assert tables["devices"][0]["name"] == "supply"
