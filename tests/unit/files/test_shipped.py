"""A shipped file is found by its name; an error for another name suggests the nearest one."""

import pytest

from smadrive.errors import ConfigError
from smadrive.files.kinds import PROFILE, RIG, SIM, WIRE
from smadrive.files.shipped import config_file, configs_dir


def test_name_and_path_are_found():
    shipped = configs_dir() / "rigs" / "simulated.toml"
    assert config_file("simulated", RIG) == config_file(shipped, RIG) == shipped
    assert config_file("absent.toml", RIG).name == "absent.toml"


@pytest.mark.parametrize("name", ["", " "])
def test_empty_name_is_an_error_that_says_which_file_is_missing(name):
    with pytest.raises(ConfigError) as caught:
        config_file(name, RIG)
    assert caught.value.where == RIG.what
    assert "simulated" in caught.value.cure


@pytest.mark.parametrize(
    ("name", "expected", "hint"),
    [
        ("simulatd", RIG, "'simulated'"),
        ("flexinol", WIRE, "'flexinol-lt-0.15mm'"),
        ("sma-referense", PROFILE, "'sma-reference'"),
        ("flexinol-0.15mm", SIM, "'flexinol-lt-0.15mm'"),
        ("sma-reference", RIG, "a device profile"),
        ("nothing", RIG, ""),
    ],
)
def test_unknown_name_is_an_error_with_the_shipped_names_and_a_hint(name, expected, hint):
    with pytest.raises(ConfigError) as caught:
        config_file(name, expected)
    error = caught.value
    assert error.where == f"'{name}'"
    assert hint in error.cure
    assert bool(hint) == bool(error.cure)
    assert error.value == ", ".join(sorted(file.stem for file in (configs_dir() / expected.folder).glob("*.toml")))
