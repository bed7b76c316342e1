"""The speed of Modbus exchanges, against peers in the same run: python tests/benchmarks/bus.py

    exchanges    FC23 (write 4, read 8) on a pseudo-terminal, with libmodbus's server in C at the other end: the client
                 of libmodbus in C, smadrive with all its checks, pymodbus async and sync, in turns; medians of rounds
    tick         processor time of the driver for one tick of a heater board served by firmware-sim

It prints ratios and rates, and asserts no time. All clients run without the pauses of the standard, because the peers
have none.
"""

from __future__ import annotations

import asyncio
import statistics
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from peers import libmodbus
from pymodbus.client import AsyncModbusSerialClient, ModbusSerialClient

from smadrive.clock import MonotonicClock
from smadrive.devices.device import Device
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport

ROUNDS = 9
COUNTS = {"libmodbus C": 2000, "smadrive": 2000, "pymodbus async": 1000, "pymodbus sync": 100}
READ = 8


def libmodbus_s(path, count):
    """Return the time of libmodbus's client for `count` exchanges."""
    return float(libmodbus.client("rtu", path, 1, "rate", count)[0])


def smadrive_s(path, count):
    """Return the time of smadrive, which checks unit, function, count, length and CRC of each reply."""
    timing = BusTiming(1.0, silence=False)
    with open_transport(f"serial://{path}") as transport:
        client = ModbusClient(transport)
        client.execute(1, requests.read_holding(0, 1), timing)
        began_s = time.perf_counter()
        for number in range(count):
            payload = client.execute(1, requests.exchange(0, (number, 0, 0, 0), 0, READ), timing)
            assert requests.registers_of(payload)[0] == number
        return time.perf_counter() - began_s


def pymodbus_sync_s(path, count):
    """Return the time of pymodbus's synchronous client."""
    with ModbusSerialClient(path, baudrate=115200, timeout=1) as client:
        began_s = time.perf_counter()
        for number in range(count):
            reply = client.readwrite_registers(
                read_address=0, read_count=READ, write_address=0, values=[number, 0, 0, 0], device_id=1
            )
            assert reply.registers[0] == number
        return time.perf_counter() - began_s


def pymodbus_async_s(path, count):
    """Return the time of pymodbus's asynchronous client."""

    async def run():
        client = AsyncModbusSerialClient(path, baudrate=115200, timeout=1)
        await client.connect()
        began_s = time.perf_counter()
        for number in range(count):
            reply = await client.readwrite_registers(
                read_address=0, read_count=READ, write_address=0, values=[number, 0, 0, 0], device_id=1
            )
            assert reply.registers[0] == number
        took_s = time.perf_counter() - began_s
        client.close()
        return took_s

    return asyncio.run(run())


CLIENTS = dict(zip(COUNTS, (libmodbus_s, smadrive_s, pymodbus_async_s, pymodbus_sync_s), strict=True))


def report_exchanges():
    """Print the rate of each client, and the ratio of smadrive's rate to that rate."""
    rates = {name: [] for name in COUNTS}
    with libmodbus.server("rtu") as path:
        for _ in range(ROUNDS):
            for name, count in COUNTS.items():
                rates[name].append(count / CLIENTS[name](path, count))
    ours = statistics.median(rates["smadrive"])
    for name, seen in rates.items():
        rate = statistics.median(seen)
        span = f"{min(seen):,.0f} to {max(seen):,.0f}"
        print(f"FC23 on a pty, {name}: {rate:,.0f}/s ({span}); smadrive is {ours / rate:.2f} x")


def report_tick(ticks=2000):
    """Print the processor time of a tick in this process, without the simulator."""
    profile = load_profile("sma-reference")
    command = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as simulator:
        with open_transport(simulator.stdout.readline().strip(), profile.serial_settings()) as transport:
            board = HeaterBoard(Device(profile, ModbusClient(transport)), MonotonicClock())
            board.connect()
            began_s = time.process_time()
            for _ in range(ticks):
                board.exchange(0.0)
            tick_s = (time.process_time() - began_s) / ticks
        simulator.kill()
    share = 100 * 20 * tick_s
    print(f"tick of a served board: {1e6 * tick_s:.0f} us of processor time, {share:.2f} % of a core at 20 Hz")


def main():
    if (reason := libmodbus.missing()) is not None:
        print(f"FC23 on a pty: not measured, {reason}")
    else:
        report_exchanges()
    report_tick()


if __name__ == "__main__":
    main()
