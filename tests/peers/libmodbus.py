"""libmodbus as a peer: the C programs beside this file, built once per process."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

HERE = Path(__file__).parent


@cache
def missing():
    """Why the peer cannot be built; None when it can."""
    if shutil.which("gcc") is None:
        return "needs a C compiler (Debian package gcc)"
    if (
        shutil.which("pkg-config") is None
        or subprocess.run(["pkg-config", "--exists", "libmodbus"], check=False).returncode
    ):
        return "needs libmodbus (Debian packages libmodbus-dev and pkg-config)"
    return None


@cache
def program(name):
    """The path of the built program `name`."""
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "libmodbus"], capture_output=True, text=True, check=True
    ).stdout.split()
    built = Path(tempfile.mkdtemp(prefix="smadrive-peer-")) / name
    subprocess.run(["gcc", "-O2", "-Wall", "-Werror", "-o", built, HERE / f"{name}.c", *flags], check=True)
    return str(built)


@contextlib.contextmanager
def server(kind, unit_id=1, registers=()):
    """A libmodbus server ("rtu" or "tcp") whose registers hold these (address, value) pairs; its path or port."""
    settings = [f"{address}={value}" for address, value in registers]
    command = [program("server"), kind, str(unit_id), *settings]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def client(kind, where, unit_id, *command):
    """What the libmodbus client prints, as words; CalledProcessError when it fails."""
    run = subprocess.run(
        [program("client"), kind, where, str(unit_id), *map(str, command)], capture_output=True, text=True, check=True
    )
    return run.stdout.split()
