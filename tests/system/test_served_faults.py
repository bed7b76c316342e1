"""Faults by script in the served process: the driver behind a real port and a real socket."""

import subprocess
from functools import partial

import pytest
from served import COMMAND, SIM, advance, served

from smadrive.device.profile import load_profile
from smadrive.errors import ExceptionReply, ProtocolError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.connect import open_transport
from smadrive.modbus.master import Master

READ = requests.read_holding(0, 2)
RIGHT = (0x534D, 1)
TIMING = BusTiming(0.1, read_retries=0)
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
    """How to move the simulator's time, and its URL."""
    script = tmp_path / "faults.toml"
    script.write_text(FAULTS, encoding="utf-8")
    way_in = str(tmp_path / "port") if request.param == "--pty" else "0"
    with served("--time", "driven", "--faults", str(script), request.param, way_in) as (process, url):
        yield partial(advance, process), url


def test_a_scripted_bus_fails_on_time_and_the_driver_gets_over_it(scripted):
    advance_to, url = scripted
    with open_transport(url, load_profile("sma-reference").serial_settings()) as transport:
        master = Master(transport)

        def read():
            return requests.registers_of(master.execute(1, READ, TIMING))

        assert read() == RIGHT
        advance_to(1.0)
        with pytest.raises(ProtocolError):
            read()
        assert read() == RIGHT
        advance_to(2.0)
        with pytest.raises(ExceptionReply, match="exception 6"):
            read()
        reopenings = master.counters.reopenings
        advance_to(3.0)
        with pytest.raises(TransportError, match="connection is lost"):
            read()
        with pytest.raises(TransportError, match=r"no such port|refused"):
            read()
        advance_to(4.1)
        assert read() == RIGHT
        assert master.counters.reopenings == reopenings + 1
        advance_to(5.0)
        advance_to(6.0)
        with_noise_before = master.counters.discarded_bytes
        try:
            assert read() == RIGHT
            assert master.counters.discarded_bytes > with_noise_before
        except ProtocolError:
            assert url.startswith("tcp://")
        assert read() == RIGHT


def test_a_script_that_makes_no_sense_is_one_clear_line(tmp_path):
    script = tmp_path / "faults.toml"
    script.write_text('[[faults]]\nat_s = 1.0\nname = "dorp"\n', encoding="utf-8")
    for path, says in ((script, "did you mean 'drop'?"), (tmp_path / "none.toml", "no such file")):
        run = subprocess.run([*COMMAND, SIM, "--faults", str(path)], capture_output=True, text=True, check=False)
        assert run.returncode == 2
        assert says in run.stderr
        assert run.stderr.count("\n") == 1
