"""A forked child of a driver keeps no connection and no guardian: after the driver's end the heater is off at once."""

import os
import select
import signal
import subprocess
import sys
from contextlib import suppress

import programs
import pytest
from process_tree import guardians
from served import PATIENT, served
from supply_rig import RIG, patient

FORKS = """
import multiprocessing, sys, time
from smadrive.rig.rig import Rig
from smadrive.rig.config import load_rig
with Rig(load_rig(sys.argv[1])) as rig:
    child = multiprocessing.get_context("fork").Process(target=time.sleep, args=(600,), daemon=True)
    child.start()
    rig.heater.arm(rig.config.limits.watchdog_s)
    rig.heater.exchange(0.3)
    print(child.pid, flush=True)
    while True:
        rig.heater.exchange(0.3)
        time.sleep(0.05)
"""


@pytest.fixture
def driver(tmp_path):
    """A driver that heats through a supply on a network and has a forked child, the child's id, and the supply."""
    with (
        served("--profile", "riden-rd60xx", "--rtu-tcp", "0") as (supply, url),
        served("--profile", "delta-dtb") as (_, reader_url),
    ):
        rig = tmp_path / "rig.toml"
        rig.write_text(patient(RIG.format(supply=url + PATIENT, reader=reader_url + PATIENT)))
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
        with programs.Program([sys.executable, "-c", FORKS, str(rig)], **streams) as process:
            child = int(process.stdout.readline())
            try:
                yield process, child, supply
            finally:
                process.kill()
                with suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)


@pytest.mark.exhaustive
def test_forked_child_shares_nothing_and_the_guardian_of_its_killed_driver_ends(driver):
    process, child, supply = driver
    shared = programs.open_files(process.pid) & programs.open_files(child)
    assert not [link for link in shared if link.startswith("/dev/pts/") or "socket:" in link or "locks/" in link]
    (guardian,) = guardians(process.pid)
    descriptor = os.pidfd_open(guardian)
    process.kill()
    while "output off" not in supply.stderr.readline():
        pass
    select.select([descriptor], [], [])
    os.close(descriptor)
    os.kill(child, 0)
