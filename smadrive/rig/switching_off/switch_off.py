"""Switching off: every device of a rig enters its safe state; the heat source is the first.

A driver that uses the line of a device is asked to stop first, because two programs on one line would take each other's
replies for their own. If a device in the rig file cannot be read, the drivers at every address in the text of the file
are asked.

Switching off must work whatever else is broken. It needs no wire, no limits, no sensor and no guardian. So only the
devices and, if possible, the current limit are read from the rig file. If one device cannot be read or reached, every
other device still enters its safe state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial

from smadrive.clock import Clock
from smadrive.devices.guardian.duty import relieve, waiting_duties
from smadrive.devices.heating.heat_source import HeatSource, Supplied
from smadrive.devices.heating.zero_current import confirm_off, wait_for_zero_current
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import DeviceKey, Match
from smadrive.devices.state.latch import TripLatch
from smadrive.devices.state.lock import Role
from smadrive.devices.stopping.request import StoppedDriver
from smadrive.errors import ConfigError, SafetyError, UnknownCurrentError
from smadrive.interrupts import HeldSignals
from smadrive.rig.assembly import heat_source, port_key
from smadrive.rig.config import DeviceConfig
from smadrive.rig.connections import Connections
from smadrive.rig.planned_device import PlannedDevice
from smadrive.rig.switching_off.drivers import stop_drivers, stop_late_drivers
from smadrive.rig.switching_off.each import each
from smadrive.rig.switching_off.off_config import OffConfig, load_off_config
from smadrive.safety.shutdown import ShutdownOutcome, carry

_STOPPED_AS = "stopped_drivers"
"""The name of the attribute of an error that holds the drivers that were stopped before it."""


@dataclass(frozen=True)
class SwitchedOff:
    """The outcome of switching off.

    stopped      drivers that were stopped
    refused      first error of a driver that could not be stopped, and may heat again; None without such an error
    devices      names of the devices that confirmed their safe state, among them all devices that heat
    simulated    names of the `devices` that this process simulates (sim://); simulated devices of other processes are
                 not switched off
    latched      faults that stay latched
    uncleared    first error of a heat source whose faults should be cleared, but were not; None without error
    warnings     TOML errors of the rig file outside its devices, and guardians that could not be relieved
    displaced    guardians that wait at a port of this rig for another device, which may still heat elsewhere
    failure      first error in the devices of the rig file, or else of a device that does not heat; None without error
    """

    rig: str
    stopped: tuple[StoppedDriver, ...]
    refused: Exception | None
    devices: tuple[str, ...]
    simulated: tuple[str, ...]
    latched: tuple[str, ...]
    uncleared: Exception | None
    warnings: tuple[str, ...]
    displaced: tuple[str, ...]
    failure: Exception | None


@dataclass(frozen=True)
class _SourceOff:
    """A heat source that is confirmed off, with its key (None if simulated), its trip latch and its faults.

    `confirm_again` switches the source off and confirms it off once more.
    """

    name: str
    source: HeatSource
    key: DeviceKey | None
    latch: TripLatch
    faults: tuple[str, ...]
    confirm_again: Callable[[], Supplied]


def switch_off(name: str, *, clear_faults: bool) -> SwitchedOff:
    """Put every device of the rig file `name` into its safe state, confirmed by read-back. Then clear faults if asked.

    If a heat source cannot be confirmed off, the reason is raised after all other devices were tried. An error before
    all heat sources are confirmed off carries a ShutdownOutcome that is not confirmed. The first signals during this
    time have no effect (see HeldSignals). The error of faults that persist is not raised, but returned as `uncleared`:
    the heater is off all the same.
    """
    with ExitStack() as stack:
        stopped: list[StoppedDriver] = []
        with _unconfirmed_on_error(stopped), HeldSignals():
            config = load_off_config(name)
            connections = Connections(stack, trace_folder=None, role=Role.OFF)
            devices, unreadable = each(config.devices, _planned)
            unreadable = config.device_mistake or unreadable
            keyed, unkeyed = each(devices, port_key)
            keys = (*filter(None, keyed), *(config.keys if unreadable or unkeyed else ()))
            early, refused = stop_drivers(keys)
            stopped += early
            off, failure = each(
                [device for device in devices if device.heats],
                lambda device: _switch_source_off(device, connections, config.current_max_a, clear_faults=clear_faults),
            )
            late, late_refused, late_failure = stop_late_drivers(
                keys, lambda: each(off, lambda one: one.confirm_again())[1]
            )
            stopped += late
            refused, failure = refused or late_refused, failure or late_failure
            others, other_failure = each(
                [device for device in devices if not device.heats],
                lambda device: _enter_safe_state(device, connections),
            )
            _check_complete(config, off, (refused if failure else None) or failure or (None if off else unreadable))
        warnings = (*map(str, config.mistakes), *_relieve_guardians(off))
        displaced = tuple(_displaced(off))
        cleared, uncleared = each(off if clear_faults else (), _clear)
    latched = tuple(fault for one in off if one not in cleared for fault in _latched(one))
    names = (*(one.name for one in off), *others)
    simulated = tuple(device.name for device in devices if device.is_simulated and device.name in names)
    failure = unreadable or other_failure
    return SwitchedOff(
        config.name, tuple(stopped), refused, names, simulated, latched, uncleared, warnings, displaced, failure
    )


@contextmanager
def _unconfirmed_on_error(stopped: Iterable[StoppedDriver]) -> Iterator[None]:
    """Attach a ShutdownOutcome that is not confirmed to an error in the `with` block, and the drivers `stopped`.

    `stopped_before` returns these drivers. Each is also a note of the error.
    """
    try:
        yield
    except BaseException as error:
        for driver in stopped:
            error.add_note(str(driver))
        setattr(error, _STOPPED_AS, tuple(stopped))
        carry(error, ShutdownOutcome(error))
        raise


def stopped_before(error: BaseException) -> tuple[StoppedDriver, ...]:
    """Return the drivers that `switch_off` had stopped before it raised `error`."""
    stopped: tuple[StoppedDriver, ...] = getattr(error, _STOPPED_AS, ())
    return stopped


def _planned(config: DeviceConfig) -> PlannedDevice:
    """Return the device with its profile. ConfigError if the profile is wrong, because switching off needs it."""
    return PlannedDevice(config, load_profile(config.profile))


def _check_complete(config: OffConfig, off: Iterable[_SourceOff], failure: Exception | None) -> None:
    """Raise the error that left a heat source unconfirmed. Raise ConfigError if the rig has no heat source."""
    if failure is not None:
        raise failure
    if not off:
        raise ConfigError(
            "no device of the rig file heats, so no heater was switched off",
            where=f"rig '{config.name}'",
            cure="add the heat source to [[devices]]",
        )


def _switch_source_off(
    device: PlannedDevice, connections: Connections, current_max_a: float, *, clear_faults: bool
) -> _SourceOff:
    key = port_key(device)
    opened = connections.device(device)
    source = heat_source(device, opened, opened.clock)
    confirm = partial(_confirm_off, source, current_max_a, opened.clock, clear_faults=clear_faults)
    seen = confirm()
    if key is not None:
        key = key.with_identity(device.profile, opened.identity)
    return _SourceOff(device.name, source, key, TripLatch(key), seen.faults, confirm)


def _confirm_off(source: HeatSource, current_max_a: float, clock: Clock, *, clear_faults: bool) -> Supplied:
    """Switch the source off, wait until no current flows, and return the last answer of the source.

    If the current is unknown, a latched fault may be the reason. With `clear_faults` it is cleared, and tried again.
    """
    try:
        return confirm_off(source, current_max_a, clock)
    except UnknownCurrentError:
        if not clear_faults:
            raise
    source.clear_faults()
    return wait_for_zero_current(source, current_max_a, clock)


def _enter_safe_state(device: PlannedDevice, connections: Connections) -> str:
    """Write the safe state of a device that does not heat the wire, and return its name.

    Such a device may be a temperature controller, which heats something else.
    """
    opened = connections.device(device)
    opened.enter_safe_state()
    return device.name


def _relieve_guardians(off: Iterable[_SourceOff]) -> Iterator[str]:
    """End the guardians that wait for these devices. Yield a warning for each device whose guardians are unknown."""
    for one in off:
        try:
            if one.key is not None:
                relieve(one.key)
        except SafetyError as error:
            yield f"guardians that wait for '{one.name}' are not relieved: {error}"


def _displaced(off: Iterable[_SourceOff]) -> Iterator[str]:
    """Yield a text for each guardian that waits at one of these ports for a device other than the one found there."""
    with suppress(SafetyError):  # without the state folder the guardians are unknown, and `off` warns of that
        duties = waiting_duties()
        for key in (one.key for one in off if one.key is not None):
            others = (duty for duty in duties if not duty.key.proves(key))
            yield from (str(duty) for duty in others if duty.key.port_match(key) is Match.SAME)


def _latched(off: _SourceOff) -> list[str]:
    """Return the texts of the latched faults of the device, and of the trip latch."""
    return [*off.faults, *filter(None, [off.latch.read()])]


def _clear(off: _SourceOff) -> _SourceOff:
    """Clear the faults of the device, then its trip latch, and return `off`; SafetyError if a fault persists."""
    off.source.clear_faults()
    if faults := off.source.exchange(0.0).faults:
        raise SafetyError(
            "not cleared, because their cause persists",
            where=f"device '{off.name}': faults",
            value=", ".join(faults),
            cure="remove the cause first",
        )
    off.latch.clear()
    return off
