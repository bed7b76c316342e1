"""The files, folders and links that docs/architecture.md and the other pages name exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "docs" / "architecture.md").read_text()
PROSE = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
PLACES = (ROOT, ROOT / "smadrive")
"""Folders to which paths in the page are relative."""

SUBJECTS = re.findall(r"^\| `([\w/]+)` \| (.*) \|$", PROSE, re.MULTILINE)
"""The rows of the table of folders. The second column names subfolders of the folder in the first column."""

QUOTED = re.findall(r"`([^`\s]+)`", "\n".join(line for line in PROSE.splitlines() if not line.startswith("| `")))
PATHS = sorted(
    {text for text in QUOTED if ("/" in text or text.endswith((".py", ".md", ".toml"))) and "NAME" not in text}
)
HOME = "~"


def exists(path):
    return any((place / path).exists() for place in PLACES) or bool(list(ROOT.glob(f"smadrive/**/{path}")))


def test_the_page_names_paths():
    assert len(PATHS) > 30
    assert len(SUBJECTS) > 10


@pytest.mark.parametrize("path", [path for path in PATHS if not path.startswith(HOME)])
def test_path_exists(path):
    assert exists(path)


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=lambda page: page.stem)
def test_paths_of_the_project_in_the_page_exist(page):
    named = re.findall(r"`((?:smadrive|firmware_sim|tests|configs)/[^`\s]*)`", page.read_text())
    assert [path for path in named if not (ROOT / path).exists()] == []


@pytest.mark.parametrize(("folder", "subjects"), SUBJECTS)
def test_subfolders_exist(folder, subjects):
    missing = [name for name in re.findall(r"`([\w/]+/)`", subjects) if not (ROOT / folder / name).is_dir()]
    assert (ROOT / folder).is_dir()
    assert not missing


@pytest.mark.parametrize("link", re.findall(r"\]\((?!http)([^)#]+)\)", TEXT))
def test_link_exists(link):
    assert (ROOT / "docs" / link).exists()
