"""Campaign files of short tracking runs on a wire that is known exactly."""

from pathlib import Path

import pytest
from exact_wire import exact_wire

from smadrive.campaigns.plan.plan import load_plan

SHORT = """
title = "short runs"
seed = 7
[run]
{model}
reference = "up"
{run}
[[vary]]
random_wires = 2
{vary}
[references.up]
shape = "trapezoid:rise_s=3,dwell_s=1,cycles=0.5"
smooth = false
{more}
"""


@pytest.fixture
def short_campaign(tmp_path):
    """`short_campaign(run="", vary="", more="")` is the plan of a campaign with two random wires or more runs.

    Without `model`, each run excites and identifies its wire.
    """
    exact_wire().save(tmp_path / "wire.json")

    def plan(run="", vary="", more="", model='model = "wire.json"', name="campaign.toml"):
        path = Path(tmp_path / name)
        path.write_text(SHORT.format(model=model, run=run, vary=vary, more=more), encoding="utf-8")
        return load_plan(str(path))

    return plan
