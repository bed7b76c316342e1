"""The words of the published status for the state of the heater: the mode, and the end of the command.

Programs read these words on the page and from MQTT, so a word must not change. docs/telemetry.md describes them.
"""

from __future__ import annotations

from enum import StrEnum


class PublishedMode(StrEnum):
    """The field `mode` of the status: what the driver does with the heater.

    OFF            nothing: no run has begun, or the run has ended
    TRACKING, HOLDING, EXCITING, HEATING
                   the loop runs, so the driver may heat the wire at each tick
    UNCONFIRMED    the last try to switch the heater off has failed, so the heater may be on
    """

    OFF = "off"
    TRACKING = "tracking"
    HOLDING = "holding"
    EXCITING = "exciting"
    HEATING = "heating"
    UNCONFIRMED = "off, unconfirmed"

    @property
    def heats(self) -> bool:
        """True in the modes in which the loop runs. False for UNCONFIRMED: the driver does not command any heat."""
        return self not in {PublishedMode.OFF, PublishedMode.UNCONFIRMED}

    @classmethod
    def switched_off(cls, *, confirmed: bool) -> PublishedMode:
        """Return the mode after a try to switch the heater off. `confirmed`: read-back confirmed the heater off."""
        return cls.OFF if confirmed else cls.UNCONFIRMED


class PublishedEnd(StrEnum):
    """The field `end` of the status after the end of the command. Before, the field is None."""

    OFF = "off"
    UNCONFIRMED = "unconfirmed"

    @classmethod
    def switched_off(cls, *, confirmed: bool) -> PublishedEnd:
        """Return the end for the last try to switch the heater off. `confirmed`: read-back confirmed the heater off."""
        return cls.OFF if confirmed else cls.UNCONFIRMED
