"""A against B on the running reference: they take turns, one cycle each, and every cycle is scored."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite, sqrt

from smadrive.errors import ConfigError
from smadrive.tuning.link.messages import Slot
from smadrive.tuning.tuning import Tuning


@dataclass
class Score:
    """The cycles of one slot: RMS error of each, in percent of the stroke."""

    cycles: list[float] = field(default_factory=list)

    @property
    def mean_percent(self) -> float | None:
        """Over all its cycles; None before the first is complete."""
        return sqrt(sum(rms**2 for rms in self.cycles) / len(self.cycles)) if self.cycles else None


class Comparison:
    """The slots, whose turn it is, and the scores. The error is wanted - measured, or - estimated without a sensor."""

    def __init__(self) -> None:
        self.slots: dict[Slot, Tuning] = {}
        self.scores: dict[Slot, Score] = {"A": Score(), "B": Score()}
        self.is_on = False
        self.turn: Slot | None = None
        self._squares = 0.0
        self._samples = 0

    def keep(self, slot: Slot, tuning: Tuning) -> None:
        """Fill a slot; its old score is void."""
        self.slots[slot] = tuning
        self.scores[slot] = Score()

    def slot(self, slot: Slot) -> Tuning:
        """What a slot keeps; ConfigError when that is nothing."""
        if slot not in self.slots:
            raise ConfigError(f"slot {slot} is empty: keep something in it first")
        return self.slots[slot]

    def start(self) -> None:
        """Begin with A at the end of the running cycle. ConfigError when a slot is empty, or both keep the same."""
        if self.slot("A").drives_as(self.slot("B")):
            raise ConfigError("slot A and slot B keep the same tuning: change something and keep that in one of them")
        self.is_on, self.turn = True, None

    def stop(self) -> None:
        """No more turns; the scores stay."""
        self.is_on, self.turn = False, None

    @property
    def next_turn(self) -> Slot:
        """Whose turn is next."""
        return "B" if self.turn == "A" else "A"

    def sample(self, error_mm: float, stroke_mm: float) -> None:
        """One tick of the cycle."""
        if isfinite(error_mm):
            self._squares += (100.0 * error_mm / stroke_mm) ** 2
            self._samples += 1

    def end_cycle(self, follows: Slot | None) -> None:
        """Score the cycle that is complete; the next one is that of `follows`."""
        if self.turn is not None and self._samples:
            self.scores[self.turn].cycles.append(sqrt(self._squares / self._samples))
        self.turn = follows
        self._squares, self._samples = 0.0, 0
