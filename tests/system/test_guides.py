"""The guides: every command in them runs, in their order, on the files that they have the reader write."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GUIDES = sorted((ROOT / "docs").glob("*.md"))
BLOCK = re.compile(r"```(\w+)(?: (\S+))?\n(.*?)```", re.DOTALL)
"""Language, name of the file that the reader is to write (if one), content."""

PROMISED = {
    "first-wire": ("first-heat.html", "wire.json", "run.h5", "run.html", "run.csv", "steps.h5"),
    "records": ("run.html", "run.csv", "other.json"),
}
"""What the reader has at the end."""


def steps(guide):
    """The files and commands of a guide, in the order of its text."""
    for language, name, content in BLOCK.findall(guide.read_text()):
        if name:
            yield "write", name, content
        elif language == "console":
            yield from (("run", line.removeprefix("$ "), "") for line in content.splitlines() if line.startswith("$ "))


@pytest.mark.timeout(600)
@pytest.mark.parametrize("guide", [guide for guide in GUIDES if any(steps(guide))], ids=lambda guide: guide.stem)
def test_a_reader_who_follows_the_guide_gets_through(guide, tmp_path):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for kind, what, content in steps(guide):
        if kind == "write":
            (tmp_path / what).write_text(content)
            continue
        done = subprocess.run(
            shlex.split(what),
            cwd=tmp_path,
            env={**os.environ, "PATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{what}\n{done.stdout}{done.stderr}"
    for promised in PROMISED[guide.stem]:
        assert (tmp_path / promised).stat().st_size > 0


@pytest.mark.parametrize("guide", GUIDES, ids=lambda guide: guide.stem)
def test_every_link_leads_somewhere_and_the_readme_leads_to_every_guide(guide):
    for link in re.findall(r"\]\((?!http)([^)#]+)\)", BLOCK.sub("", guide.read_text())):
        assert (guide.parent / link).exists(), link
    assert f"(docs/{guide.name})" in (ROOT / "README.md").read_text()
