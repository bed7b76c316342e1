"""The events about the source of the displacement: once for each change, and none for a chosen resistance."""

from smadrive.control.controllers.interface import Command
from smadrive.control.controllers.source_events import (
    BY_RESISTANCE,
    BY_SENSOR,
    RESISTANCE_RIGHT,
    RESISTANCE_WRONG,
    SourceEvents,
)

BY_SENSOR_NOW = Command(0.2)
REPLACED = Command(0.2, uses_resistance=1.0, sensor_replaced=1.0)
MISSING = Command(0.2, sensor_replaced=1.0)
BY_RESISTANCE_NOW = Command(0.2, uses_resistance=1.0)
WRONG = Command(0.2, resistance_wrong=1.0)
BOTH = Command(0.2, sensor_replaced=1.0, resistance_wrong=1.0)


def events(*commands):
    source = SourceEvents()
    return [event for command in commands for event in source.update(command)]


def test_each_change_is_told_once():
    assert events(BY_SENSOR_NOW, REPLACED, MISSING, REPLACED, BY_SENSOR_NOW) == [BY_RESISTANCE, BY_SENSOR]
    assert events(BY_SENSOR_NOW, WRONG, WRONG, BY_SENSOR_NOW) == [RESISTANCE_WRONG, RESISTANCE_RIGHT]


def test_resistance_that_is_chosen_instead_of_a_replaced_sensor_is_no_valid_sensor():
    assert events(REPLACED, BY_RESISTANCE_NOW) == [BY_RESISTANCE]


def test_two_changes_at_once_are_both_told():
    assert events(BOTH, BY_SENSOR_NOW) == [BY_RESISTANCE, RESISTANCE_WRONG, BY_SENSOR, RESISTANCE_RIGHT]
