"""The guide to Python and its notebooks: every snippet runs, every notebook executes, stored outputs are portable."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import smadrive

ROOT = Path(__file__).parents[3]
GUIDE = (ROOT / "docs" / "python.md").read_text()
SNIPPETS = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))

MOST_LINES = 15
MOST_BYTES = 400_000
PRIVATE = re.compile(
    rf"{re.escape(str(ROOT))}|/tmp/|/home/|site-packages| at 0x|\bpid\b|image/png",
    re.IGNORECASE,
)
"""Texts that reveal the machine or one run on it, and images that are not drawings."""


def run(script, folder):
    (folder / "script.py").write_text(script)
    command = [sys.executable, "-W", "error", "script.py"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def outputs(notebook):
    """For each output of each cell its type, and the types of its data."""
    import nbformat  # here, because every test process imports this file

    cells = nbformat.read(notebook, as_version=4).cells
    return [
        (number, output.output_type, sorted(output.get("data", {})))
        for number, cell in enumerate(cells)
        for output in cell.get("outputs", ())
    ]


@pytest.mark.exhaustive
def test_the_whole_way_takes_few_lines(tmp_path):
    whole = SNIPPETS[0]
    assert len([line for line in whole.splitlines() if line.strip()]) <= MOST_LINES
    done = run(whole, tmp_path)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "")
    made = {path.name for path in tmp_path.iterdir()}
    assert made == {"script.py", "excitation.h5", "sine.h5", "hold.h5", "sine.png", "hold.png"}


@pytest.mark.exhaustive
def test_all_snippets_run_one_after_the_other(tmp_path):
    assert len(SNIPPETS) > 8
    done = run("".join(SNIPPETS), tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    printed = done.stdout
    for part in ("OpenRig(", "Measurement(", "Wire(", "% RMS", "0 trips", "°C, ", "in update", "ZeroDivisionError"):
        assert part in printed
    assert "reference: period_s: not positive (-56). Write a number above 0. 2" in printed


@pytest.fixture(scope="module")
def executed(once_per_run):
    """The folder of the notebooks with the outputs of a new execution."""

    def make(folder):
        command = [sys.executable, str(ROOT / "tests" / "notebooks.py"), str(folder)]
        subprocess.run(command, check=True, capture_output=True)

    return once_per_run("notebooks", make)


@pytest.mark.exhaustive
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_notebook_executes_with_its_stored_outputs(notebook, executed):
    assert outputs(executed / notebook.name) == outputs(notebook)
    assert len(outputs(notebook)) > 8


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_stored_outputs_are_small_and_name_no_machine(notebook):
    text = notebook.read_text()
    assert len(text) < MOST_BYTES
    assert PRIVATE.findall(text) == []
    counts = re.findall(r'"execution_count": (\S+?),?\n', text)
    assert set(counts) == {"null"}
    assert "image/svg+xml" in text


@pytest.mark.parametrize("name", smadrive.__all__)
def test_guide_names_every_public_name(name):
    assert f"`{name}`" in GUIDE or f"`{name}." in GUIDE


def test_guide_links_every_notebook():
    assert {f"(notebooks/{notebook.name})" for notebook in NOTEBOOKS} <= set(re.findall(r"\(notebooks/\S+?\)", GUIDE))
