"""The rig, which connects devices, controller, supervisor and loop, and runs experiments on the wire.

This module computes nothing and sends no request: controllers compute, and devices send the requests.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

from smadrive.clock import Clock, MonotonicClock
from smadrive.control.controllers.interface import Controller
from smadrive.control.feedforward.displacement import DisplacementInverse
from smadrive.control.loop import ControlLoop, LoopMetrics, StopRequested, TickHandler, never
from smadrive.control.references.reference import Reference
from smadrive.devices.device import Device
from smadrive.devices.identity import DeviceType, TypeCheck
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.latch import TripLatch
from smadrive.devices.stopping.listener import StopListener
from smadrive.errors import SafetyError
from smadrive.identification.excitation import Excitation
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.modbus.bus import BusCounters
from smadrive.modbus.transports.transport import Transport
from smadrive.posix import check_posix
from smadrive.real_time import real_time_scheduling
from smadrive.rig.assembly import open_devices
from smadrive.rig.checks.limits import check_excitation_time, check_limits, check_same_wire
from smadrive.rig.checks.sensing import check_sensing, check_sensor, usable_checks, usable_wire
from smadrive.rig.config import RigConfig
from smadrive.rig.controllers import excitation_controller, excitation_path, tracking_controller
from smadrive.rig.last_heat import LastHeat
from smadrive.rig.plan import plan_rig
from smadrive.rig.supervision import WireChecks, check_rate, supervisor, wire_checks, with_holding_current
from smadrive.safety.faults import CLEAR
from smadrive.safety.shutdown import ends_safe
from smadrive.wire.cold_wire import limit_caveats
from smadrive.wire.data_sheet import WireDataSheet, load_data_sheet
from smadrive.wire.health.expected_rest import ExpectedRest
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel


class Rig:
    """The connected devices of a rig file. The end of this context manager puts the heat source into its safe state.

    transports      connections by device name, used instead of the addresses in the rig file
    clock           clock of the loops; None: the clock of the connection (real time on a port, virtual time on sim://)
    trace_folder    folder for traces of the traffic, one file for each connection (see TraceFile); None traces nothing
    data_sheet      data sheet of the wire, used instead of the wire file that the rig file names

    ConfigError when the devices contradict each other (see plan.py), or a limit is implausible for the wire.
    """

    def __init__(
        self,
        config: RigConfig,
        clock: Clock | None = None,
        transports: Mapping[str, Transport] | None = None,
        trace_folder: Path | None = None,
        data_sheet: WireDataSheet | None = None,
    ) -> None:
        self.config = config
        self._where = f"rig '{config.name}'"
        self.data_sheet = data_sheet or load_data_sheet(config.wire)
        check_limits(config, self.data_sheet)
        check_excitation_time(config, self.data_sheet)
        self.nominal_balance = self.data_sheet.heat_balance()
        self._clock = clock
        self._transports = transports or {}
        profiles = {device.name: load_profile(device.profile) for device in config.devices}
        plan = plan_rig(config, profiles, self._transports)
        self._plan = replace(plan, limits=with_holding_current(plan.limits, self.nominal_balance))
        correct, limit_c = self._plan.corrections.temperature.corrected, config.limits.temperature_max_c
        self.caveats = *self._plan.caveats, *limit_caveats(correct, self.data_sheet.ambient_c, limit_c)
        self._trace_folder = trace_folder

    def __enter__(self) -> Self:
        """Open the ports, check the identity of heat source and sensors, and enter the safe state.

        ConfigError on a system that is not POSIX.
        """
        check_posix()
        with ExitStack() as stack:
            self.stop = stack.enter_context(StopListener(self._where))
            opened = open_devices(self._plan, stack, self.stop, self._clock, self._transports, self._trace_folder)
            self.heater, self.devices, self.clock = opened.heater, opened.by_name, opened.clock
            self.heater.connect()
            source = self._plan.source
            self._source = replace(source, profile=self.devices[source.name].profile)  # that of the proved model
            key = opened.key()
            self.latch, self._last_heat = TripLatch(key), LastHeat(key, self.clock)
            stack.enter_context(ends_safe(self.heater.enter_safe_state))
            self._on_exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Enter the safe state, then close the ports. An error in the `with` block is raised again."""
        self._on_exit.__exit__(kind, error, trace)

    def measures(self, quantity: str) -> bool:
        """Return True if a device measures `quantity`: "temperature", "displacement" or "resistance"."""
        return any(device.measures(quantity) for device in self._plan.devices)

    @property
    def identities(self) -> dict[str, DeviceType]:
        """The type of each device, by the device's name, and the result of the check of this type."""
        return {
            name: DeviceType(device.profile.profile.id, device.profile.profile.vendor, device.type_check)
            for name, device in self.devices.items()
        }

    def identify(self) -> dict[str, DeviceType]:
        """Check the identity of the devices that are not checked yet, and return `identities`.

        IdentityError when another device answers, TransportError when none answers.
        """
        for device in self.devices.values():
            if device.type_check is TypeCheck.NOT_ASKED:
                device.check_identity()
        return self.identities

    @property
    def bus_counters(self) -> dict[str, BusCounters]:
        """The counters of each Modbus connection, by the name of its first device."""
        devices = [(name, device) for name, device in self.devices.items() if isinstance(device, Device)]
        names = {device.client: name for name, device in reversed(devices)}
        return {name: client.counters for client, name in names.items()}

    @property
    def period_s(self) -> float:
        """The period of the loop in seconds."""
        return 1.0 / self.config.rate_hz

    def measure(self) -> Measurement:
        """Set the current to zero and return one measurement; SmadriveError if a device fails."""
        return self.heater.exchange(0.0)

    def enter_safe_state(self) -> None:
        """Switch the heater off and confirm it by read-back; raises an error if that fails."""
        self.heater.enter_safe_state()

    def excitation(self, start_c: float) -> Excitation:
        """Return the identification experiment of the rig file. The wire is at `start_c` (°C) now."""
        return excitation_path(self.config.excitation, start_c)

    def excite(self, excitation: Excitation, record: TickHandler) -> LoopMetrics:
        """Run the identification experiment, and pass every tick to `record`. Return the metrics of the loop."""
        controller = excitation_controller(self.config, excitation, self.nominal_balance)
        return self._run(controller, self.nominal_balance, None, record)

    def track(
        self,
        reference: Reference,
        wire: WireModel,
        inverse: DisplacementInverse,
        record: TickHandler,
        expected: ExpectedRest | None = None,
        displacement_from: DisplacementFrom | None = None,
    ) -> LoopMetrics:
        """Make the wire track a displacement reference with the given inverse model. Return the metrics of the loop.

        `record` is called with every tick. A jump of the resistance away from `expected` is a fault.
        `displacement_from` replaces the source of the displacement in the rig file.
        """
        source, wire = displacement_from or self.config.displacement_from, self.usable(wire)
        controller = tracking_controller(self.config, reference, wire, inverse, source)
        checks = wire_checks(wire, source, expected, controller.trusts_sensor)
        return self.drive(controller, wire.balance, record, checks)

    def drive(
        self,
        controller: Controller,
        balance: HeatBalance,
        record: TickHandler,
        checks: WireChecks | None = None,
        stop_requested: StopRequested = never,
    ) -> LoopMetrics:
        """Arm, run `controller` to its end, and disarm. Return the metrics of the loop.

        record          called with every tick
        balance         heat balance of the wire; ConfigError if it cannot belong to the rig's wire
        checks          what is known about the wire, and is checked
        stop_requested  called before every exchange; the run ends when it returns True
        """
        self.check_balance(balance)
        if checks is not None:
            checks = usable_checks(checks, self._source)
        return self._run(controller, balance, checks, record, stop_requested)

    def usable(self, wire: WireModel) -> WireModel:
        """Return the wire for runs on this rig: without its resistance if the heat source cannot measure it."""
        return usable_wire(wire, self._source)

    def check_sensing(
        self, wire: WireModel, displacement_from: DisplacementFrom, temperature_c: float
    ) -> tuple[str, ...]:
        """Return warnings about the sensors; ConfigError if the rig cannot use this source (checks/sensing.py)."""
        has_sensor = self.measures("displacement")
        sensing = check_sensing(displacement_from, self._source, wire, temperature_c, has_sensor=has_sensor)
        return *self.caveats, *sensing

    def check_chosen(self, wire: WireModel, chosen: DisplacementFrom, temperature_c: float) -> tuple[str, ...]:
        """Return the warnings of `check_sensing`; ConfigError, too, if `chosen` is a sensor that the rig lacks."""
        check_sensor(chosen, is_measured=self.measures("displacement"))
        return self.check_sensing(wire, chosen, temperature_c)

    def check_balance(self, balance: HeatBalance) -> None:
        """Raise ConfigError if this heat balance cannot belong to the rig's wire; see check_same_wire."""
        check_same_wire(balance, self.nominal_balance, self.config.wire)

    def clear_faults(self) -> Measurement:
        """Clear the latched faults of the devices, then the trip latch. Return a measurement at zero current.

        SafetyError if a fault persists.
        """
        measurement = self.heater.clear_faults()
        self.latch.clear()
        return measurement

    def cool_down(self, duration_s: float) -> None:
        """Let the wire cool for `duration_s` with the heater off."""
        self.enter_safe_state()
        self.clock.sleep_until(self.clock.now_s() + duration_s)

    def _run(
        self,
        controller: Controller,
        balance: HeatBalance,
        checks: WireChecks | None,
        record: TickHandler,
        stop_requested: StopRequested = never,
    ) -> LoopMetrics:
        judge = supervisor(self.config, self.heater, balance, checks, self._last_heat.read())
        if (latched := self.latch.read()) is not None:
            raise SafetyError("refused to arm: the last run tripped", value=latched, cure=CLEAR)
        heater, clock, period_s = self.heater, self.clock, self.period_s
        loop = ControlLoop(heater, controller, judge, clock, period_s, record, stop_requested, self.latch.latch)
        with real_time_scheduling() if isinstance(clock, MonotonicClock) else nullcontext():
            check_rate(self.config, heater, clock)
            with self._last_heat.kept(lambda: judge.heated):
                return loop.run(self.config.limits.watchdog_s)
