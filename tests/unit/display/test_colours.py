"""The palette: one colour for one meaning, also in the files that only a browser reads."""

import re
from importlib.resources import files

import pytest

from smadrive.control.references.shapes import sine
from smadrive.display import colours
from smadrive.display.line_plot import INK

LEGEND = re.compile(r"\.(\w+) \{ --c:(#[0-9a-f]{6}); \}")
"""A class of the legends in the template of the tuning page, with its colour."""


@pytest.mark.parametrize("meaning", ["setpoint", "measured", "estimated", "heating", "cooling", "limit"])
def test_legend_of_the_tuning_page_has_the_colours_of_its_plots(meaning):
    template = files("smadrive.tuning.page.view").joinpath("page.html").read_text(encoding="utf-8")
    assert dict(LEGEND.findall(template))[meaning] == getattr(colours, f"PAGE_{meaning.upper()}")


def test_setpoint_of_a_reference_is_not_drawn_in_the_colour_of_measured_values():
    html = sine(low_mm=2.0, high_mm=9.0, period_s=56.0)._repr_html_()
    assert colours.MEASURED not in html
    assert f"stroke='{INK}' fill='none'" in html


def test_every_run_has_a_colour_of_its_own():
    assert len(set(colours.RUN_COLOURS)) == len(colours.RUN_COLOURS)
