"""The metadata of a log."""

import json
from pathlib import Path

import numpy as np
import pytest

from smadrive.runs.log.reader import Log
from smadrive.runs.run_metadata import excitation_caveats


@pytest.mark.parametrize(("ended_s", "expected"), [(200.0, ()), (197.0, ()), (76.0, ("ended after 76 of its 200 s",))])
def test_cut_experiment_has_a_caveat(ended_s, expected):
    metadata = {"excitation": json.dumps({"turning_points_c": [20.0, 120.0, 20.0], "rate_c_per_s": 1.0})}
    columns = {"time_s": np.linspace(0.0, ended_s, 100)}
    caveats = excitation_caveats(Log(Path("e.h5"), columns, metadata, (), "", "", ""))
    assert len(caveats) == len(expected)
    assert all(part in caveat for part, caveat in zip(expected, caveats, strict=True))
