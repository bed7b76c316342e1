"""The events of a run about its source of the displacement: the sensor is replaced, or the resistance is wrong."""

from __future__ import annotations

from smadrive.control.controllers.interface import Command

BY_RESISTANCE = "warning: the displacement sensor has failed, the resistance of the wire replaces it"
BY_NOTHING = "warning: the displacement sensor has failed, and the resistance is wrong: the displacement is not known"
BY_SENSOR = "the displacement sensor is valid again and used"
"""The texts of the events when the sensor is replaced, fails without a replacement, and is used again."""

RESISTANCE_WRONG = (
    "warning: the resistance of the wire contradicts the displacement sensor, and replaces no sensor: "
    "check the contacts, the leads, and how the sensor is mounted"
)
RESISTANCE_RIGHT = "the resistance of the wire agrees with the displacement sensor again"
"""The texts of the events when the resistance begins and ceases to contradict a right sensor."""


class SourceEvents:
    """Compares each command of a run with the one before, and tells what has changed."""

    def __init__(self) -> None:
        self._is_replaced = self._is_wrong = False

    def update(self, command: Command, *, by_sensor: bool) -> list[str]:
        """Return the texts of the events that the next command of the run brings; usually none.

        `by_sensor` is True if the displacement for this command comes from the sensor.
        """
        was_replaced, self._is_replaced = self._is_replaced, bool(command.sensor_replaced)
        was_wrong, self._is_wrong = self._is_wrong, bool(command.resistance_wrong)
        events = []
        if self._is_replaced and not was_replaced:
            events.append(BY_NOTHING if self._is_wrong else BY_RESISTANCE)
        if by_sensor and was_replaced and not self._is_replaced:
            events.append(BY_SENSOR)
        if self._is_wrong and not was_wrong:
            events.append(RESISTANCE_WRONG)
        if by_sensor and was_wrong and not self._is_wrong:
            events.append(RESISTANCE_RIGHT)
        return events
