"""Every command of the guides runs, in the order of the guide, with the files that the guide tells the reader to write.

A guide that continues another one runs in the same folder. A command that ends in `&` runs until the last guide of the
folder has ended. Ports are private to this test, so several tests may run on one machine.
"""

import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path

import programs
import pytest

ROOT = Path(__file__).parents[3]
GUIDES = sorted((ROOT / "docs").glob("*.md"))
BLOCK = re.compile(r"```(\w+)(?: (\S+))?\n(.*?)```", re.DOTALL)
"""Pattern of a block of code: its language, the name of the file that the reader writes (optional), its content."""

WALKS = (("first-wire", "records", "tuning"), ("bench-supply",), ("campaigns",))
"""Guides that a reader follows one after the other in one folder."""

PROMISED = {
    "first-wire": ("first-heat.html", "wire.json", "run.h5", "run.html", "run.csv", "steps.h5"),
    "records": ("run.html", "run.csv", "other.json", "run-columns.csv"),
    "tuning": ("tuned-rig.toml",),
    "bench-supply": ("bench.h5", "bench.json", "bench-run.html"),
    "campaigns": ("noise/results.parquet", "noise/report.html"),
}
"""The files that exist at the end of each guide."""


def steps(text):
    """Return the files and commands of a guide, in the order of its text."""
    for language, name, content in BLOCK.findall(text):
        if name:
            yield "write", name, content
        elif language == "console":
            yield from (("run", line.removeprefix("$ "), "") for line in content.splitlines() if line.startswith("$ "))


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def run(command, **options):
    """Run a command to its end. smadrive is imported before, except for a command in the background."""
    captured = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    if command[0] == "smadrive":
        return programs.run([sys.executable, "-m", *command], **captured, **options)
    return subprocess.run(command, check=False, **captured, **options)


@contextmanager
def in_the_background(command, **options):
    """Start a command in the background and wait for its first line, which names its address. Ctrl-C ends it."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options) as process:
        assert process.stdout.readline(), process.communicate()
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)
            output = process.communicate()
    assert process.returncode in {0, 130}, output
    assert "Traceback" not in output[1]


@pytest.mark.exhaustive
@pytest.mark.parametrize("walk", WALKS, ids="-".join)
def test_commands_of_the_guides_run(walk, tmp_path):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    options = {"cwd": tmp_path, "env": {**os.environ, "PATH": path}}
    own = {"/tmp/": f"{tmp_path}/", "5006": str(free_port())}  # noqa: S108
    with ExitStack() as background:
        for guide in walk:
            text = (ROOT / "docs" / f"{guide}.md").read_text()
            for shared, ours in own.items():
                text = text.replace(shared, ours)
            for kind, what, content in steps(text):
                if kind == "write":
                    (tmp_path / what).write_text(content)
                elif what.endswith(" &"):
                    background.enter_context(in_the_background(shlex.split(what[:-2]), **options))
                else:
                    done = run(shlex.split(what), **options)
                    assert done.returncode == 0, f"{what}\n{done.stdout}{done.stderr}"
            for promised in PROMISED[guide]:
                assert (tmp_path / promised).stat().st_size > 0


def test_every_guide_with_commands_is_tested():
    busy = {guide.stem for guide in GUIDES if any(steps(guide.read_text()))}
    assert {guide for walk in WALKS for guide in walk} == busy


@pytest.mark.parametrize("guide", GUIDES, ids=lambda guide: guide.stem)
def test_links_exist_and_the_readme_links_every_guide(guide):
    for link in re.findall(r"\]\((?!http)([^)#]+)\)", BLOCK.sub("", guide.read_text())):
        assert (guide.parent / link).exists(), link
    assert f"(docs/{guide.name})" in (ROOT / "README.md").read_text()
