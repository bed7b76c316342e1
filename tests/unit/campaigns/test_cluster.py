"""The address of a scheduler, and what a command needs to connect to it."""

import dask
import pytest

from smadrive.campaigns.execution.cluster import check_address, remote_client
from smadrive.errors import ConfigError


@pytest.mark.parametrize(
    "address", ["nowhere", "tcp://host", "tcp://:8786", "tcp://host:x", "http://host:80", "ucx://host:80", "host:80"]
)
def test_an_address_has_protocol_host_and_port(address):
    with pytest.raises(ConfigError) as caught:
        check_address(address)
    assert caught.value.value == address
    check_address("tls://cluster:8786")


@pytest.mark.parametrize("settings", [{}, {"distributed.comm.tls.ca-file": "/nowhere/ca.pem"}])
def test_encrypted_address_needs_certificates(settings):
    with dask.config.set(settings), pytest.raises(ConfigError) as caught, remote_client("tls://127.0.0.1:8786"):
        pass
    assert caught.value.where == "--scheduler"
    assert caught.value.cure
