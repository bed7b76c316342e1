"""Each fault of the simulator during heating, holding and cooling, on a board and on a supply with a reader.

After each fault, the wire has no current within the deadline of the fault and from then on. The run ends with the
number of the fault, and the rig does not heat again before the faults are cleared. A mere disturbance must not trip.
The tests run in virtual time.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field

import pytest
from marks import exhaustive

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.errors import SafetyError, SmadriveError, TripError
from smadrive.identification.excitation import Excitation
from smadrive.rig.config import RigConfig, load_rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.run_log import record_excitation
from smadrive.safety.faults import CLEAR, Fault
from smadrive.safety.shutdown import shutdown_of
from tests.on_bench import rig_on

SIM = "flexinol-lt-0.15mm"
TOO_HOT_C = 160.0
"""Limit of the vendor for a wire of this alloy in air, in °C. The simulated board has the same limit."""
FAULT_AT_S = 12.0
PATHS_C = {
    "heating": (22.0, 40.0, 40.1, 40.0, 40.1, 110.0, 40.0, 22.0),
    "holding": (22.0, 90.0, 89.0, 90.0, 89.0, 90.0, 89.0, 90.0, 89.0, 90.0, 40.0, 22.0),
    "cooling": (22.0, 82.0, 60.0, 45.0, 35.0, 60.0, 22.0),
}
FOREVER = {"for_s": 1e4}
SIMILAR = {
    *("board.truncate", "board.wrong_unit", "board.wrong_function", "board.short_count", "board.stale"),
    *("board.split", "board.noise", "board.junk_before", "board.junk_after", "board.duplicate"),
    *("supply.corrupt", "supply.wrong_unit", "reader.corrupt", "reader.refuse"),
    *("short_thermocouple", "reverse_thermocouple", "spike_thermocouple", "limit_voltage", "spike_displacement"),
    *("age_wire", "drift_ambient", "board.delay", "reader.vanish", "open_switch"),
}
"""Faults whose run is like that of another fault."""


@dataclass(frozen=True)
class Case:
    """A fault of the simulated bench, and its permitted consequences.

    numbers        fault numbers with which the run may end; without any, the run must not trip
    within_s       deadline for zero current
    hottest_c      highest permitted temperature of the wire. Only a reading that drifts down, before the wire is
                   identified, may let the wire exceed the limit: it looks like a draft
    harmless       the run need not notice the fault unless the wire gets too hot
    unstoppable    only the user can end the current, and the driver must report that
    """

    name: str
    numbers: tuple[Fault, ...] = ()
    within_s: float = 0.0
    parameters: dict[str, object] = field(default_factory=dict)
    hottest_c: float = TOO_HOT_C
    harmless: bool = False
    unstoppable: bool = False


def boards():
    """Return the cases of the reference board.

    Its watchdog (0.5 s) ends a silence; its firmware ends most other faults.
    """
    lost = (Fault.STALE_DATA,)
    latched = (Fault.DEVICE_FAULT,)
    return [
        Case("open_thermocouple", latched, 0.1),
        Case("short_thermocouple", latched, 0.1),
        Case("stop_conversions", (Fault.SENSOR_INVALID,), 1.0),
        Case("freeze_thermocouple", (Fault.SENSOR_FROZEN,), 20.0),
        Case("break_wire", latched, 6.0),
        Case("board.drop", lost, 0.6, FOREVER),
        Case("board.delay", lost, 0.6, FOREVER | {"delay_s": 1.0}),
        Case("board.corrupt", lost, 0.6, FOREVER),
        Case("board.truncate", lost, 0.6, FOREVER),
        Case("board.wrong_unit", lost, 0.6, FOREVER),
        Case("board.wrong_function", lost, 0.6, FOREVER),
        Case("board.short_count", lost, 0.6, FOREVER),
        Case("board.stale", lost, 0.6, FOREVER),
        Case("board.refuse", (Fault.COMMAND_REFUSED,), 0.6, FOREVER | {"code": 4}),
        Case("board.refuse", lost, 0.6, FOREVER | {"code": 6}),
        Case("board.refuse", lost, 0.6, FOREVER | {"code": 11}),
        Case("board.vanish", lost, 0.6, FOREVER),
        Case("board.reboot", (Fault.DISARMED,), 0.1),
        Case("board.drop", parameters={"replies": 1}),
        Case("board.corrupt", parameters={"replies": 2}),
        Case("board.refuse", parameters={"replies": 1, "code": 6}),
        Case("board.split", parameters=FOREVER | {"pause_s": 0.004}),
        Case("board.brown_out", (Fault.DISARMED, *lost), 0.6, {"for_s": 0.5}),
        Case("board.noise", lost, 30.0, FOREVER, harmless=True),
        Case("board.junk_before", lost, 0.6, FOREVER),
        Case("board.junk_after", lost, 0.6, FOREVER),
        Case("board.duplicate", lost, 30.0, FOREVER, harmless=True),
        Case(
            "short_switch",
            (*latched, Fault.UNEXPECTED_HEATING, Fault.CURRENT_MISMATCH),
            0.0,
            {"leak_a": 0.2},
            unstoppable=True,
        ),
        Case("open_switch", latched, 12.0),
        Case("weaken_current", (*latched, Fault.CURRENT_MISMATCH), 12.0, {"passed": 0.4}),
        *unsteady(),
    ]


def unsteady():
    """Return the faults of thermocouple, contact or wire that no status bit shows."""
    lies = (Fault.READS_TOO_COLD, Fault.READS_TOO_HOT, Fault.OVER_TEMPERATURE, Fault.UNDER_TEMPERATURE)
    latched = (Fault.DEVICE_FAULT,)
    return [
        Case("bridge_thermocouple", (*lies, *latched, Fault.SENSOR_FROZEN), 30.0, harmless=True),
        Case("reverse_thermocouple", (*lies, *latched, Fault.SENSOR_FROZEN), 30.0, harmless=True),
        Case("drift_thermocouple", (*lies, *latched), 30.0, {"rate_c_per_s": 5.0}, harmless=True),
        Case("drift_thermocouple", (*lies, *latched), 30.0, {"rate_c_per_s": -5.0}, hottest_c=200.0),
        Case("spike_thermocouple", (*lies, *latched), 30.0, {"height_c": 60.0}, harmless=True),
        Case("corrode_contact", (*latched, Fault.CURRENT_MISMATCH), 30.0, {"contact_ohm": 3.0}, harmless=True),
        Case("limit_voltage", (*latched, Fault.CURRENT_MISMATCH), 30.0, {"voltage_v": 2.5}, harmless=True),
        Case("stick_displacement", (), harmless=True),
        Case("spike_displacement", (), parameters={"height_mm": 5.0}, harmless=True),
        Case("slip_displacement", parameters={"offset_mm": 1.0}),
        Case("age_wire", parameters={"shift_c": 3.0, "fade": 0.05, "over_s": 10.0}),
        Case("draft", parameters={"factor": 1.3, "for_s": 20.0}),
        Case("draft", (*lies, *latched), 30.0, {"factor": 4.0, "for_s": 20.0}, harmless=True),
        Case("drift_ambient", parameters={"kelvin": 8.0, "over_s": 60.0}),
        Case("step_load", parameters={"mpa": 60.0}),
        Case("step_load", parameters={"mpa": -60.0}),
        Case("loosen_bead", (*lies, *latched), 30.0, {"contact": 0.05, "over_s": 5.0}, harmless=True, hottest_c=200.0),
    ]


def supplies():
    """Return the cases of a supply and a reader at four ticks per second. Only the driver can end the heat."""
    lost = (Fault.STALE_DATA,)
    return [
        Case("open_thermocouple", (Fault.SENSOR_INVALID,), 2.0),
        Case("short_thermocouple", (Fault.SENSOR_INVALID,), 2.0),
        Case("freeze_thermocouple", (Fault.SENSOR_FROZEN,), 20.0),
        Case("break_wire", (Fault.CURRENT_MISMATCH,), 6.0),
        Case("supply.refuse", (Fault.COMMAND_REFUSED,), 2.0, {"replies": 3, "code": 4}),
        Case("supply.reboot", (Fault.DISARMED, Fault.COMMAND_REFUSED), 0.1),
        Case("supply.drop", lost, 4.0, {"for_s": 2.5}),
        Case("supply.corrupt", lost, 4.0, {"for_s": 2.5}),
        Case("supply.wrong_unit", lost, 4.0, {"for_s": 2.5}),
        Case("reader.drop", (Fault.SENSOR_INVALID, Fault.STALE_DATA), 4.0, FOREVER),
        Case("reader.corrupt", (Fault.SENSOR_INVALID, Fault.STALE_DATA), 4.0, FOREVER),
        Case("reader.vanish", (Fault.SENSOR_INVALID, Fault.STALE_DATA), 4.0, FOREVER),
        Case("reader.refuse", (Fault.SENSOR_INVALID, Fault.STALE_DATA), 4.0, FOREVER | {"code": 4}),
        Case("supply.drop", parameters={"replies": 1}),
        Case("reader.refuse", parameters={"replies": 1, "code": 4}),
        Case("reader.drop", parameters={"replies": 1}),
        Case("supply.brown_out", (Fault.DISARMED, Fault.COMMAND_REFUSED, *lost), 4.0, {"for_s": 2.5}),
        Case(
            "short_switch", (Fault.UNEXPECTED_HEATING, Fault.CURRENT_MISMATCH), 0.0, {"leak_a": 0.2}, unstoppable=True
        ),
        Case("open_switch", (Fault.CURRENT_MISMATCH,), 12.0),
        Case("weaken_current", (Fault.CURRENT_MISMATCH,), 12.0, {"passed": 0.4}),
        *unsteady(),
    ]


def board_rig():
    return load_rig("in-process")


def supply_rig():
    base = load_rig("in-process").model_dump(exclude_none=True)
    base["devices"] = [
        {"name": "supply", "profile": "riden-rd60xx", "url": "sim://bench"},
        {"name": "reader", "profile": "autonics-tk", "url": "sim://bench"},
    ]
    base["rate_hz"] = 4.0
    base["limits"] |= {"current_max_a": 0.4, "voltage_max_v": 15.0, "watchdog_s": 1.0, "stale_after_s": 2.0}
    return RigConfig.model_validate(base)


class Scene:
    """A rig on its simulated bench. It records the real current after every step of the clock."""

    def __init__(self, config):
        self.bench = SimulatedBench(load_sim(SIM), seed=5)
        self.current_a = []
        self.hottest_c = 0.0
        clock = VirtualClock()
        clock.follow(self._advance_to)
        self.rig = rig_on(self.bench, config, clock)
        self.broken_s = None

    def _advance_to(self, time_s):
        self.bench.advance_to(time_s)
        self.current_a.append((time_s, self.bench.plant.current_a))
        self.hottest_c = max(self.hottest_c, self.bench.plant.temperature_c)

    def last_heated_s(self):
        """The time from the fault to the last moment with current, in seconds."""
        return max((time_s for time_s, current_a in self.current_a if current_a > 0.0), default=0.0) - self.broken_s


def is_similar(kind, case):
    """Return whether another case has a similar run. The supply shows the faults of `unsteady` as the board does."""
    return case.name in SIMILAR or (kind == "supply" and case in unsteady())


@pytest.mark.parametrize("phase", ["heating", *map(exhaustive, ("holding", "cooling"))])
@pytest.mark.parametrize(
    ("config", "case"),
    [
        pytest.param(
            *(config, case),
            id=f"{kind}-{case.name}-{'-'.join(map(str, case.parameters.values()))}",
            marks=[pytest.mark.exhaustive] if is_similar(kind, case) else [],
        )
        for kind, config, cases in (("board", board_rig, boards()), ("supply", supply_rig, supplies()))
        for case in cases
    ],
)
def test_fault_ends_without_current_in_time_and_with_its_number(tmp_path, config, case, phase):
    scene = Scene(config())
    log = tmp_path / "run.h5"
    excitation = Excitation(PATHS_C[phase], 6.0)
    trips = []

    def run(rig, recorder):
        def record(tick):
            recorder.tick(tick)
            if scene.broken_s is None and tick.time_s >= FAULT_AT_S:
                scene.broken_s = scene.bench.time_s
                scene.bench.known_faults()[case.name](**case.parameters)

        try:
            rig.excite(excitation, record)
        except TripError as trip:
            trips.append(trip)
            rig.clock.sleep_until(rig.clock.now_s() + 5.0)
            with pytest.raises(SafetyError) as refused:
                rig.excite(excitation, record)
            assert refused.value.cure == CLEAR

    with suppress(SmadriveError), scene.rig as rig, record_excitation(log, rig, excitation) as recorder:
        run(rig, recorder)  # with a dead bus, the exit of the rig raises an error
    assert scene.hottest_c <= case.hottest_c
    if case.unstoppable:
        outcome = shutdown_of(trips[0])
        assert outcome is not None
        assert isinstance(outcome.failure, SafetyError)
    else:
        assert scene.bench.plant.current_a == 0.0
    if not case.numbers or (case.harmless and not trips):
        assert not trips
        return
    (trip,) = trips
    assert trip.number in [fault.number for fault in case.numbers], str(trip)
    assert case.unstoppable or scene.last_heated_s() <= case.within_s, str(trip)
    assert len(read_log(log).column("time_s")) > 40
