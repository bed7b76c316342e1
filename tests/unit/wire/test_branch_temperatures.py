"""The temperatures of the branches over the displacement, for a wire that pulls and for a wire that pushes."""

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.wire.branch_temperatures import BranchTemperatures

LOOPS = [
    DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=scale, offset=1, input_range=(0, 160)
    )
    for scale in (12, -12)
]


@pytest.mark.parametrize("model", LOOPS, ids=["rising", "falling"])
def test_model_on_a_branch_has_the_displacement(model):
    branches = BranchTemperatures(model)
    for phase in np.linspace(0.05, 0.95, 19):
        y = model.offset + model.scale * phase
        for rising, temperature_c in ((True, branches.heating_c(y)), (False, branches.cooling_c(y))):
            w = model.branch(np.array([temperature_c]), rising=rising)[0]
            assert w == pytest.approx(phase, abs=1e-4)


@pytest.mark.parametrize("model", LOOPS, ids=["rising", "falling"])
def test_nearest_temperature_lies_between_the_branches_of_the_displacement(model):
    branches, y = BranchTemperatures(model), model.offset + 0.5 * model.scale
    cold_c, hot_c = branches.cooling_c(y), branches.heating_c(y)
    assert branches.nearest_c(80.0, y, 0.0) == 80.0
    assert branches.nearest_c(120.0, y, 0.0) == hot_c
    assert branches.nearest_c(20.0, y, 0.0) == cold_c
    assert branches.nearest_c(120.0, y, 0.1) > hot_c
    assert branches.nearest_c(20.0, y, 0.1) < cold_c


@pytest.mark.parametrize("beyond_mm", [0.0, 0.2])
@pytest.mark.parametrize("model", LOOPS, ids=["rising", "falling"])
def test_ends_of_the_travel_bound_the_temperature_on_one_side_only(model, beyond_mm):
    branches, sense, margin_mm = BranchTemperatures(model), np.sign(model.scale), 0.036
    cold_mm, hot_mm = model.offset - sense * beyond_mm, model.offset + model.scale + sense * beyond_mm
    assert branches.nearest_c(-20.0, cold_mm, margin_mm) == -20.0
    foot_c = branches.nearest_c(200.0, cold_mm, margin_mm)
    assert foot_c == pytest.approx(branches.heating_c(model.offset + sense * margin_mm), abs=0.1)
    assert branches.nearest_c(200.0, hot_mm, margin_mm) == 200.0
    knee_c = branches.nearest_c(-20.0, hot_mm, margin_mm)
    assert knee_c == pytest.approx(branches.cooling_c(model.offset + model.scale - sense * margin_mm), abs=0.1)
