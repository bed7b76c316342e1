"""The events of a run about its source of the displacement: the sensor is replaced, or the resistance is wrong."""

from __future__ import annotations

from smadrive.control.controllers.interface import Command

BY_RESISTANCE = "warning: the displacement sensor has failed, the resistance of the wire replaces it"
BY_SENSOR = "the displacement sensor is valid again and used"
"""The texts of the events when the resistance begins to replace the sensor, and when the sensor is used again."""

RESISTANCE_WRONG = (
    "warning: the resistance of the wire is wrong and replaces no sensor: check the contacts and the leads"
)
RESISTANCE_RIGHT = "the resistance of the wire is right again"
"""The texts of the events when the resistance begins and ceases to contradict a right sensor."""


class SourceEvents:
    """Compares each command of a run with the one before, and tells what has changed."""

    def __init__(self) -> None:
        self._is_replaced = self._is_wrong = False

    def update(self, command: Command) -> list[str]:
        """Return the texts of the events that the next command of the run brings; usually none."""
        was_replaced, self._is_replaced = self._is_replaced, bool(command.sensor_replaced)
        was_wrong, self._is_wrong = self._is_wrong, bool(command.resistance_wrong)
        events = []
        if self._is_replaced and not was_replaced:
            events.append(BY_RESISTANCE)
        if was_replaced and not (self._is_replaced or command.uses_resistance):
            events.append(BY_SENSOR)
        if self._is_wrong is not was_wrong:
            events.append(RESISTANCE_WRONG if self._is_wrong else RESISTANCE_RIGHT)
        return events
