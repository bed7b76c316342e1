"""Faults of the sensors: the reading that a sensor shows differs from the right reading.

    thermocouple   open, short (which the converter detects); bridge, reverse, freeze, stop_conversions, drift, spike
    displacement   stick, slip, spike
    sense          lose_current, lose_voltage (the device that heats measures NaN)
    hardware       press_estop, silence_sensor_bus, stick_actuator (which a board detects)

Each fault lasts for `for_s` seconds, or until a method ends it: `mend_thermocouple`, `mend_displacement`, `mend_sense`,
`mend_hardware` or `release_estop`. A new fault of a sensor ends the previous fault of this sensor.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from random import Random
from typing import NamedTuple

from firmware_sim.fault_parameters import Seconds, Share

SENSOR_FAULTS = (
    *("open_thermocouple", "short_thermocouple", "bridge_thermocouple", "reverse_thermocouple", "freeze_thermocouple"),
    *("stop_conversions", "drift_thermocouple", "spike_thermocouple", "mend_thermocouple"),
    *("stick_displacement", "slip_displacement", "spike_displacement", "mend_displacement"),
    *("lose_current", "lose_voltage", "mend_sense"),
    *("press_estop", "release_estop", "silence_sensor_bus", "stick_actuator", "mend_hardware"),
)
HEALTHY = "none"


class SensorSample(NamedTuple):
    """The values from which a fault computes a reading.

    right             the right reading
    previous          the reading that the sensor showed last
    cold_junction_c   temperature of the cold junction, °C
    """

    right: float
    previous: float
    cold_junction_c: float


Alter = Callable[[SensorSample, float], float]  # returns the shown reading, from a sample and the fault's age in s


class SensorFault:
    """The present fault of one sensor."""

    def __init__(self) -> None:
        self.end()

    def begin(self, name: str, for_s: float | None, alter: Alter | None = None) -> None:
        """Begin a fault that lasts `for_s` seconds. Without `for_s` it lasts until `end`."""
        self.name = name
        self.alter = alter
        self._age_s = 0.0
        self._duration_s = inf if for_s is None else for_s

    def end(self) -> None:
        """End the fault."""
        self.begin(HEALTHY, None)

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass; the fault ends when its time is over."""
        self._age_s += dt_s
        if self._age_s > self._duration_s - 1e-9:
            self.end()

    def shown(self, right: float, previous: float, cold_junction_c: float = 0.0) -> float:
        """Return the reading that the sensor shows. `right` is the right reading, `previous` the last shown reading."""
        return right if self.alter is None else self.alter(SensorSample(right, previous, cold_junction_c), self._age_s)


class SensorFaults:
    """The faults of thermocouple, displacement sensor, current measurement, voltage measurement and board hardware."""

    def __init__(self, seed: int) -> None:
        """`seed` seeds the spikes."""
        self.thermocouple = SensorFault()
        self.displacement = SensorFault()
        self.current = SensorFault()
        self.voltage = SensorFault()
        self.estop = SensorFault()
        self.sensor_bus = SensorFault()
        self.actuator = SensorFault()
        self.hardware = self.estop, self.sensor_bus, self.actuator
        self._sensors = self.thermocouple, self.displacement, self.current, self.voltage, *self.hardware
        self._random = Random(seed)

    def open_thermocouple(self, for_s: Seconds | None = None) -> None:
        """A wire of the thermocouple breaks."""
        self.thermocouple.begin("open", for_s)

    def short_thermocouple(self, for_s: Seconds | None = None) -> None:
        """The thermocouple touches the supply or ground."""
        self.thermocouple.begin("short", for_s)

    def bridge_thermocouple(self, for_s: Seconds | None = None) -> None:
        """The two wires of the thermocouple touch at the converter.

        The converter then reads the temperature of the cold junction.
        """
        self.thermocouple.begin("bridged", for_s, lambda sample, _age_s: sample.cold_junction_c)

    def reverse_thermocouple(self, for_s: Seconds | None = None) -> None:
        """The two wires of the thermocouple are exchanged: the reading falls when the temperature rises."""
        self.thermocouple.begin("reversed", for_s, lambda sample, _age_s: 2 * sample.cold_junction_c - sample.right)

    def freeze_thermocouple(self, for_s: Seconds | None = None) -> None:
        """The converter repeats its last value, but continues to count conversions."""
        self.thermocouple.begin("frozen", for_s, lambda sample, _age_s: sample.previous)

    def stop_conversions(self, for_s: Seconds | None = None) -> None:
        """The converter stops: its value and its count of conversions stay constant."""
        self.thermocouple.begin("stopped", for_s)

    def drift_thermocouple(self, rate_c_per_s: float, for_s: Seconds | None = None) -> None:
        """The reading drifts away from the temperature at a constant rate."""
        self.thermocouple.begin("drifting", for_s, lambda sample, age_s: sample.right + rate_c_per_s * age_s)

    def spike_thermocouple(self, height_c: float, share: Share = 0.05, for_s: Seconds | None = None) -> None:
        """The fraction `share` of the conversions reads `height_c` too high."""
        self.thermocouple.begin("spiking", for_s, self._spikes(height_c, share))

    def mend_thermocouple(self) -> None:
        """End the fault of the thermocouple."""
        self.thermocouple.end()

    def stick_displacement(self, for_s: Seconds | None = None) -> None:
        """The sensor repeats its last value."""
        self.displacement.begin("stuck", for_s, lambda sample, _age_s: sample.previous)

    def slip_displacement(self, offset_mm: float, for_s: Seconds | None = None) -> None:
        """The sensor, or its target on the wire, has slipped: every reading is `offset_mm` too high."""
        self.displacement.begin("slipped", for_s, lambda sample, _age_s: sample.right + offset_mm)

    def spike_displacement(self, height_mm: float, share: Share = 0.05, for_s: Seconds | None = None) -> None:
        """The fraction `share` of the readings is `height_mm` too high."""
        self.displacement.begin("spiking", for_s, self._spikes(height_mm, share))

    def mend_displacement(self) -> None:
        """End the fault of the displacement sensor."""
        self.displacement.end()

    def lose_current(self, for_s: Seconds | None = None) -> None:
        """The current is measured as NaN."""
        self.current.begin("lost", for_s, lambda _sample, _age_s: nan)

    def lose_voltage(self, for_s: Seconds | None = None) -> None:
        """The voltage is measured as NaN."""
        self.voltage.begin("lost", for_s, lambda _sample, _age_s: nan)

    def mend_sense(self) -> None:
        """End the faults of the measured current and of the measured voltage."""
        self.current.end()
        self.voltage.end()

    def press_estop(self, for_s: Seconds | None = None) -> None:
        """The emergency stop of the board is pressed."""
        self.estop.begin("pressed", for_s)

    def release_estop(self) -> None:
        """The emergency stop of the board is released."""
        self.estop.end()

    def silence_sensor_bus(self, for_s: Seconds | None = None) -> None:
        """The meters of current and voltage of the board do not answer."""
        self.sensor_bus.begin("silent", for_s)

    def stick_actuator(self, for_s: Seconds | None = None) -> None:
        """The current source of the board does not answer. It keeps its set current while its enable line is on."""
        self.actuator.begin("stuck", for_s)

    def mend_hardware(self) -> None:
        """End the faults of the sensor bus and of the current source. The emergency stop stays pressed."""
        self.sensor_bus.end()
        self.actuator.end()

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass; faults end when their time is over."""
        for sensor in self._sensors:
            if sensor.name != HEALTHY:
                sensor.advance(dt_s)

    def by_name(self) -> dict[str, Callable[..., None]]:
        """Return every fault, and the methods that end faults, by name."""
        return {name: getattr(self, name) for name in SENSOR_FAULTS}

    def _spikes(self, height: float, share: float) -> Alter:
        return lambda sample, _age_s: sample.right + (height if self._random.random() < share else 0.0)
