"""Scan of a bus. It asks each unit id for the registers that prove the identity of each profile, and writes nothing.

Devices without Modbus are asked first, because their answer to a Modbus frame is undefined.

If no register can prove a profile, the profile is possible when the registers of its roles read as valid numbers. A
unit that does not answer `SILENT` requests counts as absent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass

from smadrive.devices.device import Device
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.profile.profile import Profile
from smadrive.devices.state.lock import Role, lock_line
from smadrive.errors import DeadlineError, DeviceError, ProtocolError, TransportError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport, port_of
from smadrive.modbus.transports.transport import SerialSettings, Transport

SILENT = 3
"""Number of unanswered requests after which a unit counts as absent."""
TIMEOUT_MS = 200.0
"""Response timeout of a scan in milliseconds. Every shipped device answers sooner when it is not busy."""


@dataclass(frozen=True)
class FoundDevice:
    """A device that answered, with its proved and possible profiles.

    `unit_id` is None for the only device on a line.
    """

    unit_id: int | None
    line: SerialSettings | None
    proved: tuple[str, ...]
    possible: tuple[str, ...]


def scan(
    url: str, unit_ids: Sequence[int], profiles: Sequence[Profile], ask: Callable[[str, int], None]
) -> Iterator[FoundDevice]:
    """Yield the devices that answer at `url`. `ask(line, unit_id)` is called before each question.

    A serial URL without a baud rate is tried with the line settings of all profiles. BusyError when another smadrive
    process uses the port.
    """
    with lock_line(port_of(url), Role.DRIVER) if url.startswith("serial:") else nullcontext():
        yield from _scan(url, unit_ids, profiles, ask)


def _scan(
    url: str, unit_ids: Sequence[int], profiles: Sequence[Profile], ask: Callable[[str, int], None]
) -> Iterator[FoundDevice]:
    found: set[int] = set()
    units = [profile for profile in profiles if profile.has_registers]
    others = [profile for profile in profiles if not profile.has_registers]
    for line in _lines(url, profiles):
        with open_transport(url, line) as transport:
            if not (found or url.startswith("tcp:")) and (proved := tuple(_proved(transport, others, line))):
                yield FoundDevice(None, line, proved, ())
                return
            client = ModbusClient(transport)
            for unit_id in unit_ids:
                if unit_id in found:
                    continue
                ask(_text(line), unit_id)
                answer = _identified(client, unit_id, sorted(units, key=lambda one: one.serial_settings() != line))
                if answer is not None:
                    found.add(unit_id)
                    yield FoundDevice(unit_id, line, *answer)


def _lines(url: str, profiles: Iterable[Profile]) -> list[SerialSettings | None]:
    if not url.startswith("serial:") or "baudrate=" in url:
        return [None]
    settings = {line for profile in profiles if (line := profile.serial_settings()) is not None}
    return [*sorted(settings, key=lambda line: (-line.baudrate, line.parity, line.stopbits))]


def _text(line: SerialSettings | None) -> str:
    return "" if line is None else f"{line.baudrate} 8{line.parity}{line.stopbits}"


def _proved(transport: Transport, profiles: Iterable[Profile], line: SerialSettings | None) -> Iterator[str]:
    """Yield the profiles of devices without Modbus that answer on this line with these settings."""
    for profile in profiles:
        if line in (None, profile.serial_settings()):
            with suppress(TransportError, ProtocolError, DeviceError):
                TCLabBoard(profile, transport).check_identity()
                yield profile.profile.id


def _identified(
    client: ModbusClient, unit_id: int, profiles: Iterable[Profile]
) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Return the proved and the possible profiles of `unit_id`; return None when the unit does not answer."""
    matching: dict[bool, list[str]] = {True: [], False: []}
    silent, answered = 0, False
    for profile in profiles:
        quick = {"response_timeout_ms": TIMEOUT_MS, "retries": 0, "boot_ms": 0.0, "poll_interval_ms": 0.0}
        quick_profile = profile.model_copy(update={"timing": profile.timing.model_copy(update=quick)})
        try:
            if _is_one(Device(quick_profile, client, unit_id)):
                matching[profile.proves_type].append(profile.profile.id)
        except DeadlineError:
            silent += 1
            if silent >= SILENT and not answered:
                return None
        except (ProtocolError, DeviceError):
            answered = True
        else:
            answered = True
    if not answered:
        return None
    return tuple(matching[True]), () if matching[True] else tuple(matching[False])


def _is_one(device: Device) -> bool:
    """Return True if the device proves its identity. If nothing can prove it, valid measurements are enough."""
    device.check_identity()
    names = device.profile.measured
    return device.profile.proves_type or all(reading.invalid is None for reading in device.read(names).values())
