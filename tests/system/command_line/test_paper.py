"""The repeated simulation of the paper has errors within the stated bounds."""

import json
import sys

import programs
import pytest

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    command = [sys.executable, "-m", "smadrive", "paper", "--json", "-o", folder]
    done = programs.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder, {row["name"]: row for row in json.loads(done.stdout)["errors"]}


def test_derived_model_lies_in_the_published_band(paper):
    _, errors = paper
    for loop in ("major", "mixed"):
        low, high = errors["derived, uniform sets"][loop]
        assert -1.2 <= low < high <= 1.0


@pytest.mark.parametrize(
    ("name", "most_percent"), [("identified, uniform sets", 0.5), ("identified, fitted sets", 0.15)]
)
def test_identified_rules_hold_on_a_hundred_unseen_loops(paper, name, most_percent):
    _, errors = paper
    assert errors[name]["unseen_percent"][1] <= most_percent


def test_report_has_the_figures_and_both_versions_of_the_table(paper):
    folder, _ = paper
    page = (folder / "report.html").read_text()
    for figure in ("3, 6, 7", "4, 5", "8, 9", "10, 11", "12, 13"):
        assert f"<h2>Figures {figure}</h2>" in page
    assert "Table 1 as printed" in page
    assert "IF v is about" in page
