"""A rig whose loop reads the temperature so seldom that the wire can overheat between two readings."""

import pytest

from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.errors import ConfigError
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig


def slow_rig(name, device_rates_hz=None, rate_hz=0.5):
    """Return the shipped rig on simulated devices, with a slow loop and with other rates of its sensors."""
    document = load_rig(name).at("sim://flexinol-lt-0.15mm").model_dump(exclude_none=True, exclude={"feedback"})
    document["rate_hz"] = rate_hz
    document["limits"] |= {"watchdog_s": 10.0}
    for device in document["devices"]:
        if device["name"] in (device_rates_hz or {}):
            device["rate_hz"] = device_rates_hz[device["name"]]
    return Rig(RigConfig.model_validate(document))


def heat(rig):
    return rig.drive(ConstantCurrentController(0.05, 6.0), rig.nominal_balance, lambda _tick: None)


@pytest.mark.parametrize(
    ("name", "device_rates_hz"),
    [("tclab", {}), ("bench-supply", {}), ("bench-supply", {"thermometer": 10.0})],
    ids=["source measures", "thermometer", "fast thermometer"],
)
def test_loop_that_reads_the_temperature_too_seldom_is_refused(name, device_rates_hz):
    with pytest.raises(ConfigError) as refused, slow_rig(name, device_rates_hz) as rig:
        heat(rig)
    assert refused.value.where == f"rig '{rig.config.name}'"
    assert refused.value.value == "read every 2 s"
    assert float(refused.value.limit.removesuffix(" s")) < 2.0


@pytest.mark.parametrize(("rate_hz", "is_refused"), [(2.0, True), (10.0, False)])
def test_loop_in_which_the_wire_gets_far_beyond_its_limit_is_refused(rate_hz, is_refused):
    with slow_rig("tclab", rate_hz=rate_hz) as rig:
        if is_refused:
            with pytest.raises(ConfigError) as refused:
                heat(rig)
            assert refused.value.limit == "60 K"
        else:
            assert heat(rig).trips == 0


def test_board_that_limits_the_temperature_itself_may_be_read_seldom():
    with slow_rig("in-process") as rig:
        assert heat(rig).trips == 0
