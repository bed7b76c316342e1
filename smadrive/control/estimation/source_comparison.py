"""Compares a displacement sensor with the displacement by the resistance of the wire, and finds which one is wrong.

Each is also compared with the model. The difference d of a source from the model is summed over the ticks, and
forgotten with the time constant `FORGET_S`, so that a slow error of the model does not count:

    d <- d exp(-Δt/FORGET_S) + (change of the source) - (change that the model predicts)

A gap in the readings of the resistance counts as one long tick, in which d of the sensor is not forgotten: the sensor
may slip then. A cold wire, for example, shows no displacement by its resistance. D is the mean difference of sensor and
resistance, with the weight `WEIGHT` of the latest sample. The sensor is implausible in a tick if all of this holds:

    |D| exceeds the limit
    |d| of the sensor exceeds the limit, and 1/`EXPLAINS` of |D| and of the latest difference
    |d| of the resistance is less than half of |d| of the sensor

The limit is `MOST_SHARE` strokes, or `MOST_NOISES` standard deviations of the displacement by the resistance if that is
more. The sensor has failed after `FAILS_TICKS` implausible ticks in a row that last about `FAILS_S` at least. So a slip
is found from some 1.3 times the limit on.

The resistance is implausible in a tick if all of this holds:

    |D| exceeds the limit
    |d| of the resistance exceeds the limit
    |d| of the sensor is less than half of |d| of the resistance

It is wrong, because a contact has changed or a meter shows wrong values, after as many implausible ticks. It is also
taken for wrong if |D| exceeds the limit for `UNDECIDED_S` and neither source is implausible. In both cases d of the
resistance is then set to d of the sensor, so only the motion from now on is compared: the power of the model comes from
the same meters, so both sources may move differently from the model. The resistance is right again when |D| has been
below `MOST_SHARE` strokes for more than `RETURNS_TICKS` ticks in a row.

A sensor whose difference to the resistance has changed over a gap in its readings may have slipped, if the resistance
was right. It is confirmed when it has been plausible for more than `RETURNS_TICKS` ticks in a row, and agrees with the
resistance. Before that, the resistance is not found to be wrong.
"""

from __future__ import annotations

from math import exp, isfinite, nan
from typing import NamedTuple

from smadrive.control.estimation.resistance_sensor import DisplacementReading

FORGET_S = 3.0
MOST_SHARE, MOST_NOISES = 0.03, 2.5
EXPLAINS = 3.0
WEIGHT = 0.2
FAILS_TICKS, FAILS_S = 5, 0.25
UNDECIDED_S = 3.0
RETURNS_TICKS = 20


class Compared(NamedTuple):
    """The state of the comparison.

    apart_mm               difference d between the sensor and the model, mm
    resistance_apart_mm    difference d between the displacement by the resistance and the model, mm
    disagreement_mm        mean difference D of sensor - resistance, mm; NaN before the first difference, and before the
                           first one after a gap in which the sensor may have slipped
    before_mm              displacement by the sensor in the last tick, mm; NaN if there was none
    resistance_due_mm      displacement by the resistance that its last reading and the model predict, mm; NaN before
                           its first reading
    suspect_ticks          number of latest ticks in a row with an implausible sensor
    evidence               share of the ticks with both readings in a row after which the resistance is wrong, 0 to 1
    valid_ticks            number of latest ticks in a row with a plausible reading of the sensor
    has_sensor             True after the first reading of the sensor
    is_confirmed           False after a gap in which the sensor may have slipped, until the sensor is confirmed
    agreeing_ticks         number of latest ticks in a row in which sensor and resistance agreed
    failed                 True once the sensor was implausible for long enough, until the end of the run
    is_resistance_wrong    True while the resistance is wrong, and the sensor has not failed
    """

    apart_mm: float = 0.0
    resistance_apart_mm: float = 0.0
    disagreement_mm: float = nan
    before_mm: float = nan
    resistance_due_mm: float = nan
    suspect_ticks: int = 0
    evidence: float = 0.0
    valid_ticks: int = 0
    has_sensor: bool = False
    is_confirmed: bool = True
    agreeing_ticks: int = 0
    failed: bool = False
    is_resistance_wrong: bool = False

    @property
    def is_valid(self) -> bool:
        """True if the sensor has been plausible for long enough."""
        return self.valid_ticks > RETURNS_TICKS

    @property
    def is_sensor_wrong(self) -> bool:
        """True if the sensor has failed, or has given readings again for a while that the resistance contradicts."""
        return self.failed or (not self.is_confirmed and self.is_valid and isfinite(self.disagreement_mm))

    def wrong_sensor(self) -> Compared:
        """Return the state of a comparison that knows only whether, and why, the sensor is wrong."""
        if not self.is_sensor_wrong:
            return Compared()
        return Compared(
            disagreement_mm=self.disagreement_mm,
            valid_ticks=self.valid_ticks,
            is_confirmed=self.is_confirmed,
            failed=self.failed,
        )


class Differences(NamedTuple):
    """The differences of one tick, mm: d of both sources, sensor - resistance, its mean D, and the limit.

    `may_have_slipped` is True in the first tick after a gap in the readings of the sensor, if it may have slipped then.
    """

    apart_mm: float
    resistance_apart_mm: float
    latest_mm: float
    mean_mm: float
    limit_mm: float
    may_have_slipped: bool

    @property
    def exceed(self) -> bool:
        """True if |D| exceeds the limit. Without a reading of both sources it does not."""
        return isfinite(self.latest_mm) and abs(self.mean_mm) > self.limit_mm

    @property
    def accuse_sensor(self) -> bool:
        """True if the sensor is implausible in this tick."""
        apart_mm, explained_mm = abs(self.apart_mm), max(abs(self.mean_mm), abs(self.latest_mm)) / EXPLAINS
        is_like_model = abs(self.resistance_apart_mm) < 0.5 * apart_mm
        return self.exceed and apart_mm > max(self.limit_mm, explained_mm) and is_like_model

    @property
    def accuse_resistance(self) -> bool:
        """True if the resistance is implausible in this tick."""
        apart_mm = abs(self.resistance_apart_mm)
        return self.exceed and apart_mm > self.limit_mm and abs(self.apart_mm) < 0.5 * apart_mm


class SourceComparison:
    """Compares the sensor with the resistance. `stroke_mm` is the stroke, `period_s` the period of the loop."""

    def __init__(self, stroke_mm: float, period_s: float) -> None:
        self._most_mm = MOST_SHARE * stroke_mm
        self._fails_ticks = max(FAILS_TICKS, round(FAILS_S / period_s))
        self._undecided_ticks = max(FAILS_TICKS, round(UNDECIDED_S / period_s))

    def update(
        self,
        state: Compared,
        sensor: DisplacementReading,
        resistance: DisplacementReading,
        predicted_mm: float,
        dt_s: float,
    ) -> Compared:
        """Return the state after sensor and resistance are compared with each other and with the model.

        `predicted_mm` is the change of the displacement that the model predicts for this tick of `dt_s`.
        """
        now, is_read = self._differences(state, sensor, resistance, predicted_mm, dt_s), isfinite(sensor.mm)
        suspect_ticks = state.suspect_ticks + 1 if now.accuse_sensor else 0
        failed = state.failed or suspect_ticks >= self._fails_ticks
        valid_ticks = state.valid_ticks + 1 if is_read and not now.accuse_sensor else 0
        agree = isfinite(now.latest_mm) and abs(now.mean_mm) < self._most_mm
        agreeing_ticks = state.agreeing_ticks + 1 if agree else 0
        is_agreed = agreeing_ticks > 0 and valid_ticks > RETURNS_TICKS
        is_confirmed = not now.may_have_slipped and (state.is_confirmed or is_agreed)
        evidence = self._evidence(state.evidence, now, is_confirmed=is_confirmed)
        is_found = evidence == 1.0 > state.evidence
        is_wrong = is_found or (state.is_resistance_wrong and agreeing_ticks <= RETURNS_TICKS)
        return Compared(
            apart_mm=now.apart_mm,
            resistance_apart_mm=now.apart_mm if is_found else now.resistance_apart_mm,
            disagreement_mm=now.mean_mm,
            before_mm=sensor.mm,
            resistance_due_mm=resistance.mm if isfinite(resistance.mm) else state.resistance_due_mm + predicted_mm,
            suspect_ticks=suspect_ticks,
            evidence=evidence,
            valid_ticks=valid_ticks,
            has_sensor=state.has_sensor or is_read,
            is_confirmed=is_confirmed,
            agreeing_ticks=agreeing_ticks,
            failed=failed,
            is_resistance_wrong=is_wrong and not failed,
        )

    def _differences(
        self,
        state: Compared,
        sensor: DisplacementReading,
        resistance: DisplacementReading,
        predicted_mm: float,
        dt_s: float,
    ) -> Differences:
        """Return the differences of this tick; `state` is the state before it."""
        is_back = isfinite(sensor.mm) and state.has_sensor and not isfinite(state.before_mm)
        latest_mm = sensor.mm - resistance.mm
        slip_mm = latest_mm - (state.disagreement_mm if isfinite(state.disagreement_mm) else 0.0)
        is_same = state.is_resistance_wrong or abs(slip_mm) < self._most_mm  # not so for NaN: nothing was compared
        may_have_slipped = is_back and not is_same
        moved_mm = _apart(state, sensor.mm, predicted_mm, dt_s if isfinite(resistance.mm) else 0.0)
        return Differences(
            slip_mm if may_have_slipped and isfinite(slip_mm) else moved_mm,
            _resistance_apart(state, resistance.mm, state.resistance_due_mm + predicted_mm, dt_s),
            latest_mm,
            _mean(state.disagreement_mm, latest_mm, is_first=may_have_slipped),
            max(self._most_mm, MOST_NOISES * resistance.noise_mm),  # NaN noise: max returns the first
            may_have_slipped,
        )

    def _evidence(self, before: float, now: Differences, *, is_confirmed: bool) -> float:
        """Return the evidence of a wrong resistance after a tick, from 0 to 1. A tick without both readings adds none.

        `is_confirmed` is False after a gap in which the sensor may have slipped.
        """
        if not isfinite(now.latest_mm):
            return before
        if now.accuse_sensor or not (now.exceed and is_confirmed):
            return 0.0
        return min(1.0, before + 1.0 / (self._fails_ticks if now.accuse_resistance else self._undecided_ticks))


def _apart(state: Compared, now_mm: float, predicted_mm: float, forgets_s: float) -> float:
    """Return d of the sensor after a tick that forgets as in the time `forgets_s`; 0 without two readings in a row."""
    change_mm = now_mm - state.before_mm - predicted_mm
    return exp(-forgets_s / FORGET_S) * state.apart_mm + change_mm if isfinite(change_mm) else 0.0


def _resistance_apart(state: Compared, now_mm: float, due_mm: float, dt_s: float) -> float:
    """Return d of the resistance after a tick of `dt_s` in which the model predicts `due_mm`."""
    change_mm = now_mm - due_mm
    return exp(-dt_s / FORGET_S) * state.resistance_apart_mm + (change_mm if isfinite(change_mm) else 0.0)


def _mean(mean_mm: float, latest_mm: float, *, is_first: bool) -> float:
    """Return the mean difference D after the difference `latest_mm`, which may be NaN.

    `is_first` marks the first reading after a gap in which the sensor may have slipped: earlier ones do not count.
    """
    if is_first or not isfinite(mean_mm):
        return latest_mm
    return mean_mm + WEIGHT * (latest_mm - mean_mm) if isfinite(latest_mm) else mean_mm
