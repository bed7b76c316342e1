"""FAULTS.toml: its effect on a bench, and the errors for wrong scripts."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.fault_script import FaultScript, load_script
from smadrive.errors import ConfigError, DeadlineError, ExceptionReply, SmadriveError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient

TIMING = BusTiming(0.1, read_retries=0)
READ = requests.read_holding(0, 2)


@pytest.fixture
def script(tmp_path):
    def write(text):
        path = tmp_path / "faults.toml"
        path.write_text(text, encoding="utf-8")
        return load_script(path)

    return write


def test_faults_begin_at_their_times_and_are_logged(simulated, script):
    simulated.bench.follow_script(
        script("""
        [[faults]]
        at_s = 3.0
        name = "refuse"
        code = 6
        replies = 1
        [[faults]]
        at_s = 1.0
        name = "drop"
        for_s = 0.5
        [[faults]]
        at_s = 4.0
        name = "open_thermocouple"
        """)
    )
    client = ModbusClient(simulated.transport())
    outcomes = []
    for time_s in (0.9, 1.1, 2.9, 3.0, 3.1, 3.2):
        client.clock.sleep_until(time_s)
        try:
            outcomes.append(len(client.execute(1, READ, TIMING)))
        except SmadriveError as error:
            outcomes.append(type(error))
    assert outcomes == [4, DeadlineError, 4, ExceptionReply, 4, 4]
    healthy = simulated.bench.sensors.faults.thermocouple.name
    simulated.bench.advance_to(4.1)
    assert (healthy, simulated.bench.sensors.faults.thermocouple.name) == ("none", "open")
    assert [event for event in simulated.bench.events if "fault:" in event] == [
        "t=1.000 s fault: drop for_s = 0.5",
        "t=3.000 s fault: refuse code = 6, replies = 1",
        "t=4.000 s fault: open_thermocouple",
    ]


def random_outcomes(config, seed):
    simulated = simulated_device(config, seed)
    simulated.bench.follow_script(FaultScript.model_validate({"random": {"share": 0.5, "slowest_s": 0.3}}))
    client = ModbusClient(simulated.transport())
    outcomes = []
    for _ in range(300):
        try:
            outcomes.append(client.execute(1, READ, TIMING).hex())
        except SmadriveError as error:
            outcomes.append(type(error).__name__)
    return outcomes


@pytest.mark.exhaustive
def test_random_faults_depend_on_the_seed_alone(config):
    first = random_outcomes(config, 1)
    assert first == random_outcomes(config, 1)
    assert first != random_outcomes(config, 2)
    assert set(first) >= {"534d0002", "DeadlineError", "ProtocolError", "ExceptionReply"}
    assert set(first) <= {"534d0002", "DeadlineError", "ProtocolError", "ExceptionReply", "TransportError"}


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('[[faults]]\nat_s = 1\nname = "dorp"', ("[[faults]] 1: ", "'dorp'", "'drop'")),
        ('[[faults]]\nat_s = 1\nname = "delay"', ("[[faults]] 1 (delay): delay_s",)),
        ('[[faults]]\nat_s = 1\nname = "delay"\ndelay = 1.0', ("delay: ", "'delay_s'")),
        ('[[faults]]\nat_s = 1\nname = "delay"\ndelay_s = -1.0', ("delay_s: ", " 0 ", "-1.0")),
        ('[[faults]]\nat_s = 1\nname = "drop"\nreplies = 0', ("replies: ", " 1 ")),
        ('[[faults]]\nat_s = 1\nname = "refuse"\ncode = 6.5', ("code: ", "6.5")),
        ('[[faults]]\nname = "drop"', ("[[faults]] 1: at_s: ",)),
        ("[random]\nshare = 1.5", ("random.share: ", " 1 ")),
        ("[randon]\nshare = 0.5", ("randon: ", "'random'")),
    ],
)
def test_error_names_entry_and_key(simulated, script, text, named):
    with pytest.raises(ConfigError) as error:
        simulated.bench.follow_script(script(text))
    place = f"{error.value.where}: {error.value.what}"
    assert all(part in f"{place} {error.value.cure}" for part in named)
