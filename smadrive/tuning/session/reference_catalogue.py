"""The references that a page can start: those of the session by their names, and any other in its one-line form.

Their tables are made between two ticks, so they are bounded by what that takes: at `LONGEST_S` half a period of 20 Hz.
On the page a reference begins again by itself; one that is longer is tracked by `smadrive run`.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

from smadrive.control.references.reference import Reference, check_length
from smadrive.control.references.shapes import parse_reference
from smadrive.errors import ConfigError, DataError
from smadrive.measurement import Measurement
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.tuning.tuning import Tuning
from smadrive.wire.wire_model import travel_mm

LONGEST_S = 600.0

APPROACH_S = 10.0
"""How long the wire takes to come to the beginning of a reference, and back to it where its ends differ."""


class ReferenceCatalogue:
    """The references of a session by their names. ConfigError for one that is too long for the page."""

    def __init__(self, references: Mapping[str, Reference]) -> None:
        for name, reference in references.items():
            try:
                check_length(reference.cycle_s, reference.times_s.size - 1, LONGEST_S)
            except DataError as error:
                raise ConfigError(f"'{name}' on the tuning page: {error}; `smadrive run` takes longer ones") from None
        self._references = references

    @property
    def names(self) -> list[str]:
        """In the order in which they were given."""
        return list(self._references)

    def path(self, name: str | None, tuning: Tuning, from_mm: float) -> Reference:
        """A reference by its name or its one-line form, from where the wire is wanted now; None: to stay there."""
        if name is None:
            return _staying(from_mm)
        wanted = self._references.get(name) or parse_reference(name, LONGEST_S)
        wanted.check_within(travel_mm(tuning.model))
        return wanted.with_approach(from_mm, APPROACH_S).without_end(APPROACH_S)

    def hold(self, tuning: Tuning, measured: Measurement) -> Reference:
        """Staying where the wire is, by its sensor, but held to what the model can reach at its temperature.

        A sensor without its zero must not heat a cold wire.
        """
        model, temperature_c, displacement_mm = tuning.model, measured.temperature_c, measured.displacement_mm
        if not isfinite(displacement_mm):
            displacement_mm = model.initial_state(temperature_c).y
        return _staying(DisplacementBand(model).nearest_mm(temperature_c, displacement_mm))


def _staying(at_mm: float) -> Reference:
    return Reference.from_samples([0.0, 1.0], [at_mm, at_mm])
