"""Scan of a bus. It reads, at each unit id, the registers that prove the type of each profile. It writes no register.

Devices without Modbus are asked first, because their answer to a Modbus frame is undefined.

On an RTU line a survey (line_survey.py) first finds the units that may be there; it waits `PATIENCE_MS` for the last
reply. Each of these units is then asked for every profile. Some profiles have no register that proves them: such a
profile is possible if all its measured quantities read as valid values. A unit that answers none of the first `SILENT`
requests counts as absent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from smadrive.devices.device import Device
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.identity import IdentityCheck
from smadrive.devices.line_survey import units_to_ask
from smadrive.devices.profile.profile import Profile
from smadrive.devices.read_plan import RequestPlans
from smadrive.devices.state.port_lock import lock_port
from smadrive.errors import DeadlineError, DeviceError, ProtocolError, TransportError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.requests import Request
from smadrive.modbus.transports.connect import line_settings, open_transport
from smadrive.modbus.transports.transport import SerialSettings, Transport

SILENT = 3
"""A unit that answers none of its first `SILENT` requests counts as absent."""
NO_PATIENCE = {"boot_ms": 0.0, "opening_ms": 0.0}
TIMEOUT_MS = 200.0
"""Shortest response timeout of a scan. A profile with a longer timeout keeps its own."""
PATIENCE_MS = 500.0
"""The survey of a line waits this long for the last reply, or longer if a profile has a longer response timeout."""


@dataclass(frozen=True)
class FoundDevice:
    """A device that answered.

    unit_id     None for a device without Modbus, which is the only device on its line
    line        serial settings at which the device answered; None if the URL sets them or leads over a network
    proved      ids of the profiles whose type the device has proved
    possible    ids of the profiles that fit, but that no register can prove; empty if a profile is proved
    """

    unit_id: int | None
    line: SerialSettings | None
    proved: tuple[str, ...]
    possible: tuple[str, ...]


def scan(
    url: str, unit_ids: Sequence[int], profiles: Sequence[Profile], ask: Callable[[str, int], None]
) -> Iterator[FoundDevice]:
    """Yield the devices that answer at `url`. `ask(line, unit_id)` is called before a unit is asked.

    The text `line` names the serial settings, such as `9600 8N1`; it is empty if the scan does not set them. A serial
    URL without a baud rate is tried with the settings of all profiles, where options of the URL replace theirs.
    BusyError when another smadrive process uses the port.
    """
    with lock_port(url, unit_ids):
        yield from _scan(url, unit_ids, profiles, ask)


def _scan(
    url: str, unit_ids: Sequence[int], profiles: Sequence[Profile], ask: Callable[[str, int], None]
) -> Iterator[FoundDevice]:
    found: set[int] = set()
    units = [profile for profile in profiles if profile.has_registers]
    others = [profile for profile in profiles if not profile.has_registers]
    for line in _lines(url, profiles):
        with open_transport(url, line) as transport:
            others_here = [one for one in others if line is None or _uses(one, url, line)]
            if not (found or url.startswith("tcp:")) and (proved := tuple(_proved(transport, others_here))):
                yield FoundDevice(None, line, proved, ())
                return
            client = ModbusClient(transport)
            in_order = sorted(units, key=lambda one: not _uses(one, url, line))
            missing = [unit_id for unit_id in unit_ids if unit_id not in found]
            for unit_id in _present(client, missing, in_order, partial(ask, _text(line))):
                ask(_text(line), unit_id)
                answer = _identified(client, unit_id, in_order)
                if answer is not None:
                    found.add(unit_id)
                    yield FoundDevice(unit_id, line, *answer)


def _present(
    client: ModbusClient, unit_ids: Sequence[int], profiles: Sequence[Profile], ask: Callable[[int], None]
) -> list[int]:
    """Return the units that may be there. On Modbus TCP return all units: the gateway answers for absent units.

    ConfigError for a unit id that no device can have.
    """
    for unit_id in unit_ids:
        Device(profiles[0], client, unit_id)
    if client.transport.framing.numbered or not unit_ids:
        return [*unit_ids]
    requests = dict.fromkeys(_identity_request(profile) for profile in profiles[:SILENT])
    patience_ms = max(PATIENCE_MS, *(profile.timing.response_timeout_ms for profile in profiles))
    return units_to_ask(client.transport, unit_ids, requests, patience_ms / 1e3, ask)


def _identity_request(profile: Profile) -> Request:
    """Return the first request of the identity check of a profile."""
    names = IdentityCheck(profile, profile.unit_id).registers
    return RequestPlans(profile).read(names)[0].read_request(profile.timing.function_codes)


def _lines(url: str, profiles: Iterable[Profile]) -> list[SerialSettings | None]:
    """Return the different settings with which the port is opened for the profiles, the highest baud rate first.

    None stands for the settings of a URL with a baud rate, and of a port on a network.
    """
    if not url.startswith("serial:") or "baudrate=" in url:
        return [None]
    defaults = filter(None, (profile.serial_settings() for profile in profiles))
    settings = {line for one in defaults if (line := line_settings(url, one)) is not None}
    return [*sorted(settings, key=lambda line: (-line.baudrate, line.parity, line.stopbits))]


def _text(line: SerialSettings | None) -> str:
    return "" if line is None else str(line)


def _uses(profile: Profile, url: str, line: SerialSettings | None) -> bool:
    """Return True if the port is opened with the settings `line` for this profile."""
    own = profile.serial_settings()
    return line == (own if own is None or line is None else line_settings(url, own))


def _proved(transport: Transport, profiles: Iterable[Profile]) -> Iterator[str]:
    """Yield the ids of those `profiles` (without Modbus) whose device answers."""
    for profile in profiles:
        with suppress(TransportError, ProtocolError, DeviceError):
            TCLabBoard(profile, transport).check_identity()
            yield profile.profile.id


def _identified(
    client: ModbusClient, unit_id: int, profiles: Iterable[Profile]
) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Return the ids of the proved and of the possible profiles of `unit_id`; None when the unit does not answer."""
    matching: dict[bool, list[str]] = {True: [], False: []}
    silent, answered = 0, False
    for profile in profiles:
        timeout_ms = max(TIMEOUT_MS, profile.timing.response_timeout_ms)
        quick = {"response_timeout_ms": timeout_ms, "retries": 0, "poll_interval_ms": 0.0} | NO_PATIENCE
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
    """Check the identity, and return True if the device fits its profile.

    A device whose registers prove the type fits. If no register can prove the type, all measured values must be valid.
    IdentityError for another type.
    """
    device.check_identity()
    names = device.profile.measured
    return device.profile.proves_type or all(reading.invalid is None for reading in device.read(names).values())
