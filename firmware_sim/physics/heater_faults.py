"""Faults of the heater circuit, which connects the device that heats to the wire.

    short_switch (stuck on), open_switch (stuck off), weaken_current, limit_voltage, corrode_contact, break_wire

Each fault lasts for `for_s` seconds, or until `mend_heater`. A new fault ends the previous one.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from firmware_sim.fault_parameters import Fraction, Positive, Seconds

HEATER_FAULTS = (
    *("short_switch", "open_switch", "weaken_current", "limit_voltage", "corrode_contact", "break_wire"),
    "mend_heater",
)


class Circuit(NamedTuple):
    """The circuit between the device that heats and the wire.

    passed          fraction of the set current that flows
    leak_a          least current, even if the device sets zero
    voltage_max_v   highest voltage of the source
    contact_ohm     resistance in series with the wire
    broken          True if no current can flow
    """

    passed: float = 1.0
    leak_a: float = 0.0
    voltage_max_v: float = inf
    contact_ohm: float = 0.0
    broken: bool = False


INTACT = Circuit()


class HeaterFaults:
    """The faults of the heater circuit.

    `circuit` is the present state of the circuit; the methods damage and mend it.
    """

    def __init__(self) -> None:
        self.mend_heater()

    def short_switch(self, leak_a: Positive, for_s: Seconds | None = None) -> None:
        """The switch is stuck on: at least `leak_a` flows, even if the firmware sets zero."""
        self._begin(Circuit(leak_a=leak_a), for_s)

    def open_switch(self, for_s: Seconds | None = None) -> None:
        """The switch is stuck off: no current flows."""
        self._begin(Circuit(passed=0.0), for_s)

    def weaken_current(self, passed: Fraction = 0.5, for_s: Seconds | None = None) -> None:
        """Only the fraction `passed` of the set current flows."""
        self._begin(Circuit(passed=passed), for_s)

    def limit_voltage(self, voltage_v: Positive, for_s: Seconds | None = None) -> None:
        """The source is limited to `voltage_v`, so it may not reach the set current."""
        self._begin(Circuit(voltage_max_v=voltage_v), for_s)

    def corrode_contact(self, contact_ohm: Positive, for_s: Seconds | None = None) -> None:
        """A crimp has a resistance in series with the wire. The heat of this resistance does not reach the wire."""
        self._begin(Circuit(contact_ohm=contact_ohm), for_s)

    def break_wire(self, for_s: Seconds | None = None) -> None:
        """The wire is broken: no current flows."""
        self._begin(Circuit(broken=True), for_s)

    def mend_heater(self) -> None:
        """End the present fault."""
        self._begin(INTACT, None)

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass; the fault ends when its time is over."""
        if self.circuit is not INTACT:
            self._left_s -= dt_s
            if self._left_s < 1e-9:
                self.mend_heater()

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Return every fault, and the method that ends a fault, by name."""
        return {name: getattr(self, name) for name in HEATER_FAULTS}

    def _begin(self, circuit: Circuit, for_s: float | None) -> None:
        self.circuit = circuit
        self._left_s = inf if for_s is None else for_s
