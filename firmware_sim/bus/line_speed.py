"""Delays replies on a pseudo-terminal or a socket by the time that a real serial line needs.

    arrival of the reply = time of the request + time of its characters + 3.5 characters of silence
                           + response time of the device + time of the reply's characters

The device carries out the request when its bytes arrive. Only the reply is late.
"""

from __future__ import annotations

from firmware_sim.bus.faults import Delivery
from firmware_sim.bus.ports import Port
from smadrive.modbus.bus import silence_s
from smadrive.modbus.transports.transport import SerialSettings


class SlowLine:
    """Delays the replies of `port`, as a serial line with these `settings` does."""

    def __init__(self, port: Port, settings: SerialSettings) -> None:
        bits = 9 + (settings.parity != "N") + settings.stopbits  # start, data, parity, stop
        self._port = port
        self._character_s = bits / settings.baudrate
        self._silence_s = silence_s(settings.baudrate)
        self._request_end_s = 0.0
        self._reply_end_s = 0.0

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the replies to `data`, which was sent at `time_s`. Each has the time at which it is complete."""
        self._request_end_s = max(self._request_end_s, time_s) + len(data) * self._character_s
        late_s = self._request_end_s - time_s + self._silence_s
        deliveries = []
        for due_s, reply in self._port.receive(data, time_s):
            self._reply_end_s = max(self._reply_end_s, due_s + late_s) + len(reply) * self._character_s
            deliveries.append((self._reply_end_s, reply))
        return deliveries
