"""The comparison of two tunings, which the user has stored in slot A and slot B.

The two tunings drive the wire in turn, one cycle of the running reference each. The score of a cycle is its RMS error.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite, sqrt

from smadrive.errors import ConfigError
from smadrive.tuning.link.requests import Slot
from smadrive.tuning.tuning import Tuning


@dataclass
class Score:
    """The score of the tuning in slot A or B: the RMS error of each cycle that it drove, in percent of the stroke."""

    cycles: list[float] = field(default_factory=list)

    @property
    def mean_percent(self) -> float | None:
        """The RMS error over all cycles, in percent of the stroke. It is None before the first cycle is complete."""
        return sqrt(sum(rms**2 for rms in self.cycles) / len(self.cycles)) if self.cycles else None


class Comparison:
    """The tunings in slots A and B, and their scores. `turn` is the slot whose tuning drives this cycle, or None.

    The tracking error is setpoint minus measured displacement. Without a sensor, the estimated displacement is used.
    """

    def __init__(self) -> None:
        self.slots: dict[Slot, Tuning] = {}
        self.scores: dict[Slot, Score] = {"A": Score(), "B": Score()}
        self.is_on = False
        self.turn: Slot | None = None
        self._squares = 0.0
        self._samples = 0

    def keep(self, slot: Slot, tuning: Tuning) -> None:
        """Store a tuning in slot A or B, and clear the score of this slot."""
        self.slots[slot] = tuning
        self.scores[slot] = Score()

    def slot(self, slot: Slot) -> Tuning:
        """Return the tuning in slot A or B. ConfigError when the slot is empty."""
        if slot not in self.slots:
            raise ConfigError(f"slot {slot} is empty", cure=f"press Keep {slot} first")
        return self.slots[slot]

    def start(self) -> None:
        """Begin the comparison. At the end of the running cycle, the tuning in slot A begins to drive the wire.

        ConfigError when a slot is empty, or both slots hold the same tuning.
        """
        if self.slot("A").drives_as(self.slot("B")):
            raise ConfigError(
                "slot A and slot B hold the same tuning", cure="change the tuning, then press Keep A or Keep B"
            )
        self.is_on, self.turn = True, None

    def stop(self) -> None:
        """End the comparison. The scores stay."""
        self.is_on, self.turn = False, None

    @property
    def next_turn(self) -> Slot:
        """The slot, A or B, whose tuning drives the next cycle."""
        return "B" if self.turn == "A" else "A"

    def sample(self, error_mm: float, stroke_mm: float) -> None:
        """Add the tracking error of one tick to the score of the running cycle. An error of NaN is left out."""
        if isfinite(error_mm):
            self._squares += (100.0 * error_mm / stroke_mm) ** 2
            self._samples += 1

    def end_cycle(self, follows: Slot | None) -> str:
        """Score the complete cycle for the slot that drove it. The tuning in slot `follows` drives the next cycle.

        `follows` is None if the comparison has not put a slot in force yet. Return the text of the event that reports
        score and next slot; it is empty if there is neither.
        """
        texts = [] if follows is None else [f"{follows} drives"]
        if self.turn is not None and self._samples:
            rms_percent = sqrt(self._squares / self._samples)
            self.scores[self.turn].cycles.append(rms_percent)
            texts.insert(0, f"turn of {self.turn}: {rms_percent:.2f} % RMS")
        self.turn = follows
        self._squares, self._samples = 0.0, 0
        return "; ".join(texts)
