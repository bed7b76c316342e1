"""The address of a scheduler, what a command needs to connect to it, and the workers of a local cluster."""

import time

import dask
import psutil
import pytest

from smadrive.campaigns.execution.cluster import check_address, local_client, remote_client
from smadrive.errors import ConfigError


@pytest.mark.parametrize(
    "address",
    [
        "nowhere",
        "tcp://host",
        "tcp://:8786",
        "tcp://host:x",
        "tcp://a..b:80",
        "http://host:80",
        "ucx://host:80",
        "host:80",
    ],
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


def is_worker(process):
    try:
        return "multiprocessing.spawn" in " ".join(process.cmdline())
    except psutil.Error:  # it has just ended
        return False


def new_worker(known=None):
    """The worker process of this process that is not `known`. Wait until there is one."""
    while True:
        for child in psutil.Process().children(recursive=True):
            if child != known and is_worker(child):
                return child
        time.sleep(0.01)


@pytest.mark.exhaustive
def test_killed_worker_comes_back_even_if_it_starts_slowly():
    """Dask gives up a worker that has not come back within 15 s, unless its settings tell otherwise."""
    with local_client(1) as client:
        worker = new_worker()
        worker.kill()
        following = new_worker(worker)
        following.suspend()
        time.sleep(17.0)
        following.resume()
        client.wait_for_workers(1, timeout=60)
        assert client.submit(sum, (1, 2)).result() == 3


@pytest.mark.exhaustive
def test_worker_of_this_machine_has_no_limit_of_memory():
    """Dask pauses a worker near its limit, so a campaign of workers with small limits would stand still."""
    with local_client(1) as client:
        workers = client.scheduler_info()["workers"].values()
        assert [worker["memory_limit"] for worker in workers] == [0]
