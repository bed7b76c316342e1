"""The rig: where the two columns meet. Config → transport, device, controller, loop.

A `Rig` owns the port while its context lasts and offers what a bench does: `probe`, `excite`, `track`, `switch_off`.
Nothing here computes and nothing here talks to a bus: it connects those who do.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from smadrive.clock import Clock, VirtualClock
from smadrive.control.controller import Controller, TemperatureController, TrackingController
from smadrive.control.feedback import PIGains
from smadrive.control.feedforward import DisplacementFeedforward, DisplacementInverse
from smadrive.control.loop import ControlLoop, LoopFigures, Tick, ends_safe
from smadrive.control.observer import WireObserver
from smadrive.control.reference import Reference
from smadrive.control.supervisor import SafetyLimits, Supervisor
from smadrive.device.device import Device
from smadrive.device.heater import HeaterBoard, HeaterLimits
from smadrive.device.profile import Profile, load_profile
from smadrive.errors import ConfigError
from smadrive.hysteresis import HysteresisModel
from smadrive.identification.excitation import Excitation, nested_reversals
from smadrive.modbus.connect import open_transport
from smadrive.modbus.master import Master
from smadrive.modbus.transport import Transport
from smadrive.rigconfig import RigConfig, load_wire
from smadrive.thermal import HeatBalance

Record = Callable[[Tick], None]


class Rig:
    """The devices of a rig file, connected. A context manager: leaving it puts every device into its safe state.

    `transport` takes the place of the connection that the rig file names. `clock` is the time the loops run in; without
    it that of the connection: real on a port, virtual on `sim://`.
    """

    def __init__(self, config: RigConfig, clock: Clock | None = None, transport: Transport | None = None) -> None:
        if len(config.devices) != 1:
            raise ConfigError(
                f"rig '{config.name}': {len(config.devices)} devices; this version drives rigs of one board"
            )
        self.config = config
        self.nominal_balance = load_wire(config.wire).heat_balance()
        self._clock = clock
        self._given_transport = transport

    def __enter__(self) -> Self:
        """Open the port, check who is there, put it into its safe state."""
        device_config = self.config.devices[0]
        profile = load_profile(device_config.profile)
        with ExitStack() as stack:
            transport = stack.enter_context(self._given_transport or _open(device_config.url, profile))
            self.clock = self._clock or transport.clock
            device = Device(profile, Master(transport), unit_id=device_config.unit_id)
            limits = HeaterLimits(self.config.limits.current_max_a, self.config.limits.temperature_max_c)
            self.heater = HeaterBoard(device, limits, self.clock)
            self.heater.connect()
            stack.enter_context(ends_safe(self.heater))
            self._on_exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Safe state, then close the port, whatever happened; what happened stays the error that is told."""
        self._on_exit.__exit__(kind, error, trace)

    @property
    def identity(self) -> str:
        """What the device proved to be."""
        profile = self.heater.device.profile.profile
        return f"{profile.id} ({profile.vendor})"

    @property
    def period_s(self) -> float:
        """The loop's period."""
        return 1.0 / self.config.rate_hz

    def excitation(self, start_c: float) -> Excitation:
        """The identification experiment of the rig file, for a wire found at `start_c`."""
        plan = self.config.excitation
        return nested_reversals(plan.low_c, plan.high_c, plan.rate_c_per_s, min(start_c, plan.high_c))

    def excite(self, excitation: Excitation, record: Record) -> LoopFigures:
        """Run the identification experiment; every tick goes to `record`."""
        balance = self.nominal_balance
        controller = TemperatureController(
            excitation.temperature_c,
            excitation.duration_s,
            balance,
            self._gains(balance, slower=2.0),
            self.config.limits.current_max_a,
        )
        return self._run(controller, record)

    def track(
        self,
        reference: Reference,
        model: HysteresisModel,
        balance: HeatBalance,
        inverse: DisplacementInverse,
        record: Record,
    ) -> LoopFigures:
        """Follow a displacement reference with the given inverse; every tick goes to `record`."""
        controller = TrackingController(
            reference,
            WireObserver(balance, model, self.period_s, self.config.feedback.noise_c),
            DisplacementFeedforward(inverse, model, balance),
            balance,
            self._gains(balance, slower=1.0),
            self.config.limits.current_max_a,
        )
        return self._run(controller, record)

    def rest(self, duration_s: float) -> None:
        """Let the wire cool with the heater off."""
        self.heater.enter_safe_state()
        self.clock.sleep_until(self.clock.now_s() + duration_s)

    def _gains(self, balance: HeatBalance, slower: float) -> PIGains:
        feedback = self.config.feedback
        return PIGains.for_balance(balance, slower * feedback.closed_loop_s, feedback.integral_s)

    def _run(self, controller: Controller, record: Record) -> LoopFigures:
        limits = self.config.limits
        supervisor = Supervisor(SafetyLimits(limits.temperature_max_c, limits.stale_after_s))
        loop = ControlLoop(self.heater, controller, supervisor, self.clock, self.period_s, record)
        return loop.run(limits.watchdog_s)


def _open(url: str, profile: Profile) -> Transport:
    """The transport of a URL; `sim://NAME` is a simulated device in this process, in virtual time."""
    if not url.startswith("sim://"):
        return open_transport(url, profile.serial_settings())
    from firmware_sim.config import load_sim  # noqa: PLC0415  (a door to the simulator: only this URL opens it)
    from firmware_sim.device import SimulatedDevice  # noqa: PLC0415

    clock = VirtualClock()
    device = SimulatedDevice.from_config(load_sim(url.removeprefix("sim://")))
    clock.follow(device.advance_to)
    return device.transport(clock)
