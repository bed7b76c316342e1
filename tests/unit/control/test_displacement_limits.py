"""A reference beyond a displacement limit of the rig is refused before anything is heated, wherever it is given."""

from contextlib import contextmanager

import pytest
from exact_wire import exact_wire

from smadrive.campaigns.experiments.references import planned_reference
from smadrive.campaigns.plan.config import ReferenceConfig
from smadrive.control.references.shapes import parse_reference
from smadrive.errors import ConfigError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.tracking_plan import plan_tracking
from smadrive.tuning.tuning import Tuning
from smadrive.wire.wire_model import WireModel

SINE = "sine:low_mm=2,high_mm=9,period_s=20,cycles=1"
WIRE = exact_wire()
LIMITS = pytest.mark.parametrize("limit", [{"displacement_max_mm": 5.0}, {"displacement_min_mm": 3.0}])


def limited(limit):
    config = load_rig("in-process")
    return config.model_copy(update={"limits": config.limits.model_copy(update=limit)})


@contextmanager
def refused(limit):
    with pytest.raises(ConfigError) as error:
        yield
    assert (error.value.limit or "").startswith(next(iter(limit)))


@LIMITS
def test_run_is_refused(limit):
    with Rig(limited(limit)) as rig, refused(limit):
        plan_tracking(rig, parse_reference(SINE), WIRE, smooth=True, smooth_option="--smooth")


@LIMITS
def test_reference_of_the_tuning_page_is_refused(limit):
    config = limited(limit)
    tuning = Tuning.of(WIRE.model, config.feedback, "as loaded")
    with refused(limit):
        tuning.check(config.limits, parse_reference(SINE))
    tuning.check(config.limits, parse_reference("sine:low_mm=3,high_mm=5,period_s=20"))


@LIMITS
def test_reference_of_a_campaign_is_refused(limit):
    wire = WireModel(WIRE.model, WIRE.heat_balance, None)
    with refused(limit):
        planned_reference(ReferenceConfig(shape=SINE, smooth=False), wire, limited(limit))
