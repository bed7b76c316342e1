"""The texts of the tuning page."""

import pytest

from smadrive.tuning.page.panel import scores_html


@pytest.mark.parametrize(("scored", "text"), [(0, "not scored"), (1, "RMS, 1 turn<"), (2, "RMS, 2 turns<")])
def test_turns_of_a_comparison_are_counted(scored, text):
    mean_percent = 1.5 if scored else None
    comparison = {"scores": {slot: [mean_percent, scored] for slot in "AB"}, "slots": {}, "turn": None}
    assert scores_html(comparison).count(text) == 2
