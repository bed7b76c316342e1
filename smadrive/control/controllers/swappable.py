"""A tracking controller that can be replaced between two ticks; the new one continues from the state of the old one."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.estimation.source_selection import SourceState
from smadrive.control.references.reference import Reference
from smadrive.hysteresis.turning_points import Memory
from smadrive.measurement import Measurement


class SwappableController:
    """Runs a tracking controller without end. `at_tick` is called before every update and may swap the controller."""

    duration_s = inf

    def __init__(self, controller: TrackingController, reference: Reference, at_tick: Callable[[], None]) -> None:
        self.reference = reference
        self.time_s = 0.0
        self._controller = controller
        self._at_tick = at_tick
        self._began_s = 0.0
        self.command = Command(0.0)
        """The last command."""

    @property
    def reference_s(self) -> float:
        """The time since the reference began, in seconds."""
        return self.time_s - self._began_s

    @property
    def setpoint_mm(self) -> float:
        """The present value of the reference, in mm."""
        return self.reference.value_mm(self.reference_s)

    @property
    def memory(self) -> Memory | None:
        """The estimated memory of the wire; None before the first update, and for a model without memory."""
        state = self._controller.state
        return None if state is None else state.prediction.before.hysteresis.memory

    @property
    def source(self) -> SourceState | None:
        """The state of the selection of the displacement's source; None before the first update."""
        state = self._controller.state
        return None if state is None else state.source

    def trusts_sensor(self) -> bool:
        """Return False while the displacement sensor gives wrong readings."""
        return self._controller.trusts_sensor()

    def update(self, time_s: float, measurement: Measurement, dt_s: float) -> Command:
        """Call `at_tick`, and return the command of the controller for this measurement."""
        self.time_s = time_s
        self._at_tick()
        self.command = self._controller.update(self.reference_s, measurement, dt_s)
        return self.command

    def swap(self, controller: TrackingController, reference: Reference) -> None:
        """Replace the old controller by `controller`, which takes over its state.

        The output jumps only if the error is large.

        If `reference` is a new one, it begins now; otherwise the present reference continues.
        """
        controller.take_over(self._controller)
        self._controller = controller
        if reference is not self.reference:
            self.reference, self._began_s = reference, self.time_s
