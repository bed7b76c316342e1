"""The command is the first word after `smadrive`. No other command can be executed."""

import pytest

from smadrive.cli.parsing.app import COMMANDS, COMPLETING, command_line, typed_command
from smadrive.errors import ConfigError


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        (["off", "rig.toml"], "off"),
        (["--", "off", "rig.toml"], "off"),
        (["--version"], "--version"),
        (["--"], ""),
        ([], ""),
    ],
)
def test_command_is_the_first_word(arguments, command):
    assert typed_command(arguments, {}) == command


def test_command_is_the_first_word_of_the_line_to_be_completed():
    assert typed_command([], {COMPLETING: "complete_bash", "COMP_WORDS": "smadrive off --"}) == "off"


@pytest.mark.parametrize("arguments", [["list"], ["--", "list"]])
def test_command_is_executed_also_after_a_double_dash(arguments, capsys):
    command_line(typed_command(arguments, {}))(arguments, standalone_mode=False)
    assert "simulated" in capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_command_that_is_not_imported_does_not_end_as_done(name):
    with pytest.raises(ConfigError) as error:
        command_line("")([name], standalone_mode=False)
    assert error.value.exit_code == 2
