"""A new connection may lead to another device, so the device must prove its identity again."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.devices.device import Device
from smadrive.devices.identity import UNKNOWN
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeadlineError, DeviceError, IdentityError, ReadBackError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.in_process import InProcessTransport

READS = (1, 2, 3, 4)


class Hub:
    """The far end of a port, to which another device may be connected. Records the functions of the requests."""

    def __init__(self, clock, profile):
        self.clock = clock
        self.profile = profile
        self.heard = []
        self.device = self.plug(serial_number=1)

    def plug(self, serial_number, profile=None):
        """Connect a new device, which has its own simulated bench."""
        config = load_sim("flexinol-lt-0.15mm")
        board = config.board.model_copy(update={"serial_number": serial_number})
        self.device = simulated_device(
            config.model_copy(update={"board": board}), seed=1, profile=profile or self.profile
        )
        self.clock.follow(self.device.bench.advance_to)
        self.heard.clear()
        return self.device

    def receive(self, data, time_s):
        self.heard.append(data[1])
        return self.device.line.receive(data, time_s)


PROFILES = ("sma-reference", "riden-rd60xx:model_id=60121")


@pytest.fixture(params=PROFILES)
def hub(request, clock):
    return Hub(clock, load_profile(request.param))


@pytest.fixture
def device(hub, clock):
    device = Device(load_profile(hub.profile.profile.id), ModbusClient(InProcessTransport(hub, clock)))
    device.check_identity()
    return device


def uses(device):
    name = device.profile.role("heater_current")
    yield lambda: device.write(name, 0.0)
    yield lambda: device.command(name, 0.0, (name,))
    yield lambda: device.read((name,))
    yield device.enter_safe_state
    if device.profile.profile.role == "heater":
        yield lambda: device.exchange({"sequence": 0x107}, ("state",))


def test_nothing_is_written_to_a_twin_at_the_same_port(hub, device):
    for use in uses(device):
        hub.plug(serial_number=2)
        device.client.transport.disconnect()
        with pytest.raises(IdentityError) as error:
            use()
        assert error.value.value == "serial_number = 2, was 1"
        assert hub.heard
        assert set(hub.heard) <= set(READS)


def test_twin_behind_a_connection_that_stays_open_is_not_confirmed_off(hub, device):
    """The RS-485 plug was moved during one exchange, so no reply was lost."""
    device.write(device.profile.role("heater_current"), 0.0)
    hub.plug(serial_number=2)
    with pytest.raises(IdentityError) as error:
        device.enter_safe_state()
    assert error.value.value == "serial_number = 2, was 1"


def test_nothing_is_written_to_a_twin_after_a_lost_reply(hub, device):
    for use in uses(device):
        hub.device.faults.drop(for_s=60.0)
        with pytest.raises(DeadlineError):
            device.read((device.profile.role("measured_current"),))
        hub.plug(serial_number=2)
        with pytest.raises(IdentityError):
            use()
        assert set(hub.heard) <= set(READS)
        hub.plug(serial_number=1)
        device.check_identity()


@pytest.mark.parametrize("hub", ["riden-rd60xx:model_id=60121"], indirect=True)
def test_nothing_is_written_to_a_twin_after_a_wrong_read_back(hub, device):
    name = device.profile.role("heater_current")
    device.command(name, 0.3, (name,))
    hub.plug(serial_number=2)
    with pytest.raises(ReadBackError):
        device.command(name, 0.3, (name,))
    hub.heard.clear()
    with pytest.raises(IdentityError):
        device.enter_safe_state()
    assert set(hub.heard) <= set(READS)


def test_nothing_is_written_to_another_type_at_the_same_port(hub, device):
    for use in uses(device):
        hub.plug(serial_number=1, profile=load_profile("autonics-tk"))
        device.client.transport.disconnect()
        with pytest.raises((DeviceError, DeadlineError)):
            use()
        assert set(hub.heard) <= set(READS)


def test_same_device_is_identified_once_after_a_new_connection(device):
    def requests_of(use):
        before = device.client.counters.requests
        use()
        return device.client.counters.requests - before

    proof = requests_of(device.check_identity)
    for use in uses(device):
        use()
        needed = requests_of(use)
        device.client.transport.disconnect()
        assert requests_of(use) == needed + proof


def test_first_device_that_comes_back_is_accepted(hub, device):
    first = hub.device
    hub.plug(serial_number=2)
    device.client.transport.disconnect()
    with pytest.raises(IdentityError):
        device.enter_safe_state()
    hub.device = first
    device.client.transport.disconnect()
    device.enter_safe_state()


def test_known_identity_refuses_a_twin(hub, device):
    found = dict(device.identity)
    assert found["serial_number"] == 1
    Device(device.profile, device.client, identity=found).check_identity()
    with pytest.raises(IdentityError) as error:
        Device(device.profile, device.client, identity=found | {"serial_number": 2}).enter_safe_state()
    assert error.value.value == "serial_number = 1, was 2"


def test_setting_is_not_part_of_the_identity(clock):
    """A range switch distinguishes two variants, but the user may turn it."""
    hub = Hub(clock, load_profile("riden-rd60xx:model_id=60125,current_range=0"))
    device = Device(load_profile("riden-rd60xx"), ModbusClient(InProcessTransport(hub, clock)))
    assert device.identity == UNKNOWN
    device.check_identity()
    assert set(device.identity) == {"model_id", "serial_number"}
