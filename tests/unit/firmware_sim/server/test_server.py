"""The faults of the line close an endpoint of the server, and open it again."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.server.server import Server
from firmware_sim.server.tcp_endpoint import TcpEndpoint


@pytest.fixture
def device(config):
    return simulated_device(config)


@pytest.fixture
def endpoint(device):
    endpoint = TcpEndpoint("0", "tcp", lambda: device.line.new_port(numbered=True), print)
    yield endpoint
    endpoint.close()


def test_endpoint_returns_once_after_the_longest_of_several_outages(device, endpoint):
    server = Server(device.bench, [endpoint])
    device.faults.connect(server.faulty_connection(endpoint), numbered=True)
    device.faults.vanish(5.0)
    server._pass_time(1.0)
    device.faults.vanish(1.0)
    is_open = []
    for time_s in (1.9, 2.1, 4.9, 5.1, 7.0):
        server._pass_time(time_s)
        is_open.append(bool(endpoint.descriptors()))
    assert is_open == [False, False, False, True, True]
