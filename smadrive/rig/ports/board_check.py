"""Checks a board at a port that belongs to no rig: opens and locks the port, and judges the results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from smadrive.devices.board_check.check import check_board
from smadrive.devices.board_check.result import CheckKind, CheckResult, failed
from smadrive.errors import ConfigError, DeviceError, SafetyError, SmadriveError
from smadrive.rig.ports.board_port import open_board
from smadrive.rig.ports.discovery import port_url


def check_board_at(port: str) -> Iterator[CheckResult]:
    """Yield the results of the checks of the board at `port` (see `port_url`). BusyError when the port is in use.

    ConfigError for Modbus TCP, because the checks send RTU frames.
    """
    if port_url(port).startswith("tcp:"):
        raise ConfigError("the check needs a line with RTU frames", where=port, cure="use a serial port or rtu+tcp://")
    with open_board(port) as (transport, profile):
        yield from check_board(transport, profile)


def error_of(results: Sequence[CheckResult], port: str) -> SmadriveError | None:
    """Return the error of the failed checks; return None if none failed. A failed safety check comes first."""
    if unsafe := failed(results, CheckKind.SAFETY):
        cure = "do not connect a wire before the firmware is corrected"
        return SafetyError("the board failed safety checks", where=port, value=_named(unsafe), cure=cure)
    if wrong := failed(results, CheckKind.CONFORMANCE):
        cure = "correct the firmware by docs/sma-reference.md"
        return DeviceError("the board failed conformance checks", where=port, value=_named(wrong), cure=cure)
    return None


def _named(results: Sequence[CheckResult]) -> str:
    return "; ".join(one.name for one in results)
