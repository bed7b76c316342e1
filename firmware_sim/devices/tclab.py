"""The firmware of a TCLab board. The wire is its first heater, and both thermometers are on the wire.

The board switches a voltage U on and off, so fast that only the mean heat matters. The duty is the fraction of the time
with the voltage on. The command Q1 (0 to 100 %) and the largest pulse width P1 (0 to 255) set the duty:

    duty = floor(Q1 · P1 / 100) / 255        current = √duty · U / R        R: wire, leads and contacts

Like the real board, this firmware has no watchdog, and does not limit current or temperature. An open sensor reads as
the lower end of the converter's range, a shorted sensor as the upper end. An unknown command switches both heaters off.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, sqrt

from firmware_sim.sensors.sensors import Sensors
from smadrive.files.number_text import parse_number

BANNER = "TCLab Firmware 2.0.1 Arduino Uno"
PULSE_MAX = 255
PULSE_FACTORY = {"P1": 200.0, "P2": 100.0}
QUANTUM_C = 0.322265625
"""Resolution of the converter, °C: 3.3 V / 1024, at 10 mV per °C."""
LOWEST_C = -50.0
COUNTS = 1023
SAMPLES = 10
"""Conversions that are averaged into one temperature reading."""


class TCLabFirmware:
    """The firmware, which also handles the requests. It applies `supply_v` in pulses to a load of `load_ohm()`."""

    voltage_max_v = inf

    def __init__(
        self, sensors: Sensors, supply_v: float, load_ohm: Callable[[], float], log_event: Callable[[str], None]
    ) -> None:
        self._sensors = sensors
        self._supply_v = supply_v
        self._load_ohm = load_ohm
        self._log_event = log_event
        self.restart()

    @property
    def current_a(self) -> float:
        """The root mean square of the current pulses, A."""
        pulse = int(self.duty["Q1"] * self.pulse["P1"] / 100.0)
        return sqrt(pulse / PULSE_MAX) * self._supply_v / self._load_ohm()

    def restart(self) -> None:
        """Power up with both heaters off. Opening the port restarts a real board, but not this one."""
        self.duty = {"Q1": 0.0, "Q2": 0.0}
        self.pulse = dict(PULSE_FACTORY)

    def tick(self, _dt_s: float) -> None:
        """Do nothing: the board acts on commands only."""

    def answer(self, pdu: bytes) -> bytes:
        """Carry out a line of text, and return the reply."""
        name, _, rest = pdu.decode("ascii", "replace").partition(" ")
        return self._reply(name.strip().upper(), _float(rest)).encode("ascii", "replace")

    def _reply(self, name: str, value: float) -> str:
        match name:
            case "Q1" | "Q2":
                self._set(name, min(max(value, 0.0), 100.0))
                return f"{self.duty[name]:.3f}"
            case "P1" | "P2":
                self.pulse[name] = min(max(value, 0.0), float(PULSE_MAX))
                return f"{self.pulse[name]:.2f}"
            case "LED":
                return f"{min(max(value, 0.0), 100.0):.2f}"
        shown = {"VER": BANNER, "R1": f"{self.duty['Q1']:.3f}", "R2": f"{self.duty['Q2']:.3f}"}
        shown["T1"] = shown["T2"] = f"{self._temperature_c():.3f}"
        return shown.get(name) or self._switched_off(name)

    def _set(self, name: str, duty: float) -> None:
        if bool(duty) != bool(self.duty[name]):
            self._log_event(f"{name}: heater on, no watchdog" if duty else f"{name}: heater off")
        self.duty[name] = duty

    def _switched_off(self, name: str) -> str:
        """Switch both heaters off, and return the reply to the command A, X or an unknown command."""
        for heater in self.duty:
            self._set(heater, 0.0)
        return {"A": "Start", "X": "Stop"}.get(name, name)

    def _temperature_c(self) -> float:
        ends = {"open": 0.0, "short": float(COUNTS)}
        counts = (self._sensors.temperature_c - LOWEST_C) / QUANTUM_C
        counts = ends.get(self._sensors.unreadable or "", min(max(counts, 0.0), COUNTS))
        return round(counts * SAMPLES) / SAMPLES * QUANTUM_C + LOWEST_C


def _float(text: str) -> float:
    """Return the number in `text`, or 0 if `text` is not a finite number, like the conversion of the Arduino."""
    try:
        number = parse_number(text)
    except ValueError:
        return 0.0
    return number if isfinite(number) else 0.0
