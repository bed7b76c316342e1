"""Executes the notebooks of the documentation, and stores their outputs: `python tests/notebooks.py`.

A stored output must not depend on the machine: execution counts, times and identifiers of messages are left out.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
TIMEOUT_S = 600
"""A hang guard for a cell, no bound."""


def executed(notebook, folder):
    """The notebook with the outputs of a new execution in `folder`. CellExecutionError when a cell raises."""
    content = nbformat.read(notebook, as_version=4)
    resources = {"metadata": {"path": str(folder)}}
    NotebookClient(content, timeout=TIMEOUT_S, kernel_name="python3", resources=resources).execute()
    return cleaned(content)


def cleaned(content):
    """The notebook without what differs from one execution to the next."""
    content.metadata = {key: content.metadata[key] for key in ("kernelspec", "language_info")}
    content.metadata["language_info"] = {"name": "python"}
    for cell in content.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.execution_count = None
            for output in cell.outputs:
                output.pop("transient", None)
                if "execution_count" in output:
                    output.execution_count = None
                if "data" in output and "image/svg+xml" in output.data:
                    output.data = {"image/svg+xml": output.data["image/svg+xml"]}
    return content


def main(target):
    """Execute every notebook, each in a folder of its own, and write it into the folder `target`."""
    for notebook in NOTEBOOKS:
        with TemporaryDirectory() as folder:
            nbformat.write(executed(notebook, folder), target / notebook.name)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
