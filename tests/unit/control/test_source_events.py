"""The events about the source of the displacement: once for each change, and none for a source that is chosen."""

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.source_events import (
    BY_NOTHING,
    BY_RESISTANCE,
    BY_SENSOR,
    RESISTANCE_RIGHT,
    RESISTANCE_WRONG,
    SourceEvents,
)

PLAIN = Command(0.2)
REPLACED = Command(0.2, uses_resistance=1.0, sensor_replaced=1.0)
MISSING = Command(0.2, sensor_replaced=1.0)
WRONG = Command(0.2, resistance_wrong=1.0)
BOTH = Command(0.2, sensor_replaced=1.0, resistance_wrong=1.0)


def events(*commands, chooses_sensor=True):
    """Return the events of these commands. With `chooses_sensor`, an unreplaced sensor is the source."""
    source = SourceEvents()
    return [
        event
        for command in commands
        for event in source.update(command, by_sensor=chooses_sensor and not command.sensor_replaced)
    ]


def test_each_change_is_told_once():
    assert events(PLAIN, REPLACED, MISSING, REPLACED, PLAIN) == [BY_RESISTANCE, BY_SENSOR]
    assert events(PLAIN, WRONG, WRONG, PLAIN) == [RESISTANCE_WRONG, RESISTANCE_RIGHT]


def test_another_chosen_source_makes_neither_source_right():
    assert events(REPLACED, PLAIN, chooses_sensor=False) == [BY_RESISTANCE]
    assert events(WRONG, PLAIN, chooses_sensor=False) == [RESISTANCE_WRONG]


def test_wrong_resistance_is_not_said_to_replace_the_sensor():
    assert events(WRONG, BOTH, WRONG) == [RESISTANCE_WRONG, BY_NOTHING, BY_SENSOR]
