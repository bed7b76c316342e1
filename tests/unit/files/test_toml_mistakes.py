"""Frequent mistakes in a TOML file are named with value and cure."""

import pytest

from smadrive.errors import ConfigError
from smadrive.files.config import read_toml


@pytest.mark.parametrize(
    ("line", "what", "value", "cure"),
    [
        ("a = 20,0", "a number has a decimal comma", "20,0", "write 20.0"),
        ("a = -0,5  # A", "a number has a decimal comma", "-0,5", "write -0.5"),
        ('a = "bench', "a quote is missing", 'a = "bench', "put the text between two quotes of one kind"),
        ("a = 'bench", "a quote is missing", "a = 'bench", "put the text between two quotes of one kind"),
        ("a = bench'", "a quote is missing", "a = bench'", "put the text between two quotes of one kind"),
        ("a = 'bench\"", "a quote is missing", "a = 'bench\"", "put the text between two quotes of one kind"),
        ("a = my bench", "a text has no quotes", "my bench", 'write "my bench"'),
        ("a = ./wire.json", "a text has no quotes", "./wire.json", 'write "./wire.json"'),
        ("name = 1", "a key is given twice", "name = 1", "keep one of the two lines"),
        ("on = 5.11.2026", "a date has another form", "5.11.2026", "write 2026-11-05 (year-month-day)"),
        ("a = True", "a truth value has a capital letter", "True", "write true"),
    ],
)
@pytest.mark.parametrize("rest", ["", "[limits]\nb = 'text'\n"])
def test_mistake_is_named_with_its_line_value_and_cure(tmp_path, line, what, value, cure, rest):
    path = tmp_path / "rig.toml"
    path.write_text(f'name = "it\'s # one"\n{line}\n{rest}')
    with pytest.raises(ConfigError) as caught:
        read_toml(path)
    error = caught.value
    assert (error.where, error.what, error.value, error.cure) == (f"{path}, line 2", what, value, cure)


@pytest.mark.parametrize("line", ["a = 1.2.3", "a", "[x", "a = [1,2", "a = 5.", 'a = "C:\\data"', "a ="])
def test_other_mistakes_keep_the_message_of_the_parser(tmp_path, line):
    (tmp_path / "rig.toml").write_text(f"{line}\n")
    with pytest.raises(ConfigError, match="not valid TOML"):
        read_toml(tmp_path / "rig.toml")
