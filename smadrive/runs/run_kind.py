"""The kinds of runs that a log can hold."""

from enum import StrEnum


class RunKind(StrEnum):
    """The kind of a run. Its value is the metadata text `kind` of the log."""

    EXCITATION = "excitation"
    TRACKING = "tracking"
    STEP = "manual step"
    OBSERVATION = "observation"
    OWN_CONTROLLER = "own controller"
    SERVO = "servo"
    SESSION = "tuning"
