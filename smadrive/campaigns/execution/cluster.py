"""The Dask cluster of a campaign: processes of this machine, or a cluster that is already there.

Every worker process on this machine has one thread, because Python executes one thread at a time, and one BLAS thread.
If a worker dies, Dask repeats its tasks on another one. A task fails if more than `ALLOWED_FAILURES` workers have died
while they executed it.

Dask executes any code that it receives. So a local cluster listens on 127.0.0.1 only.
"""

from __future__ import annotations

import importlib.util
import logging
import os
import platform
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from smadrive.campaigns.versions import COMPUTING, check_version, versions
from smadrive.errors import ConfigError, TransportError
from smadrive.numerics.blas_threads import ONE_THREAD

if TYPE_CHECKING:
    from distributed import Client

ALLOWED_FAILURES = 25
OPTION = "--scheduler"
DASK = "distributed"
"""The package whose version is that of Dask: command, scheduler and workers talk to each other with it."""

PROTOCOLS = ("tcp", "tls", "ws", "wss")
ENCRYPTED = ("tls", "wss")
"""The protocols that need certificates in the configuration of Dask."""

CONNECTS_WITHIN_S = 10.0
"""Longest wait for the answer of a scheduler, s."""

SETTINGS = {
    "distributed.scheduler.allowed-failures": ALLOWED_FAILURES,
    "distributed.deploy.lost-worker-timeout": "365d",  # a dead worker that starts slowly would be given up for ever
    "distributed.nanny.pre-spawn-environ": {
        **ONE_THREAD,
        "MALLOC_TRIM_THRESHOLD_": 65536,
        "DASK_LOGGING__DISTRIBUTED": "critical",
    },
    "distributed.worker.profile.enabled": False,  # a worker would keep two trees of call stacks for each second
    "distributed.admin.tick.interval": "1s",  # 50 looks a second at the event loops would take 3 % of a core
    "distributed.worker.preload": ["smadrive.campaigns.execution.cluster"],
}
"""Settings of a local cluster. The environment is set before a worker imports numpy and dask."""


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def usable_memory_bytes() -> int:
    """Return the memory of this machine or, in a container with a limit, this limit, in bytes."""
    from distributed.system import MEMORY_LIMIT  # noqa: PLC0415 (a command that needs no cluster must start at once)

    return int(MEMORY_LIMIT)


def dask_setup(_worker: Any) -> None:
    """Ignore Ctrl-C in a worker process: the command ends its workers. Dask calls this function in each worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def local_client(workers: int) -> Iterator[Client]:
    """Yield the client of a new cluster with `workers` processes on this machine, and end the cluster afterwards."""
    import dask  # noqa: PLC0415 (a command that needs no cluster must start at once)

    with dask.config.set(SETTINGS):
        from distributed import Client, LocalCluster  # noqa: PLC0415

        _silence_logs()
        dashboard = "127.0.0.1:0" if importlib.util.find_spec("bokeh") else None
        with (
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                memory_limit=0,  # no limit: Dask would pause a worker near its limit, and a campaign would stand still
                dashboard_address=dashboard,
                host="127.0.0.1",
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client


@contextmanager
def remote_client(address: str) -> Iterator[Client]:
    """Yield the client of the scheduler at `address`, and leave the cluster running.

    ConfigError for a malformed address, for missing certificates, and for other versions of the packages on a worker.
    TransportError when no scheduler answers there.
    """
    check_address(address)
    if urlsplit(address).scheme in ENCRYPTED:
        _check_certificates(address)
    from distributed import Client  # noqa: PLC0415

    _silence_logs()
    try:
        client = Client(address, timeout=CONNECTS_WITHIN_S)
    except OSError:
        cure = "start `dask scheduler` there, or leave the option out to use the cores of this machine"
        limit = f"{CONNECTS_WITHIN_S:g} s"
        raise TransportError("no scheduler answers", where=OPTION, value=address, limit=limit, cure=cure) from None
    try:
        _check_versions(client)
        yield client
    finally:
        with suppress(OSError, TimeoutError):
            client.close()


def _silence_logs() -> None:
    """Switch off the log messages of Dask about lost connections and dead workers: the command reports them itself."""
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def _check_versions(client: Client) -> None:
    """Raise ConfigError if a worker has another version of Python or of a package than this command.

    The provenance of the results names the versions of the command. Workers without smadrive can be asked, too. Dask
    does not decide the results, but two versions of it may not understand each other.
    """
    own = versions() | {DASK: version(DASK)}
    found = {name: client.run(version, name, on_error="return") for name in (*COMPUTING, DASK)}
    found["python"] = client.run(platform.python_version)
    for name, by_worker in found.items():
        for worker, number in by_worker.items():
            check_version(name, number, own[name], f"worker {worker}")


def check_address(address: str) -> None:
    """Raise ConfigError if `address` is not the address of a scheduler, with protocol, host and port."""
    try:
        parts = urlsplit(address)
        is_address = parts.scheme in PROTOCOLS and bool(parts.hostname) and parts.port is not None
        (parts.hostname or "").encode("idna")  # the form in which a name is looked up
    except ValueError:  # UnicodeError is a ValueError, too
        is_address = False
    if not is_address:
        cure = "write an address such as tcp://192.168.1.10:8786"
        raise ConfigError("not an address", where=OPTION, value=address, cure=cure)


def _check_certificates(address: str) -> None:
    """Raise ConfigError if the configuration of Dask has no certificates for a client, or unusable ones."""
    from distributed.security import Security  # noqa: PLC0415 (a command that needs no cluster must start at once)

    cure = "set distributed.comm.tls in the configuration of Dask: ca-file, client.cert and client.key"
    try:
        context = Security().get_connection_args("client").get("ssl_context")
    except OSError as error:  # ssl.SSLError is an OSError, too
        raise ConfigError("a certificate is not usable", where=OPTION, value=str(error), cure=cure) from None
    if context is None:
        raise ConfigError("an encrypted connection needs certificates", where=OPTION, value=address, cure=cure)


def threads_of(client: Client) -> int:
    """Return the number of threads of all workers. TransportError for a cluster without a worker."""
    threads = int(sum(client.nthreads().values()))
    if not threads:
        cure = "start workers: dask worker ADDRESS --nthreads 1"
        raise TransportError("the cluster has no worker", where=OPTION, cure=cure)
    return threads
