"""Switching off: every device of a rig into its safe state, the one that heats first, whatever else is broken.

Who switches off needs no wire, no limits, no sensor and no guardian. So of the rig file only the addresses of the
devices are read, and a device that cannot be reached keeps no other from its safe state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TypeVar

from smadrive.devices.guardian.duty import relieve
from smadrive.devices.heating.heat_source import HeatSource
from smadrive.devices.heating.zero_current import wait_for_zero_current
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import DeviceKey, key_at
from smadrive.devices.state.latch import TripLatch
from smadrive.errors import ConfigError, SafetyError
from smadrive.interrupts import HeldSignals
from smadrive.rig.assembly import heat_source
from smadrive.rig.config import DeviceConfig, RigAddresses, load_addresses
from smadrive.rig.connections import HEATING, SIMULATED, Connections
from smadrive.safety.shutdown import ShutdownOutcome, carry

DoneT = TypeVar("DoneT")


@dataclass(frozen=True)
class SwitchedOff:
    """Which devices confirmed their safe state, what heats among them; what is latched; why another one did not.

    `warnings`: what could not be done after the heat sources were confirmed off.
    """

    rig: str
    devices: tuple[str, ...]
    latched: tuple[str, ...]
    warnings: tuple[str, ...]
    failure: Exception | None


@dataclass(frozen=True)
class _Off:
    """A heat source that is confirmed off, its key (None: it ends with this process), and the faults that it tells."""

    config: DeviceConfig
    source: HeatSource
    key: DeviceKey | None
    latch: TripLatch
    faults: tuple[str, ...]


def switch_off(name: str, *, clear_faults: bool) -> SwitchedOff:
    """Put every device of the rig file `name` into its safe state, confirmed; then clear what is latched, if wanted.

    Every error before that is confirmed carries an unconfirmed ShutdownOutcome. The first signals meanwhile are not
    obeyed (see HeldSignals). SafetyError when a fault persists.
    """
    with ExitStack() as stack:
        with _tells_when_unconfirmed(), HeldSignals():
            rig = load_addresses(name)
            connections = Connections(stack, trace_folder=None, insists=True)
            heating = [device for device in rig.devices if _heats(device)]
            off, unconfirmed = _each(heating, lambda device: _heat_off(device, connections, rig))
            others = [device for device in rig.devices if device not in heating]
            rested, failure = _each(others, lambda device: _rest(device, connections))
            if unconfirmed is not None:
                raise unconfirmed
            if not off:
                raise _nothing_heats(rig)
        warnings = tuple(_relieve(off))
        for one in off if clear_faults else ():
            _clear(one)
    devices = (*(one.config.name for one in off), *rested)
    latched = () if clear_faults else tuple(fault for one in off for fault in _latched(one))
    return SwitchedOff(rig.name, devices, latched, warnings, failure)


@contextmanager
def _tells_when_unconfirmed() -> Iterator[None]:
    try:
        yield
    except BaseException as error:
        carry(error, ShutdownOutcome(error))
        raise


def _each(
    devices: Iterable[DeviceConfig], act: Callable[[DeviceConfig], DoneT]
) -> tuple[list[DoneT], Exception | None]:
    """What comes of it for each device, and the first error: it keeps no other from its turn."""
    done: list[DoneT] = []
    failure: Exception | None = None
    for device in devices:
        try:
            done.append(act(device))
        except Exception as error:  # noqa: BLE001  (whatever it is, the other devices get their turn)
            failure = failure or error
    return done, failure


def _heats(device: DeviceConfig) -> bool:
    """Whether that is known of it; one whose profile cannot be read fails in its turn."""
    try:
        return load_profile(device.profile).profile.role in HEATING
    except ConfigError:
        return False


def _nothing_heats(rig: RigAddresses) -> ConfigError:
    """Why: a profile that cannot be read, or a rig without one that heats."""
    try:
        for device in rig.devices:
            load_profile(device.profile)
    except ConfigError as error:
        return error
    return ConfigError(f"rig '{rig.name}': none of its devices heats: nothing was switched off")


def _heat_off(config: DeviceConfig, connections: Connections, rig: RigAddresses) -> _Off:
    profile = load_profile(config.profile)
    key = None if config.url.startswith(SIMULATED) else key_at(config.url, profile, config.unit_id)
    device = connections.device(config, profile, None, None)
    source = heat_source(config, device, device.clock)
    source.connect()
    seen = wait_for_zero_current(source, rig.current_max_a, device.clock)
    if key is not None:
        key = key.with_identity(profile, device.identity)
    return _Off(config, source, key, TripLatch(key), seen.faults)


def _relieve(devices: Iterable[_Off]) -> Iterator[str]:
    """The guardians that wait for these devices end; why they cannot be found is a warning."""
    for key in (one.key for one in devices):
        try:
            if key is not None:
                relieve(key)
        except SafetyError as error:
            yield f"guardians that wait for this device are not relieved: {error}"


def _latched(off: _Off) -> list[str]:
    """What stays latched, on the device and here."""
    return [*off.faults, *filter(None, [off.latch.read()])]


def _clear(off: _Off) -> None:
    """SafetyError for what persists."""
    off.source.clear_faults()
    if faults := off.source.exchange(0.0).faults:
        raise SafetyError(f"not cleared, the cause persists: {', '.join(faults)}")
    off.latch.clear()


def _rest(config: DeviceConfig, connections: Connections) -> str:
    """One that only measures; a controller that could heat by itself has a safe state, too."""
    device = connections.device(config, load_profile(config.profile), None, None)
    device.check_identity()
    device.enter_safe_state()
    return config.name
