"""Every error in a config file is one line that names file, key and cure."""

import os
from enum import StrEnum
from typing import Literal

import pytest
from pydantic import Field, ValidationError, model_validator

from smadrive.devices.calibration import CalibrationConfig
from smadrive.errors import ConfigError
from smadrive.files.config import Section, load_config, read_toml, validate
from smadrive.files.config_problems import MOST_DESCRIBED


class Inner(Section):
    current_max_a: float


class Outer(Section):
    name: str
    parts: tuple[Inner, ...]


def load(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return load_config(path, Outer)


def test_valid_file_loads_and_is_immutable(tmp_path):
    config = load(tmp_path, 'name = "x"\n[[parts]]\ncurrent_max_a = 0.5')
    assert config.parts[0].current_max_a == 0.5
    with pytest.raises(ValidationError):
        config.name = "y"


class Whole(Section):
    low: float

    @model_validator(mode="after")
    def _is_possible(self):
        raise ValueError("low is above high")


def test_problem_of_the_whole_file_names_no_key(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text("low = 1.0")
    with pytest.raises(ConfigError) as error:
        load_config(path, Whole)
    assert error.value.what == "low is above high"


def test_one_table_in_place_of_a_list_of_tables_is_named_with_its_cure(tmp_path):
    with pytest.raises(ConfigError, match=r"^.*parts: .*\[\[parts\]\]") as error:
        load(tmp_path, 'name = "x"\n[parts]\ncurrent_max_a = 0.5')
    assert "tuple" not in error.value.what


class Pair(Section):
    parts: tuple[Inner, ...] = Field(min_length=2)


@pytest.mark.parametrize(("entries", "count"), [([{"current_max_a": 1.0}], 1), ([{"current_max_a": 1.0}, {}], 0)])
def test_list_with_a_wrong_entry_is_not_called_too_short(entries, count):
    """pydantic counts the valid entries alone."""
    with pytest.raises(ConfigError) as error:
        validate({"parts": entries}, Pair, where="rig.toml")
    assert error.value.what.count("at least 2 items") == count


def test_table_that_a_command_writes_names_the_command(tmp_path):
    with pytest.raises(ConfigError, match="smadrive calibrate"):
        validate({"displacement": {"on": "2026-11-25", "offset_mm": 0.1}}, CalibrationConfig, "rig.toml")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('nme = "x"\nparts = []', ("nme: ", "'name'")),
        ('nme = "x"\nparts = 3', ("nme: ", "'name'", "parts: ")),
        ('nme = "x"', ("nme: ", "'name'", "parts: missing")),
        (
            'name = "x"\nparts = [{current_max_a = nan}, {}, 3]',
            ("[[parts]] 1: current_max_a: ", "[[parts]] 2: ", "parts, entry 3: "),
        ),
        ('name = "x"\nparts = []\nprats = 1', ("prats: ", "'parts'")),
        (
            'name = "x"\n[[parts]]\ncurent_max_a = 1.0\ncurrent_max_a = 1.0',
            ("[[parts]] 1: curent_max_a: ", "'current_max_a'"),
        ),
        (
            'name = "x"\n[[parts]]\ncurrent_max_a = 1.0\nname = "y"',
            ("[[parts]] 1: name: ", "known are: current_max_a", "at the beginning of the file"),
        ),
        ('one = 1\nname = "x"\nparts = []\n[two]', ("one, two: ", "name, parts")),
        ('nme = "x"\nprats = 1', ("nme: ", "'name'", "prats: ", "'parts'")),
        ('name = "x"\n[[parts]]\ncurrent_max_a = "much"', ("[[parts]] 1: current_max_a = 'much'",)),
        ('name = "x"\n[[parts]]\ncurrent_max_a = "0.15"', ("[[parts]] 1: current_max_a = '0.15'", "without quotes")),
        ('name = "x"\n[[parts]]\ncurrent_max_a = true', ("current_max_a = true",)),
        ('name = "x"\n[[parts]]\ncurrent_max_a = nan', ("[[parts]] 1: current_max_a: ", "nan")),
        ("name = ", ("TOML",)),
        ("name = " + "[\n" * 10_000, ("nested",)),
    ],
)
def test_error_names_file_and_key_in_one_line(tmp_path, text, named):
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    assert caught.value.where == str(tmp_path / "rig.toml")
    assert [part for part in named if part not in caught.value.what] == []
    assert "\n" not in str(caught.value)
    assert "more)" not in caught.value.what
    assert "name: missing" not in caught.value.what


def test_section_inside_another_one_is_no_key_for_the_beginning_of_the_file(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, 'name = "x"\n[[parts]]\ncurrent_max_a = 1.0\n[parts.parts]\ncurrent_max_a = 1.0')
    assert "[[parts]] 1: parts: unknown key; known are: current_max_a" in caught.value.what
    assert "beginning" not in caught.value.what


class Choice(StrEnum):
    ONE = "one"
    TWO = "two"


class Chosen(Section):
    choice: Choice


def test_unknown_choice_has_the_known_ones_as_its_cure():
    with pytest.raises(ConfigError, match="choice: 'three' is not allowed; write 'one' or 'two'"):
        validate({"choice": "three"}, Chosen, "rig.toml")


def test_many_problems_are_counted(tmp_path):
    numbers = (f"current_max_a = '{number}'" for number in range(20))
    parts = ", ".join(f"{{{one}}}" for one in numbers)
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, f'name = "x"\nparts = [{parts}]')
    assert caught.value.what.count("put a number there") == MOST_DESCRIBED
    assert caught.value.what.endswith(f"(and {20 - MOST_DESCRIBED} more)")


def test_byte_order_mark_is_skipped(tmp_path):
    assert load(tmp_path, '\ufeffname = "x"\nparts = []').name == "x"


def test_pipe_is_an_error_at_once(tmp_path):
    os.mkfifo(tmp_path / "rig.toml")
    with pytest.raises(ConfigError) as caught:
        load_config(tmp_path / "rig.toml", Outer)
    assert caught.value.where == str(tmp_path / "rig.toml")
    assert "a pipe" in caught.value.what


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load_config(tmp_path / "absent.toml", Outer)
    assert caught.value.where == str(tmp_path / "absent.toml")


@pytest.mark.parametrize(
    "text",
    [
        "a." * 500_000 + "a = 1",
        "name = 'x'\n" * 100_000,
        "name = " + "9" * 5000,
        "name = 0x" + "f" * 500,
        "parts = [{current_max_a = 0x1" + "f" * 500 + "}]",
        "parts = [{current_max_a = 1" + "0" * 400 + "}]",
        'name = "a"\nname = "b"',
    ],
)
def test_file_out_of_bounds_is_rejected_at_once(tmp_path, text):
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    assert len(str(caught.value)) < 600


def test_path_with_a_null_character_is_rejected(tmp_path):
    with pytest.raises(ConfigError):
        read_toml(tmp_path / "a\0b.toml")


class Bounded(Section):
    current_max_a: float = Field(gt=0)
    rate_hz: int = Field(ge=1, le=100)
    plan: Literal["nested", "forc"]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('current_max_a = -0.6\nrate_hz = 20\nplan = "forc"', ("current_max_a", "-0.6", "greater than 0")),
        ('current_max_a = nan\nrate_hz = 20\nplan = "forc"', ("current_max_a", "nan", "finite")),
        ('current_max_a = 0.6\nrate_hz = 0\nplan = "forc"', ("rate_hz", "0", "1 or more")),
        ('current_max_a = 0.6\nrate_hz = 300\nplan = "forc"', ("rate_hz", "300", "100 or less")),
        ('current_max_a = 0.6\nrate_hz = 1.5\nplan = "forc"', ("rate_hz", "1.5", "whole number")),
        ('current_max_a = 0.6\nrate_hz = 20\nplan = "fork"', ("plan", "fork", "'nested' or 'forc'")),
        ("rate_hz = 20", ("current_max_a, plan", "missing", "smadrive list")),
    ],
)
def test_wrong_value_is_named_with_its_limit_and_the_cure(tmp_path, text, named):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as refused:
        load_config(path, Bounded)
    assert all(part in str(refused.value) for part in named)
    assert "Input should" not in str(refused.value)
