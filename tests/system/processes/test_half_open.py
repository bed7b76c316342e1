"""When a TCP connection is dead without a sign, the client opens another one instead of waiting."""

import select

import pytest
from gateway import Gateway
from marks import exhaustive
from served import SIM, served

from smadrive.control.controllers.interface import Command
from smadrive.devices.device import Device
from smadrive.devices.guardian import client
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeadlineError
from smadrive.files.shipped import configs_dir
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig

TIMING = BusTiming(response_timeout_s=1.0, read_retries=0)
DEVICES = """
[[devices]]
name = "supply"
profile = "riden-rd60xx"
{way_in} = "127.0.0.1:0"

[[devices]]
name = "thermometer"
profile = "autonics-tk"
pty = "{folder}/thermometer"
"""


def port_of(url):
    return int(url.split()[0].partition("?")[0].rpartition(":")[2])


@pytest.fixture(params=["tcp", exhaustive("rtu+tcp")])
def board(request):
    """Yield a gateway with a board behind it, and the URL of the board through the gateway."""
    with served(f"--{request.param.replace('+', '-')}", "0") as (_, url), Gateway(port_of(url)) as gateway:
        yield gateway, f"{request.param}://127.0.0.1:{gateway.port}"


def test_a_dead_connection_costs_one_deadline(board):
    gateway, url = board
    with open_transport(url) as transport:
        client = ModbusClient(transport)
        client.execute(1, requests.read_holding(0, 2), TIMING)
        gateway.strand()
        with pytest.raises(DeadlineError):
            client.execute(1, requests.read_holding(0, 2), TIMING)
        assert requests.registers_of(client.execute(1, requests.read_holding(0, 2), TIMING)) == (0x534D, 2)
        assert client.counters.reopenings == 1


def test_a_connection_that_the_gateway_closed_while_idle_is_opened_before_the_next_request(board):
    gateway, url = board
    with open_transport(url) as transport:
        client = ModbusClient(transport)
        client.execute(1, requests.read_holding(0, 2), TIMING)
        gateway.hang_up()
        assert select.select([transport._connection], [], [], 10.0)[0]
        client.execute(1, requests.read_holding(0, 2), TIMING)
        assert client.counters.timeouts == 0
        assert client.counters.reopenings == 1


class Steady:
    """A controller that holds a current and calls `act` once after some ticks."""

    duration_s = 5.0

    def __init__(self, act, at_tick):
        self._act = act
        self._at_tick = at_tick
        self.ticks = 0

    def update(self, time_s, measurement, dt_s):
        self.ticks += 1
        if self.ticks == self._at_tick:
            self._act()
        return Command(0.15)


@pytest.fixture(params=["tcp", exhaustive("rtu+tcp")])
def supply_rig(request, tmp_path):
    """Yield a gateway, the shipped supply rig behind this gateway, and the direct URL of the supply."""
    sim = tmp_path / "sim.toml"
    way_in = request.param.replace("+", "_")
    sim.write_text(
        (configs_dir() / "sims" / f"{SIM}.toml").read_text() + DEVICES.format(way_in=way_in, folder=tmp_path)
    )
    with served(sim=str(sim)) as (process, first):
        urls = [first.split()[0], process.stdout.readline().split()[0]]
        with Gateway(port_of(urls[0])) as gateway:
            config = load_rig("bench-supply")
            supply, thermometer, _ = config.devices
            behind = f"{request.param}://127.0.0.1:{gateway.port}"
            devices = (supply.model_copy(update={"url": behind}), thermometer.model_copy(update={"url": urls[1]}))
            yield gateway, Rig(config.model_copy(update={"devices": devices})), urls[0]


def output_of(url):
    with open_transport(url) as transport:
        supply = Device(load_profile("riden-rd60xx"), ModbusClient(transport))
        name = supply.profile.role("heater_enable")
        return supply.read((name,))[name].raw


@pytest.mark.exhaustive
def test_run_continues_on_a_new_connection_within_stale_after_s(supply_rig):
    gateway, rig, url = supply_rig
    controller = Steady(gateway.strand, at_tick=8)
    with rig:
        figures = rig.drive(controller, rig.nominal_balance, lambda _tick: None)
        assert rig.devices["supply"].client.counters.reopenings == 1
    assert figures.trips == 0
    assert controller.ticks > 8
    assert output_of(url) == 0


@pytest.mark.exhaustive
def test_switching_off_opens_a_new_connection(supply_rig, monkeypatch):
    monkeypatch.setattr(client, "FREES_WITHIN_S", 60.0)  # on a busy machine the guardian takes over, and ends slowly
    gateway, rig, url = supply_rig
    with rig:
        rig.heater.arm(rig.config.limits.watchdog_s)
        rig.heater.exchange(0.15)
        assert output_of(url) == 1
        gateway.strand()
    assert output_of(url) == 0
