"""The help of every command: placeholders in capital letters, flags without a value, examples; and completion."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import programs
import pytest
from typer.main import get_command

from smadrive.cli.parsing.app import COMMANDS, MODULES, command_line, typed_command
from smadrive.cli.parsing.usage import EXAMPLES
from smadrive.files.shipped import configs_dir

ROOT = Path(__file__).parents[3]


def printed(*arguments):
    command = [sys.executable, "-m", "smadrive", *arguments]
    return programs.run(
        command, capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "120"}
    ).stdout


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_shows_no_types_of_python(name):
    text = printed(*name.split(), "--help")
    assert not re.search(r"<\w+( range)?>|\{[a-z]+\}", text)
    assert re.search(r"--help +Show this message", text)


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_of_a_command_are_shown_and_understood(name):
    text = " ".join(printed(name, "--help").split())
    command = get_command(command_line(name)).commands[name]
    for example in EXAMPLES[name]:
        assert f"Example: {example}" in text
        program, called, *arguments = example.split()
        assert (program, called) == ("smadrive", name)
        command.make_context(name, arguments)


def test_every_module_of_the_map_exists():
    for name in COMMANDS:
        assert (ROOT / "smadrive" / "cli" / f"{MODULES.get(name, name)}.py").is_file()


def test_list_names_every_shipped_file():
    listed = json.loads(printed("list", "--json"))
    for kind in ("rigs", "wires", "devices", "sims"):
        files = {path.stem: str(path) for path in (configs_dir() / kind).glob("*.toml")}
        assert {one["name"]: one["file"] for one in listed[kind]} == files
        assert all(20 < len(one["what"]) < 200 and "Sources" not in one["what"] for one in listed[kind])
    text = printed("list")
    assert all(one["name"] in text for of_kind in listed.values() for one in of_kind)


@pytest.mark.parametrize(
    ("arguments", "environment", "command"),
    [
        (["off", "rig.toml"], {}, "off"),
        ([], {}, ""),
        ([], {"_SMADRIVE_COMPLETE": "complete_bash", "COMP_WORDS": "smadrive run --re"}, "run"),
        ([], {"_SMADRIVE_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "smadrive identify "}, "identify"),
        ([], {"_SMADRIVE_COMPLETE": "complete_bash", "COMP_WORDS": "smadrive "}, ""),
    ],
)
def test_command_is_found_in_the_line_that_is_typed(arguments, environment, command):
    assert typed_command(arguments, environment) == command


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("words", "place", "offered"),
    [("smadrive re", 1, {"replay", "report"}), ("smadrive run --re", 2, {"--reference", "--repeat", "--resume"})],
)
def test_shell_completes_commands_and_options(words, place, offered):
    script = "import sys; sys.argv = ['smadrive']; from smadrive.cli import main; main()"
    shell = {"_SMADRIVE_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(place)}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, env={**os.environ, **shell}
    )
    assert set(done.stdout.split()) == offered, done.stderr
