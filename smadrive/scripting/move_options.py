"""The options of a move, their default values and their limits."""

from __future__ import annotations

from typing import NamedTuple

from smadrive.control.references.holding import PEAK
from smadrive.control.references.limits import LONGEST_S
from smadrive.errors import ConfigError
from smadrive.scripting.arguments import positive_number

MOVE_S = 10.0
"""Duration of a move through the whole travel, at the default speed."""

TOLERANCE = 0.01
"""The default tolerance of a move, as a share of the travel."""

SETTLE_S = 1.0
TIMEOUT_S = 30.0


class MoveOptions(NamedTuple):
    """The options of `Servo.move`, which explains them."""

    speed_mm_per_s: float
    tolerance_mm: float
    settle_s: float
    timeout_s: float


def move_options(
    limits_mm: tuple[float, float],
    speed_mm_per_s: float | None = None,
    tolerance_mm: float | None = None,
    settle_s: float = SETTLE_S,
    timeout_s: float = TIMEOUT_S,
) -> MoveOptions:
    """Return the options of a move of a wire with this travel; None stands for the default value.

    ConfigError for a number that is not positive (`settle_s` may be 0), and for a speed at which a move through the
    whole travel takes longer than `LONGEST_S`.
    """
    given = MoveOptions(
        _speed_mm_per_s(limits_mm, MOVE_S) if speed_mm_per_s is None else speed_mm_per_s,
        TOLERANCE * (limits_mm[1] - limits_mm[0]) if tolerance_mm is None else tolerance_mm,
        settle_s,
        timeout_s,
    )
    numbers = (positive_number(value, name, may_be_zero=name == "settle_s") for name, value in given._asdict().items())
    options, least = MoveOptions(*numbers), _speed_mm_per_s(limits_mm, LONGEST_S)
    if options.speed_mm_per_s < least:
        raise ConfigError(
            "too slow",
            where="speed_mm_per_s",
            value=f"{options.speed_mm_per_s:g} mm/s",
            limit=f"{least:.2g} mm/s",
            cure=f"choose a speed at which a move through the whole travel takes at most {LONGEST_S:g} s",
        )
    return options


def _speed_mm_per_s(limits_mm: tuple[float, float], duration_s: float) -> float:
    """Return the greatest speed of a move through the whole travel that lasts `duration_s`."""
    return PEAK * (limits_mm[1] - limits_mm[0]) / duration_s
