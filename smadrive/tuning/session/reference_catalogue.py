"""The references that a page can start: by name, or by a one-line form such as `sine:low_mm=2,high_mm=9,period_s=56`.

The table of a reference is computed between two ticks, so its duration is limited to `LONGEST_S`. At this duration, the
computation takes half a period of a loop at 20 Hz. A reference of the page is repeated without end. `smadrive run` can
track a longer reference.
"""

from __future__ import annotations

from collections.abc import Mapping

from smadrive.control.references.holding import APPROACH_S, constant_reference
from smadrive.control.references.limits import check_length
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import parse_reference
from smadrive.errors import ConfigError, DataError
from smadrive.tuning.tuning import Tuning
from smadrive.wire.wire_model import travel_mm

LONGEST_S = 600.0


class ReferenceCatalogue:
    """The references of a session by their names.

    ConfigError for a reference that is longer than `LONGEST_S`, too short, or has too many samples.
    """

    def __init__(self, references: Mapping[str, Reference]) -> None:
        for name, reference in references.items():
            try:
                check_length(reference.cycle_s, reference.times_s.size - 1, LONGEST_S)
            except DataError as error:
                raise ConfigError(
                    error.what,
                    where=f"reference '{name}' of the tuning page",
                    value=error.value,
                    limit=error.limit,
                    cure=f"{error.cure or 'shorten it'}, or track it by `smadrive run`",
                ) from None
        self._references = references

    @property
    def names(self) -> list[str]:
        """The names of the references, in the order in which the references were given."""
        return list(self._references)

    def path(self, name: str | None, tuning: Tuning, from_mm: float) -> Reference:
        """Return a reference by its name or one-line form, repeated without end.

        It begins with a move from the present setpoint `from_mm`. If `name` is None, the reference stays at `from_mm`.
        ConfigError or DataError when `name` is neither a known name nor a one-line form, or when the reference is too
        long, or leaves the travel of the wire of `tuning`.
        """
        if name is None:
            return constant_reference(from_mm)
        reference = self._references.get(name) or parse_reference(name, LONGEST_S)
        reference.check_within(travel_mm(tuning.model))
        return reference.with_approach(from_mm, APPROACH_S).without_end(APPROACH_S)  # the way back takes as long
