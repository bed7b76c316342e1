"""The length of a run in words."""

import pytest

from smadrive.cli.terminal.output import Output
from smadrive.cli.views.announcement import announce, duration_text
from smadrive.clock import MonotonicClock, VirtualClock


@pytest.mark.parametrize(
    ("duration_s", "text"),
    [(0.0, "0 s"), (45.2, "45 s"), (59.7, "1 min 0 s"), (243.0, "4 min 3 s"), (7500.0, "2 h 5 min")],
)
def test_duration_has_the_digits_that_matter(duration_s, text):
    assert duration_text(duration_s) == text


@pytest.mark.parametrize(
    ("duration_s", "clock", "line"),
    [
        (243.0, MonotonicClock(), "l.h5: the run takes 4 min 3 s"),
        (243.0, VirtualClock(), "l.h5: the run takes 4 min 3 s of virtual time"),
        (float("inf"), MonotonicClock(), "l.h5: the run continues until q or Ctrl-C"),
    ],
)
def test_length_of_a_run_is_announced(capsys, duration_s, clock, line):
    announce(Output(as_json=False), "l.h5", "the run", duration_s, clock)
    announce(Output(as_json=True), "l.h5", "the run", duration_s, clock)
    assert capsys.readouterr().out == f"{line}\n"
