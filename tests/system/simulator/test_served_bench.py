"""A bench with several devices in one process: a board, two thermometers on one line, a module on TCP, one wire."""

from pathlib import Path

import pytest
from served import PATIENT, SIM, advance, served
from typer.testing import CliRunner

from firmware_sim.cli import main
from smadrive.clock import MonotonicClock
from smadrive.devices.device import Device
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeadlineError
from smadrive.files.shipped import configs_dir
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport

DEVICES = """
[[devices]]
name = "board"
profile = "sma-reference"
pty = "{folder}/board"

[[devices]]
name = "wire"
profile = "delta-dtb"
unit_id = 3
pty = "{folder}/line"

[[devices]]
name = "room"
profile = "autonics-tk"
unit_id = 4
pty = "{folder}/line"

[[devices]]
name = "module"
profile = "adam-6018"
tcp = "0"
"""


def sim_file(folder, devices=DEVICES):
    path = Path(folder, "bench.toml")
    shipped = (configs_dir() / "sims" / f"{SIM}.toml").read_text(encoding="utf-8")
    path.write_text(shipped + devices.format(folder=folder), encoding="utf-8")
    return str(path)


@pytest.mark.exhaustive
def test_every_endpoint_is_printed_and_all_devices_measure_the_same_wire(tmp_path):
    script = tmp_path / "faults.toml"
    script.write_text('[[faults]]\nat_s = 60.0\nname = "wire.drop"\nfor_s = 5.0\n', encoding="utf-8")
    with served("--time", "lockstep", "--faults", str(script), sim=sim_file(tmp_path)) as (process, first):
        printed = [first, process.stdout.readline().strip(), process.stdout.readline().strip()]
        assert printed[0] == f"serial://{tmp_path}/board board"
        assert printed[1] == f"serial://{tmp_path}/line wire room"
        assert printed[2].startswith("tcp://127.0.0.1:")
        assert printed[2].endswith(" module")
        urls = [line.partition(" ")[0] + PATIENT for line in printed]
        advance(process, 10.0)
        lines = [load_profile(name).serial_settings() for name in ("sma-reference", "delta-dtb")]
        with (
            open_transport(urls[0], lines[0]) as board_port,
            open_transport(urls[1], lines[1]) as line,
            open_transport(urls[2]) as module_port,
        ):
            board = HeaterBoard(Device(load_profile("sma-reference"), ModbusClient(board_port)), MonotonicClock())
            shared = ModbusClient(line)
            thermometers = [
                Device(load_profile("delta-dtb"), shared, 3),
                Device(load_profile("autonics-tk"), shared, 4),
                Device(load_profile("adam-6018"), ModbusClient(module_port)),
            ]

            def temperatures():
                names = [one.profile.role("temperature") for one in thermometers]
                return [one.read((name,))[name].value for one, name in zip(thermometers, names, strict=True)]

            assert temperatures() == pytest.approx([22.0] * 3, abs=1.5)
            board.connect()
            board.configure(HeaterLimits(0.6, 130.0), watchdog_s=10.0)
            board.arm()
            for second in range(11, 30):
                assert board.exchange(0.3).armed
                advance(process, float(second))
            hot = temperatures()
            assert min(hot) > 60.0
            assert max(hot) - min(hot) < 2.0
            board.enter_safe_state()
            advance(process, 61.0)
            with pytest.raises(DeadlineError):
                shared.execute(3, requests.read_holding(0x1000, 1), BusTiming(0.1, read_retries=0))
            name = thermometers[1].profile.role("temperature")
            assert thermometers[1].read((name,))[name].value < 60.0


@pytest.mark.parametrize(
    ("devices", "options", "names"),
    [
        (DEVICES.replace("unit_id = 4", "unit_id = 3"), [], ("'wire'", "'room'", "unit_id 3")),
        (DEVICES.replace('"room"', '"wire"'), [], ("'wire'",)),
        (DEVICES.replace('tcp = "0"', ""), [], ("'module'", "pty", "tcp", "rtu_tcp")),
        (DEVICES.replace("tcp =", "rtu_tcp ="), [], ("'adam-6018'", "--tcp")),
        (DEVICES.replace("tcp =", "tpc ="), [], ("tpc", "'tcp'")),
        (DEVICES.replace("delta-dtb", "riden-rd60xx"), [], ("'sma-reference'", "'riden-rd60xx'")),
        (DEVICES, ["--tcp", "0"], ("[[devices]]", "--tcp")),
        (DEVICES, ["--line-speed"], ("--line-speed", "--pty")),
    ],
)
def test_impossible_bench_is_rejected_in_one_line(tmp_path, devices, options, names):
    run = CliRunner().invoke(main, [sim_file(tmp_path, devices), *options])
    assert run.exit_code == 2
    assert all(name in run.stderr for name in names)
    assert run.stderr.count("\n") == 1
