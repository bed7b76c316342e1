"""Faults of the sensors and of the heater, on demand: what the wire seems to be, and what flows through it.

    thermocouple   open, short (both are told by its converter); bridge, reverse, freeze, stop_conversions, drift, spike
    displacement   stick, spike
    sense          lose_current, lose_voltage (of the device that heats: NaN in a float register)
    heater         short_switch (stuck on), open_switch (stuck off), weaken_current, limit_voltage, corrode_contact,
                   break_wire

Each holds for `for_s` seconds, or until its thing is mended; a thing has one fault at a time, the last one. A script
finds all of them in `by_name`, and gives their parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from random import Random
from typing import Annotated, NamedTuple

from pydantic import Field

from firmware_sim.bus.faults import Seconds

Share = Annotated[float, Field(gt=0, le=1)]
Part = Annotated[float, Field(ge=0, lt=1)]
Positive = Annotated[float, Field(gt=0)]

SENSOR_FAULTS = (
    *("open_thermocouple", "short_thermocouple", "bridge_thermocouple", "reverse_thermocouple", "freeze_thermocouple"),
    *("stop_conversions", "drift_thermocouple", "spike_thermocouple", "mend_thermocouple"),
    *("stick_displacement", "spike_displacement", "mend_displacement"),
    *("lose_current", "lose_voltage", "mend_sense"),
)
HEATER_FAULTS = (
    *("short_switch", "open_switch", "weaken_current", "limit_voltage", "corrode_contact", "break_wire"),
    "mend_heater",
)


HEALTHY = "none"


class Reading(NamedTuple):
    """A sensor's reading on its way out: the right one, the one shown before, and that of the cold junction."""

    right: float
    shown: float
    cold_junction_c: float


Spoil = Callable[[Reading, float], float]  # a reading, and the age of the fault in seconds


class SensorFault:
    """What one sensor suffers from."""

    def __init__(self) -> None:
        self.end()

    def begin(self, name: str, for_s: float | None, spoil: Spoil | None = None) -> None:
        """From now on, and for `for_s` seconds (None: until the end is called for)."""
        self.name = name
        self.spoil = spoil
        self._age_s = 0.0
        self._last_s = inf if for_s is None else for_s

    def end(self) -> None:
        """Nothing is wrong any more."""
        self.begin(HEALTHY, None)

    def pass_time(self, dt_s: float) -> None:
        """Grow older by `dt_s`, and end in time."""
        self._age_s += dt_s
        if self._age_s > self._last_s - 1e-9:
            self.end()

    def shown(self, right: float, shown: float, cold_junction_c: float = 0.0) -> float:
        """What the sensor shows instead of the `right` reading, after it has `shown` another."""
        return right if self.spoil is None else self.spoil(Reading(right, shown, cold_junction_c), self._age_s)


class SensorFaults:
    """What is wrong with `thermocouple`, `displacement`, and the sense of `current` and `voltage`."""

    def __init__(self, seed: int) -> None:
        """`seed` is that of the spikes."""
        self.thermocouple = SensorFault()
        self.displacement = SensorFault()
        self.current = SensorFault()
        self.voltage = SensorFault()
        self._ailments = self.thermocouple, self.displacement, self.current, self.voltage
        self._random = Random(seed)

    def open_thermocouple(self, for_s: Seconds | None = None) -> None:
        """A wire of the thermocouple breaks."""
        self.thermocouple.begin("open", for_s)

    def short_thermocouple(self, for_s: Seconds | None = None) -> None:
        """The thermocouple touches the supply or ground."""
        self.thermocouple.begin("short", for_s)

    def bridge_thermocouple(self, for_s: Seconds | None = None) -> None:
        """Its two wires touch at the converter: it measures the temperature there, and no bit tells."""
        self.thermocouple.begin("bridged", for_s, lambda reading, _age_s: reading.cold_junction_c)

    def reverse_thermocouple(self, for_s: Seconds | None = None) -> None:
        """Its two wires are exchanged: the hotter, the colder it reads."""
        self.thermocouple.begin("reversed", for_s, lambda reading, _age_s: 2 * reading.cold_junction_c - reading.right)

    def freeze_thermocouple(self, for_s: Seconds | None = None) -> None:
        """The converter goes on counting and repeats its last value."""
        self.thermocouple.begin("frozen", for_s, lambda reading, _age_s: reading.shown)

    def stop_conversions(self, for_s: Seconds | None = None) -> None:
        """The converter hangs: neither value nor count changes."""
        self.thermocouple.begin("stopped", for_s)

    def drift_thermocouple(self, rate_c_per_s: float, for_s: Seconds | None = None) -> None:
        """The reading goes away from the temperature, steadily."""
        self.thermocouple.begin("drifting", for_s, lambda reading, age_s: reading.right + rate_c_per_s * age_s)

    def spike_thermocouple(self, height_c: float, share: Share = 0.05, for_s: Seconds | None = None) -> None:
        """A share of the conversions is off by `height_c`."""
        self.thermocouple.begin("spiking", for_s, self._spikes(height_c, share))

    def mend_thermocouple(self) -> None:
        """Undo whatever is wrong with it."""
        self.thermocouple.end()

    def stick_displacement(self, for_s: Seconds | None = None) -> None:
        """The sensor repeats its last value."""
        self.displacement.begin("stuck", for_s, lambda reading, _age_s: reading.shown)

    def spike_displacement(self, height_mm: float, share: Share = 0.05, for_s: Seconds | None = None) -> None:
        """A share of the readings is off by `height_mm`."""
        self.displacement.begin("spiking", for_s, self._spikes(height_mm, share))

    def mend_displacement(self) -> None:
        """Undo whatever is wrong with it."""
        self.displacement.end()

    def lose_current(self, for_s: Seconds | None = None) -> None:
        """The current is measured as NaN."""
        self.current.begin("lost", for_s, lambda _reading, _age_s: nan)

    def lose_voltage(self, for_s: Seconds | None = None) -> None:
        """The voltage is measured as NaN."""
        self.voltage.begin("lost", for_s, lambda _reading, _age_s: nan)

    def mend_sense(self) -> None:
        """Measure current and voltage again."""
        self.current.end()
        self.voltage.end()

    def pass_time(self, dt_s: float) -> None:
        """Let `dt_s` pass, and what is over end."""
        for ailment in self._ailments:
            if ailment.name != HEALTHY:
                ailment.pass_time(dt_s)

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Every fault there is, and its end."""
        return {name: getattr(self, name) for name in SENSOR_FAULTS}

    def _spikes(self, height: float, share: float) -> Spoil:
        return lambda reading, _age_s: reading.right + (height if self._random.random() < share else 0.0)


class Circuit(NamedTuple):
    """What lies between the device that heats and the wire."""

    passed: float = 1.0
    leak_a: float = 0.0
    voltage_max_v: float = inf
    contact_ohm: float = 0.0
    broken: bool = False


INTACT = Circuit()


class HeaterFaults:
    """What is wrong with `circuit`."""

    def __init__(self) -> None:
        self.mend_heater()

    def short_switch(self, leak_a: Positive, for_s: Seconds | None = None) -> None:
        """The switch is stuck on: `leak_a` flows whatever the firmware wants."""
        self._begin(Circuit(leak_a=leak_a), for_s)

    def open_switch(self, for_s: Seconds | None = None) -> None:
        """The switch is stuck off."""
        self._begin(Circuit(passed=0.0), for_s)

    def weaken_current(self, passed: Part = 0.5, for_s: Seconds | None = None) -> None:
        """A part only of the wanted current flows."""
        self._begin(Circuit(passed=passed), for_s)

    def limit_voltage(self, voltage_v: Positive, for_s: Seconds | None = None) -> None:
        """The source cannot give more than this: it holds voltage where it should hold current."""
        self._begin(Circuit(voltage_max_v=voltage_v), for_s)

    def corrode_contact(self, contact_ohm: Positive, for_s: Seconds | None = None) -> None:
        """A crimp gets a resistance, which is measured with the wire's and heats elsewhere."""
        self._begin(Circuit(contact_ohm=contact_ohm), for_s)

    def break_wire(self, for_s: Seconds | None = None) -> None:
        """No current flows any more."""
        self._begin(Circuit(broken=True), for_s)

    def mend_heater(self) -> None:
        """Undo whatever is wrong with it."""
        self._begin(INTACT, None)

    def pass_time(self, dt_s: float) -> None:
        """Let `dt_s` pass, and what is over end."""
        if self.circuit is not INTACT:
            self._left_s -= dt_s
            if self._left_s < 1e-9:
                self.mend_heater()

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Every fault there is, and its end."""
        return {name: getattr(self, name) for name in HEATER_FAULTS}

    def _begin(self, circuit: Circuit, for_s: float | None) -> None:
        self.circuit = circuit
        self._left_s = inf if for_s is None else for_s
