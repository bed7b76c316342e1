"""A living driver that cannot reach its supply lets the guardian switch it off, and sends no more heartbeats."""

import os
import signal
from contextlib import ExitStack

import programs
import pytest
from process_tree import guardians
from served import PATIENT, served

from smadrive.devices.device import Device
from smadrive.devices.guardian.client import GuardianClient
from smadrive.devices.guardian.task import GuardedDevice, Task
from smadrive.devices.heater import Heater
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import SafetyError, TakenOverError, TransportError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport

PROFILE = "riden-rd60xx"
LIMITS = HeaterLimits(current_max_a=0.5, temperature_max_c=130.0, voltage_max_v=12.0)


class Stage:
    """A supply, its driver and its guardian. The driver knows the port by a link, which can be removed."""

    def __init__(self, process, url, link, *, finds):
        self._process, self._path, self._link = process, url.removeprefix("serial://"), link
        self.plug()
        driver_url = f"serial://{link}{PATIENT}"
        self.transport = open_transport(driver_url, load_profile(PROFILE).serial_settings())
        guarded_url = f"{url}{PATIENT}" if finds else driver_url
        task = Task(GuardedDevice(PROFILE, guarded_url, None), timeout_s=60.0)
        self.guard = GuardianClient(task, self.transport.disconnect)
        self.transport.port_access = self.guard.heartbeat
        source = BenchSupply(Device(load_profile(PROFILE), ModbusClient(self.transport)))
        measured = frozenset(("temperature",))
        self.heater = Heater(source, LIMITS, self.transport.clock, guard=self.guard, from_source=measured)

    def heat(self):
        self.heater.connect()
        self.heater.source.configure(LIMITS, 1.0)
        self.guard.watch()
        self.heater.source.arm()
        self.heater.source.exchange(0.3)

    def plug(self):
        self._link.symlink_to(self._path)

    def unplug(self):
        self._link.unlink()
        self.transport.disconnect()

    def silence(self):
        """Stop the simulator: the port exists, but no reply arrives."""
        self._process.send_signal(signal.SIGSTOP)

    def wake(self):
        self._process.send_signal(signal.SIGCONT)

    def await_off(self):
        assert "output off" in self._process.stderr.readline()

    @property
    def is_on(self):
        """True if the output of the supply is on; asks the supply while the driver has no connection."""
        settings = load_profile(PROFILE).serial_settings()
        with open_transport(f"serial://{self._path}{PATIENT}", settings) as transport:
            return Device(load_profile(PROFILE), ModbusClient(transport)).read(("output",))["output"].raw == 1


@pytest.fixture
def heating(tmp_path):
    """Return a function that makes a supply heat, and returns its `Stage`. `finds`: the guardian knows another port."""
    with ExitStack() as stack:

        def begin(*, finds):
            process, url = stack.enter_context(served("--profile", PROFILE))
            stage = Stage(process, url, tmp_path / "port", finds=finds)
            stack.enter_context(stage.transport)
            stack.enter_context(stage.guard)
            stage.heat()
            assert any("output on" in line for line in process.stderr)
            return stage

        yield begin


@pytest.mark.exhaustive
def test_guardian_switches_a_supply_off_that_its_driver_cannot_reach(heating):
    stage = heating(finds=True)
    stage.unplug()
    with pytest.raises(TransportError):
        stage.heater.enter_safe_state()
    assert not stage.is_on
    stage.plug()
    stage.heater.enter_safe_state()


@pytest.mark.exhaustive
def test_driver_uses_no_port_until_the_guardian_has_switched_off(heating):
    stage = heating(finds=False)
    stage.unplug()
    with pytest.raises(SafetyError) as error:
        stage.heater.enter_safe_state()
    assert error.value.where == "guardian"
    with pytest.raises(TakenOverError):
        stage.heater.exchange(0.0)
    stage.plug()
    stage.await_off()
    stage.heater.enter_safe_state()


@pytest.mark.exhaustive
def test_driver_whose_guardian_stands_still_goes_on_by_itself(heating):
    stage = heating(finds=True)
    (process,) = guardians(os.getpid())
    os.kill(process, signal.SIGSTOP)
    stage.unplug()
    with pytest.raises(TransportError):
        stage.heater.enter_safe_state()
    stage.plug()
    stage.heater.enter_safe_state()
    stage.await_off()
    assert not programs.lives(process)


@pytest.mark.exhaustive
def test_guardian_that_stops_after_the_hand_over_does_not_keep_the_heat_on(heating):
    stage = heating(finds=False)
    stage.unplug()
    assert stage.guard.hand_over()
    (process,) = guardians(os.getpid())
    os.kill(process, signal.SIGSTOP)
    stage.plug()
    stage.heater.enter_safe_state()
    stage.await_off()
    assert not programs.lives(process)


@pytest.mark.exhaustive
def test_guardian_that_works_at_a_silent_device_keeps_the_line(heating):
    stage = heating(finds=True)
    stage.silence()
    assert stage.guard.hand_over()
    (process,) = guardians(os.getpid())
    for _ in range(2):
        with pytest.raises(SafetyError) as error:
            stage.heater.enter_safe_state()
        assert error.value.where == "guardian"
    assert programs.lives(process)
    stage.wake()
    stage.await_off()
    stage.heater.enter_safe_state()
