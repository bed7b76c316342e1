"""The README: its code runs, its files exist, its commands exist."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from smadrive.cli.parsing.app import COMMANDS

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


def test_there_are_exactly_two_set_up_commands():
    assert blocks("sh") == [
        ".ci/setup && .venv/bin/smadrive demo\n",
        ".ci/setup test && .venv/bin/pytest\n",
    ]


@pytest.mark.exhaustive
def test_library_example_runs():
    (example,) = blocks("python")
    done = subprocess.run([sys.executable, "-W", "error", "-c", example], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "22 rules" in done.stdout
    assert "certified: True" in done.stdout
    assert "all reachable: True" in done.stdout


@pytest.mark.exhaustive
def test_script_with_a_rig_runs(tmp_path):
    (example,) = blocks("py")
    (tmp_path / "script.py").write_text(example)
    command = [sys.executable, "-W", "error", "script.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("% RMS of the stroke\n")


@pytest.mark.parametrize("link", re.findall(r"\]\((?!http)([^)#]+)\)", TEXT))
def test_link_exists(link):
    assert (ROOT / link).exists()


def test_every_command_of_the_session_exists_and_is_explained():
    used = set(re.findall(r"\.venv/bin/smadrive ([a-z]+)", TEXT))
    explained = set(re.findall(r"^\| `([a-z]+)|, `([a-z]+) MODEL", TEXT, re.MULTILINE))
    assert used <= set(COMMANDS)
    assert {name for pair in explained for name in pair if name} == set(COMMANDS)


def test_rigs_of_the_session_are_shipped():
    for name in set(re.findall(r"smadrive (?:probe|excite|run|off) ([a-z-]+)", TEXT)):
        assert (ROOT / "configs" / "rigs" / f"{name}.toml").is_file()
