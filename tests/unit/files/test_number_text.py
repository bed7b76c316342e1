"""Only the usual forms of a number are read as numbers."""

from math import inf, isnan

import pytest

from smadrive.files.number_text import MOST_DIGITS, distinct, parse_number, parse_whole, shortened


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("-1.5", -1.5), ("+.5e-3", 5e-4), ("2.", 2.0), (" 7\t", 7.0), ("inf", inf), ("1e999", inf)],
)
def test_number_is_read(text, value):
    assert parse_number(text) == value


def test_nan_is_read():
    assert isnan(parse_number("nan"))


@pytest.mark.parametrize(
    "text", ["", "-", "2_0", "٢", "1,5", "0x10", "1e", "e5", ".", "1 2", "infinity", "1\n", "1" * (MOST_DIGITS + 1)]
)
def test_text_that_is_not_a_number_is_an_error(text):
    with pytest.raises(ValueError):
        parse_number(text)


@pytest.mark.parametrize(("text", "value"), [("10", 10), ("-3", -3), ("0x8000", 0x8000), ("-0x1", -1), ("007", 7)])
def test_whole_number_is_read(text, value):
    assert parse_whole(text) == value


@pytest.mark.parametrize("text", ["", "1.0", "1_0", "٢", "0b1", "0x", "1e3", "9" * 5000])
def test_text_that_is_not_a_whole_number_is_an_error(text):
    with pytest.raises(ValueError):
        parse_whole(text)


@pytest.mark.parametrize("value", ["x" * 1000, int("f" * 10_000, 16), [1.0] * 1000], ids=["text", "whole", "list"])
def test_value_in_a_message_is_short(value):
    assert len(shortened(value)) <= 60


@pytest.mark.parametrize(("value", "other"), [(0.05, 0.0501), (0.05, 0.05000001), (0.0504, 0.05), (2.0, 3.0)])
def test_value_and_limit_have_texts_that_differ(value, other):
    assert distinct(value, other) != distinct(other, value)
    assert float(distinct(value, other)) > float(distinct(other, value)) if value > other else value < other
