"""The calibration constants of an `sma-reference` board, from readings of multimeters while the board holds a current.

    source_gain      <- source_gain  · set / true
    current_gain     <- current_gain · (true - current_offset) / (shown - current_offset)
    voltage_gain     <- voltage_gain · (true - voltage_offset) / (shown - voltage_offset)

`set` is the commanded value, `true` the reading of a multimeter, and `shown` the value that the board measured. The
constants on the right are those of the log, so a second calibration with the same log gives the same gains. The
offsets stay. docs/sma-reference.md, "Calibration", has the equations of the board.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from smadrive.devices.device import Device
from smadrive.errors import ConfigError
from smadrive.modbus.client import ModbusClient
from smadrive.rig.ports.board_port import open_board

GAINS = (0.75, 1.25)
"""Lowest and highest gain that is written to a board."""
LEAST_A, LEAST_V = 0.02, 0.5
"""Lowest readings for a gain. At lower readings the offsets and the resolution of the meters matter too much."""
_GIVEN = {"source_gain": "--current", "current_gain": "--current", "voltage_gain": "--voltage"}
"""The option from which each gain follows."""
_UNIT_HINTS = {
    **dict.fromkeys(("source_gain", "current_gain"), "is it in milliamperes? give it in A"),
    "voltage_gain": "is it in millivolts? give it in V",
}
SERIAL_NUMBER = "serial_number"
CONSTANTS = (
    SERIAL_NUMBER,
    "current_gain",
    "current_offset",
    "voltage_gain",
    "voltage_offset",
    "source_gain",
    "source_offset",
)
"""The registers of serial number and calibration. A board of map version 1 lacks some of them."""


class HeldCurrent(NamedTuple):
    """A current that the board held, in A, and the voltage across its load, in V.

    set_a                 current that the board was set to
    shown_a, shown_v      values that the board measured
    true_a, true_v        readings of the multimeters
    """

    set_a: float
    shown_a: float
    true_a: float
    shown_v: float
    true_v: float


def new_gains(constants: Mapping[str, float], held: HeldCurrent) -> dict[str, float]:
    """Return the gains that correct the board, by register.

    ConfigError if a reading is below `LEAST_A` or `LEAST_V`, or a gain outside `GAINS`.
    """
    if min(held.set_a, held.shown_a, held.true_a) < LEAST_A or min(held.shown_v, held.true_v) < LEAST_V:
        cure = f"hold at least {LEAST_A:g} A, with at least {LEAST_V:g} V across the resistor"
        raise ConfigError("the readings are too low for a calibration", value=str(held), cure=cure)
    offset_a, offset_v = constants["current_offset"], constants["voltage_offset"]
    gains = {
        "source_gain": constants["source_gain"] * held.set_a / held.true_a,
        "current_gain": constants["current_gain"] * (held.true_a - offset_a) / (held.shown_a - offset_a),
        "voltage_gain": constants["voltage_gain"] * (held.true_v - offset_v) / (held.shown_v - offset_v),
    }
    for name, gain in gains.items():
        if not GAINS[0] <= gain <= GAINS[1]:
            raise ConfigError(
                f"the {name.replace('_', ' ')} of the board would be too far from 1",
                where=_GIVEN[name],
                value=f"{gain:.3g}",
                limit=f"{GAINS[0]:g} to {GAINS[1]:g}",
                cure=f"{_UNIT_HINTS[name]}; check what the multimeters showed, and the resistors of the board",
            )
    return gains


def board_constants(devices: Iterable[object]) -> dict[str, float]:
    """Return serial number and calibration constants of the board among `devices`; empty if none has such constants."""
    for device in devices:
        if isinstance(device, Device) and device.profile.registers.keys() >= {*CONSTANTS}:
            return {name: reading.value for name, reading in device.read(CONSTANTS, proved=True).items()}
    return {}


def calibrate_board_at(port: str, held: HeldCurrent, recorded: Mapping[str, float]) -> dict[str, float]:
    """Write new gains into the board at `port` and save them. Return the gains by register.

    `recorded` are the `board_constants` while the board held the current. ConfigError for the reasons of `new_gains`,
    and if the board has another serial number; BusyError when the port is in use; ExceptionReply while the board is
    armed.
    """
    with open_board(port) as (transport, profile):
        device = Device(profile, ModbusClient(transport))
        device.check_identity()
        _check_same_board(device, recorded)
        gains = new_gains(recorded, held)
        for name, gain in gains.items():
            device.write(name, gain)
        (key,) = profile.register("calibration_save").enum
        device.write("calibration_save", key)
        return gains


def _check_same_board(device: Device, recorded: Mapping[str, float]) -> None:
    expected = recorded[SERIAL_NUMBER]
    found = device.read((SERIAL_NUMBER,), proved=True)[SERIAL_NUMBER].value
    if found != expected:
        raise ConfigError(
            "the log is of another board",
            where="--log",
            value=f"the board at this port has the serial number {found:.0f}",
            limit=f"{expected:.0f}",
            cure="connect that board, or record a log with this one",
        )
