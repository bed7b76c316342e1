"""Every error in a config file is one line that names file, key and cure."""

import os

import pytest

from smadrive.errors import ConfigError
from smadrive.files.config import Section, load_config, read_toml


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
    with pytest.raises(Exception, match="frozen"):
        config.name = "y"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('nme = "x"\nparts = []', r"rig.toml: nme: unknown key; did you mean 'name'\? \(and 1 more\)"),
        ('name = "x"\nparts = []\nprats = 1', "prats: unknown key; did you mean 'parts'?"),
        ('name = "x"\n[[parts]]\ncurent_max_a = 1.0\ncurrent_max_a = 1.0', "did you mean 'current_max_a'"),
        ('one = 1\nname = "x"\nparts = []\n[two]', "one, two: unknown key; known are: name, parts$"),
        ('nme = "x"\nprats = 1', "nme: unknown key; did you mean 'name'.; prats: unknown key; did you mean 'parts'."),
        ('name = "x"\n[[parts]]\ncurrent_max_a = "much"', "parts.0: current_max_a = 'much': put a number there"),
        (
            'name = "x"\n[[parts]]\ncurrent_max_a = "0.15"',
            "parts.0: current_max_a = '0.15': put a number there, without quotes",
        ),
        ('name = "x"\n[[parts]]\ncurrent_max_a = true', "current_max_a = True: put a number there"),
        ('name = "x"\n[[parts]]\ncurrent_max_a = nan', "finite number"),
        ("name = ", "not valid TOML"),
        ("name = " + "[\n" * 10_000, "rig.toml: nested too deeply for a config file"),
    ],
)
def test_error_names_the_key(tmp_path, text, named):
    with pytest.raises(ConfigError, match=named) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_byte_order_mark_is_skipped(tmp_path):
    assert load(tmp_path, '\ufeffname = "x"\nparts = []').name == "x"


def test_pipe_is_an_error_at_once(tmp_path):
    os.mkfifo(tmp_path / "rig.toml")
    with pytest.raises(ConfigError, match="a pipe") as caught:
        load_config(tmp_path / "rig.toml", Outer)
    assert caught.value.where == str(tmp_path / "rig.toml")


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
def test_file_out_of_bounds_is_refused_at_once(tmp_path, text):
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    assert len(str(caught.value)) < 600


def test_path_with_a_null_character_is_refused(tmp_path):
    with pytest.raises(ConfigError):
        read_toml(tmp_path / "a\0b.toml")
