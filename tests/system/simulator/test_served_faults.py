"""Scripted faults in the served process, with the driver at a real port and a real socket."""

import re
import sys
from functools import partial

import programs
import pytest
from served import COMMAND, SIM, advance, served

from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ExceptionReply, ProtocolError, TransportError
from smadrive.files.shipped import configs_dir
from smadrive.hysteresis import DuhemModel, save_model
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport

READ = requests.read_holding(0, 2)
RIGHT = (0x534D, 2)
TIMING = BusTiming(1.0, read_retries=0)
FAULTS = """
[[faults]]
at_s = 1.0
name = "corrupt"

[[faults]]
at_s = 2.0
name = "refuse"
code = 6

[[faults]]
at_s = 3.0
name = "vanish"
for_s = 1.0

[[faults]]
at_s = 5.0
name = "noise"
for_s = 0.5
gap_s = 0.01
"""


@pytest.fixture(params=["--pty", "--tcp", "--rtu-tcp"])
def scripted(request, tmp_path):
    """A function that moves the time of the simulator, and the URL of the simulator."""
    script = tmp_path / "faults.toml"
    script.write_text(FAULTS, encoding="utf-8")
    address = str(tmp_path / "port") if request.param == "--pty" else "0"
    with served("--time", "lockstep", "--faults", str(script), request.param, address) as (process, url):
        yield partial(advance, process), url


@pytest.mark.exhaustive
def test_scripted_faults_begin_on_time_and_the_driver_recovers(scripted):
    advance_to, url = scripted
    with open_transport(url, load_profile("sma-reference").serial_settings()) as transport:
        client = ModbusClient(transport)

        def read():
            return requests.registers_of(client.execute(1, READ, TIMING))

        assert read() == RIGHT
        advance_to(1.0)
        with pytest.raises(ProtocolError):
            read()
        assert read() == RIGHT
        advance_to(2.0)
        with pytest.raises(ExceptionReply):
            read()
        reopenings = client.counters.reopenings
        advance_to(3.0)
        for _ in range(2):
            with pytest.raises(TransportError):
                read()
        advance_to(4.1)
        assert read() == RIGHT
        assert client.counters.reopenings == reopenings + 1
        advance_to(5.0)
        advance_to(6.0)
        with_noise_before = client.counters.discarded_bytes
        try:
            assert read() == RIGHT
            assert url.startswith("tcp://") or client.counters.discarded_bytes > with_noise_before
        except ProtocolError:
            assert not url.startswith("tcp://")
        assert read() == RIGHT


def test_run_with_open_thermocouple_is_rejected_before_anything_is_written(tmp_path):
    script, rig, wire, log = (tmp_path / name for name in ("faults.toml", "rig.toml", "wire.json", "run.h5"))
    script.write_text('[[faults]]\nat_s = 0.0\nname = "open_thermocouple"\n', encoding="utf-8")
    model = DuhemModel.gaussian(
        mu_heating=90, mu_cooling=70, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 200)
    )
    save_model(model, wire)
    with served("--faults", str(script), "--pty", str(tmp_path / "port")) as (_, url):
        rig.write_text(re.sub('url = ".*"', f'url = "{url}"', (configs_dir() / "rigs" / "simulated.toml").read_text()))
        run = ("run", rig, "--model", wire, "--reference", "sine:low_mm=2,high_mm=9,period_s=40", "-o", log)
        done = programs.run(
            [sys.executable, "-m", "smadrive", *map(str, run)], capture_output=True, text=True, check=False
        )
    assert done.returncode == 4
    (message,) = done.stderr.splitlines()
    assert "thermocouple_open" in message
    assert not log.exists()


def test_wrong_script_is_rejected_in_one_line(tmp_path):
    script = tmp_path / "faults.toml"
    script.write_text('[[faults]]\nat_s = 1.0\nname = "dorp"\n', encoding="utf-8")
    for path, name in ((script, "'drop'"), (tmp_path / "none.toml", "none.toml")):
        run = programs.run([*COMMAND, SIM, "--faults", str(path)], capture_output=True, text=True, check=False)
        assert run.returncode == 2
        assert name in run.stderr
        assert run.stderr.count("\n") == 1
