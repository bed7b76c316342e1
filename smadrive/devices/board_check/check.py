"""Checks the board at a port: identity, conformance frames, safety checks."""

from __future__ import annotations

from collections.abc import Iterator

from smadrive.devices.board_check.checked_board import CheckedBoard
from smadrive.devices.board_check.conformance import FrameLine, conformance_results
from smadrive.devices.board_check.result import CheckResult
from smadrive.devices.board_check.safety_checks import safety_results
from smadrive.devices.device import Device
from smadrive.devices.profile.profile import Profile
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.transport import Transport

PATIENCE_MS = 200.0
"""Response timeout of the checks, in ms. A board must reply within 60 ms; a slower board can still be checked."""


def check_board(transport: Transport, profile: Profile) -> Iterator[CheckResult]:
    """Yield the results of all checks of the board behind `transport`. `profile` must describe map version 2.

    The board is off at the end. IdentityError if another device answers; DeviceError if a fault cannot be cleared.
    """
    timing = profile.timing.model_copy(update={"response_timeout_ms": PATIENCE_MS})
    patient = profile.model_copy(update={"timing": timing})
    device = Device(patient, ModbusClient(transport))
    device.check_identity()
    board = CheckedBoard(device)
    board.make_ready()
    try:
        yield from _checked(transport, board)
    finally:
        device.enter_safe_state()


def _checked(transport: Transport, board: CheckedBoard) -> Iterator[CheckResult]:
    watchdog_s = board.read("watchdog_s").value  # the conformance frames change the watchdog time
    yield from conformance_results(FrameLine(transport), board.make_ready)
    board.device.write("watchdog_s", watchdog_s)
    yield from safety_results(board)
