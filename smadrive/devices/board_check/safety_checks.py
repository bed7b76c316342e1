"""The safety checks of a board that need no wire, one function each (docs/sma-reference.md).

Without a wire no current flows. The board then latches the fault `heater_open` if more than 50 mA are commanded for
30 ms. Only the check of this fault commands so much, 60 mA. The other checks command at most 30 mA.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf

from smadrive.devices.board_check.checked_board import SETTLE_S, CheckedBoard, Readings, TimeBounds
from smadrive.devices.board_check.result import CheckKind, CheckResult, CheckVerdict, judged
from smadrive.errors import DeviceError, ExceptionReply, ProtocolError
from smadrive.modbus.verdict import ExceptionCode

SMALL_A, OPEN_A = 0.03, 0.06
WATCHDOG_S = 0.25
LATEST_OFF_S = 0.02
"""Longest allowed time in s from a cause, such as the end of the watchdog time, to zero current."""
OPEN_WITHIN_S = 0.1
OBSERVED_S = 1.0
CLOCK_ERROR = 0.02
"""Largest allowed relative error of the board's clock. An oscillator without a quartz keeps it, too."""
CONVERSION_S = 0.1


def safety_results(board: CheckedBoard) -> Iterator[CheckResult]:
    """Yield the results of all safety checks. After each of them the board is off, without faults."""
    for name, check in _CHECKS.items():
        try:
            yield check(board, name)
        except (DeviceError, ProtocolError) as error:
            yield _judged(name, passed=False, detail=str(error))


def _judged(name: str, *, passed: bool, detail: str = "") -> CheckResult:
    return judged(CheckKind.SAFETY, name, passed=passed, detail=detail)


def _not_checked(name: str, detail: str) -> CheckResult:
    return CheckResult(CheckKind.SAFETY, name, CheckVerdict.NOT_CHECKED, detail)


def _starts_cold(board: CheckedBoard, name: str) -> CheckResult:
    with board.prepared():
        board.arm()
        readings = board.measured()
        current_a = readings["measured_current"].value
        armed = readings["state"].words == ("armed",) and board.read("heater_current").value == 0.0
    return _judged(name, passed=armed and current_a < SMALL_A, detail=f"{current_a:.4f} A")


def _watchdog(board: CheckedBoard, name: str, observe: Callable[[], Readings]) -> CheckResult:
    with board.prepared(watchdog_s=WATCHDOG_S):
        board.arm()
        bounds = board.fault_after("watchdog", 2 * WATCHDOG_S, lambda: board.command(SMALL_A), observe)
        off = board.read("heater_current").value == 0.0 and board.read("heater_enable").value == 0
    in_time = bounds.longest_s >= WATCHDOG_S * (1 - CLOCK_ERROR) and bounds.shortest_s <= WATCHDOG_S + LATEST_OFF_S
    return _judged(name, passed=in_time and off, detail=f"{_shown(bounds)}, must be {WATCHDOG_S:g} s")


def _shown(bounds: TimeBounds) -> str:
    if bounds.longest_s == inf:
        return f"no fault after {bounds.shortest_s:.3f} s"
    return f"after {bounds.shortest_s:.3f} to {bounds.longest_s:.3f} s"


def _watchdog_reads(board: CheckedBoard, name: str) -> CheckResult:
    return _watchdog(board, name, board.measured)


def _watchdog_repeats(board: CheckedBoard, name: str) -> CheckResult:
    return _watchdog(board, name, lambda: board.command(SMALL_A, is_new=False))


def _fed_watchdog(board: CheckedBoard, name: str) -> CheckResult:
    longest_s, armed = 0.0, True
    with board.prepared(watchdog_s=WATCHDOG_S):
        board.arm()
        began_s = fed_s = board.clock.now_s()
        while fed_s < began_s + 2 * WATCHDOG_S:
            readings, _, received_s = board.timed(lambda: board.command(SMALL_A))
            armed = armed and readings["state"].words == ("armed",)
            longest_s, fed_s = max(longest_s, received_s - fed_s), received_s
            board.wait(WATCHDOG_S / 5)
    if longest_s > WATCHDOG_S * (1 - CLOCK_ERROR):
        return _not_checked(name, f"this computer sent nothing for {longest_s:.2f} s")
    return _judged(name, passed=armed)


def _fault_latches(board: CheckedBoard, name: str) -> CheckResult:
    with board.prepared(temperature_max=0.0) as before:
        board.wait(SETTLE_S)
        board.device.write("temperature_max", before["temperature_max"])
        board.wait(SETTLE_S)
        faults = board.read("faults").words
        rejected = _rejects_arming(board)
        board.command(SMALL_A)
        state, current_a = board.read("state").words, board.read("heater_current").value
    passed = faults == ("over_temperature",) and rejected and state == ("fault",) and current_a == 0.0
    return _judged(name, passed=passed, detail=", ".join((*faults, *state)))


def _rejects_arming(board: CheckedBoard) -> bool:
    try:
        board.arm()
    except ExceptionReply as reply:
        return reply.code == ExceptionCode.DEVICE_FAILURE
    return False


def _fault_clears(board: CheckedBoard, name: str) -> CheckResult:
    with board.prepared(temperature_max=0.0):
        board.wait(SETTLE_S)
        board.write_key("fault_clear")
        board.wait(SETTLE_S)
        stays = board.read("faults").words
    board.wait(SETTLE_S)
    gone = board.read("faults").words
    passed = stays == ("over_temperature",) and gone == () and board.read("state").words == ("idle",)
    return _judged(name, passed=passed, detail=f"with its cause: {', '.join(stays) or 'none'}")


def _current_limit(board: CheckedBoard, name: str) -> CheckResult:
    with board.prepared(current_max=SMALL_A / 3):
        board.arm()
        limits = board.command(SMALL_A)["limits"].words
    return _judged(name, passed=limits == ("current_max",), detail=", ".join(limits) or "none")


def _heater_open(board: CheckedBoard, name: str) -> CheckResult:
    flowing_a = [0.0]

    def heat() -> Readings:
        readings = board.command(OPEN_A)
        flowing_a.append(readings["measured_current"].value)
        return readings

    with board.prepared():
        board.arm()
        bounds = board.fault_after("heater_open", OPEN_WITHIN_S, heat, heat)
    if max(flowing_a) > OPEN_A / 2:
        return _not_checked(name, f"{max(flowing_a):.3f} A flow: disconnect the wire for this check")
    return _judged(name, passed=bounds.shortest_s <= OPEN_WITHIN_S, detail=_shown(bounds))


def _estop(board: CheckedBoard, name: str) -> CheckResult:
    words = board.read("estop").words
    return _judged(name, passed=words == ("released",), detail=", ".join(words))


def _conversions(board: CheckedBoard, name: str) -> CheckResult:
    began = board.read("sample_counter").raw
    board.wait(OBSERVED_S)
    conversions = int(board.read("sample_counter").raw - began) & 0xFFFF
    passed = conversions >= OBSERVED_S / CONVERSION_S - 1
    return _judged(name, passed=passed, detail=f"{conversions} in {OBSERVED_S:g} s")


def _uptime(board: CheckedBoard, name: str) -> CheckResult:
    first, first_sent_s, first_received_s = board.timed(lambda: board.device.read(("uptime",)))
    board.wait(OBSERVED_S)
    second, sent_s, received_s = board.timed(lambda: board.device.read(("uptime",)))
    board_s = second["uptime"].value - first["uptime"].value
    bounds = TimeBounds(sent_s - first_received_s, received_s - first_sent_s)
    passed = bounds.shortest_s * (1 - CLOCK_ERROR) <= board_s <= bounds.longest_s * (1 + CLOCK_ERROR)
    return _judged(
        name, passed=passed, detail=f"{board_s:.3f} s in {bounds.shortest_s:.3f} to {bounds.longest_s:.3f} s"
    )


_CHECKS: dict[str, Callable[[CheckedBoard, str], CheckResult]] = {
    "no current flows after arming": _starts_cold,
    "a new sequence feeds the watchdog": _fed_watchdog,
    "reads do not feed the watchdog": _watchdog_reads,
    "a repeated sequence does not feed the watchdog": _watchdog_repeats,
    "a fault is latched and prevents arming": _fault_latches,
    "a fault is cleared only without its cause": _fault_clears,
    "current_max holds the current back": _current_limit,
    "an open heater is detected": _heater_open,
    "the emergency stop is released": _estop,
    "the thermocouple is converted every 0.1 s": _conversions,
    "the clock of the board is right": _uptime,
}
