"""The attempts of a guardian to switch its device off.

Each gets the line, writes the safe state, reads it back, and then measures that no current flows.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import NamedTuple

from smadrive.devices.device import Device
from smadrive.devices.guardian.search import PortSearch
from smadrive.devices.guardian.states import AttemptOutcome
from smadrive.devices.guardian.task import GuardedDevice, SharedLock
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.heating.zero_current import confirm_off
from smadrive.devices.profile.profile import Profile
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import LineLock, Role, lines_of, lock_line
from smadrive.errors import BusyError, IdentityError, SafetyError
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import is_remote, open_transport
from smadrive.modbus.transports.transport import PortAccess, Transport


class LineAccess:
    """Access to the line: while the driver lives, its locks are shared; afterwards, each attempt locks the line."""

    def __init__(self, shared: Iterable[SharedLock]) -> None:
        self._shared = [LineLock(*lock) for lock in shared]

    def hold_as(self, role: Role, pid: int) -> None:
        """Write role and process id of the holder into the files of the shared locks."""
        for lock in self._shared:
            lock.hold_as(role, pid)

    def release_shared(self) -> None:
        """Release the shared locks after the end of the driver: others may use the line between attempts."""
        for lock in self._shared:
            lock.release()
        self._shared = []

    @contextmanager
    def to(self, lines: Collection[str], *, alone: bool) -> Iterator[bool]:
        """Use the line that has the names `lines`. The caller sets `alone` to True once the driver has ended.

        Yield True if the guardian has locked the line for itself, False while the guardian shares the lock of the
        driver. The shared lock of one name is enough, because the addresses of the host may have changed since the
        driver looked them up. BusyError when another program has locked the line.
        """
        if not alone or any(lock.line in lines for lock in self._shared):
            yield False
            return
        with ExitStack() as stack:
            for line in lines:
                stack.enter_context(lock_line(line, Role.GUARDIAN, within_s=0.0))
            yield True


class AttemptResult(NamedTuple):
    """The outcome of an attempt to switch off, and the text about it for the user."""

    outcome: AttemptOutcome
    text: str


class OffSwitch:
    """Switches the guarded device off, at the port at which the device is now.

    `show_life` is called before each attempt and before each use of a port.
    """

    def __init__(
        self,
        device: GuardedDevice,
        profile: Profile,
        search: PortSearch,
        access: LineAccess,
        show_life: PortAccess = lambda: None,
    ) -> None:
        self._device = device
        self._profile = profile
        self._search = search
        self._access = access
        self._show_life = show_life

    def off(self, *, alone: bool) -> AttemptResult:
        """Try every port at which the device may be, and return the result. `alone` is True once the driver has ended.

        Every error becomes an outcome with a text, because no error may end the guardian.
        """
        try:
            self._show_life()
            return self._off_anywhere(alone=alone)
        except Exception as error:  # noqa: BLE001
            return AttemptResult(AttemptOutcome.UNREACHABLE, str(error))

    def _off_anywhere(self, *, alone: bool) -> AttemptResult:
        if alone and self._search.is_gone:
            return AttemptResult(AttemptOutcome.GONE, "its pseudo-terminal has ended, and so has the device")
        result = AttemptResult(AttemptOutcome.UNREACHABLE, "none of its ports exists, or another device answers there")
        for url in self._search.urls():
            result = self._off_at(url, alone=alone)
            if result.outcome in (AttemptOutcome.CONFIRMED, AttemptOutcome.CURRENT_FLOWS):
                break
        return result

    def _off_at(self, url: str, *, alone: bool) -> AttemptResult:
        """Try to switch off at this port, and return the outcome."""
        try:
            with self._access.to(self._lines(url) if alone else (), alone=alone) as exclusive:
                self._switch_off(url, exclusive=exclusive)
        except SafetyError as error:
            return AttemptResult(AttemptOutcome.CURRENT_FLOWS, f"{error.what}: {error.value}")
        except IdentityError as error:
            self._search.note_other_device(url)
            return AttemptResult(AttemptOutcome.ANOTHER_DEVICE, str(error))
        except BusyError as error:
            return AttemptResult(AttemptOutcome.BUSY, str(error))
        except Exception as error:  # noqa: BLE001
            self._search.note_no_device(url)
            outcome = AttemptOutcome.UNREACHABLE_REMOTE if is_remote(url) else AttemptOutcome.UNREACHABLE
            return AttemptResult(outcome, str(error))
        return AttemptResult(AttemptOutcome.CONFIRMED, "heater off, confirmed by read-back")

    def _switch_off(self, url: str, *, exclusive: bool) -> None:
        """Write the safe state, and wait until no current flows; SafetyError if it flows on. A TCLab measures none."""
        settings = self._profile.serial_settings()
        with open_transport(url, settings, exclusive=exclusive, port_access=self._show_life) as transport:
            device = self._device_on(transport)
            device.check_identity()
            if isinstance(device, TCLabBoard):
                device.enter_safe_state()
            else:
                confirm_off(BenchSupply(device), self._device.current_max_a, transport.clock)

    def _device_on(self, transport: Transport) -> Device | TCLabBoard:
        if not self._profile.has_registers:
            return TCLabBoard(self._profile, transport)
        client = ModbusClient(transport)
        return Device(self._profile, client, self._device.unit_id, identity=self._device.identity)

    def _lines(self, url: str) -> tuple[str, ...]:
        return lines_of(key_at(url, self._profile, self._device.unit_id))
