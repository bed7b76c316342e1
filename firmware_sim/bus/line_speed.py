"""A line as slow as the real one: every character takes its time, a pseudo-terminal or a socket would pass it at once.

    reply there = request there + time of its characters + 3.5 characters of silence + what the device takes
                  + time of the reply's characters

The request is carried out when its bytes come; only what is seen of it from outside is late.
"""

from __future__ import annotations

from firmware_sim.bus.faults import Delivery
from firmware_sim.bus.ports import Port
from smadrive.modbus.bus import silence_s
from smadrive.modbus.transports.transport import SerialSettings


class SlowLine:
    """`port` at the far end of a line that is set like `settings`."""

    def __init__(self, port: Port, settings: SerialSettings) -> None:
        bits = 9 + (settings.parity != "N") + settings.stopbits  # start, data, parity, stop
        self._port = port
        self._character_s = bits / settings.baudrate
        self._silence_s = silence_s(settings.baudrate)
        self._heard_s = 0.0
        self._told_s = 0.0

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """What is answered to the bytes that are sent at `time_s`, and when it has arrived."""
        self._heard_s = max(self._heard_s, time_s) + len(data) * self._character_s
        late_s = self._heard_s - time_s + self._silence_s
        deliveries = []
        for due_s, reply in self._port.receive(data, time_s):
            self._told_s = max(self._told_s, due_s + late_s) + len(reply) * self._character_s
            deliveries.append((self._told_s, reply))
        return deliveries
