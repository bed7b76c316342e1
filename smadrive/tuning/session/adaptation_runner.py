"""The online adaptation of a session: fed at every tick, its rules put in force every `PUBLISH_S` as any other change.

The temperature it learns from is estimated without the displacement: an observer that sees both would explain a wrong
model by a wrong temperature. It is estimated from the session's first tick on: begun while the wire heats up, it would
start at a thermocouple that lags 15 K behind, and bend the rules until it had found the wire.

The adaptation goes on from whatever model is in force: after a change by hand it starts afresh from that. Undo takes
all of it back and ends it. When it finds its sensor lying, what it learnt by the lie is in force already: its rules of
well before are handed out once more, and then it has ended.
"""

from __future__ import annotations

from math import isfinite, nan

from smadrive.control.estimation.observer import WireEstimate, WireObserver
from smadrive.control.loop import Tick
from smadrive.errors import ConfigError
from smadrive.hysteresis import TSFuzzyDuhem
from smadrive.identification.adaptation import Adaptation
from smadrive.measurement import Measurement
from smadrive.tuning.tuning import ADAPTED, Tuning
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

PUBLISH_S = 2.0


class AdaptationRunner:
    """The switch and what hangs on it."""

    def __init__(self, tuning: Tuning, balance: HeatBalance, period_s: float, noise_c: float) -> None:
        self._balance = balance
        self._period_s = period_s
        self._noise_c = noise_c
        self._observer = self._observer_of(tuning)
        self._estimate: WireEstimate | None = None
        self._time_s = 0.0
        self._adaptation: Adaptation | None = None
        self._started_from: Tuning | None = None
        self._published_s = 0.0
        self._ended: Adaptation | None = None

    @property
    def is_on(self) -> bool:
        """Whether the rules are adapted."""
        return self._adaptation is not None

    def switch(self, on: bool, tuning: Tuning) -> None:
        """On, from the rules in force, or off. ConfigError for a model without rules, or while rules are taken back."""
        if self._ended is not None:
            raise ConfigError("the adaptation has ended, and its rules of well before wait for their turn: try again")
        if on and not isinstance(tuning.model, TSFuzzyDuhem):
            raise ConfigError("a Duhem model has no rules to adapt: identify with --kind tsfuzzy")
        self._adaptation = self._started_from = None
        if on and isinstance(tuning.model, TSFuzzyDuhem):
            self._adaptation, self._started_from = Adaptation(tuning.model, self._noise_c), tuning
            self._observer = self._observer_of(tuning)
            self._estimate = None if self._estimate is None else self._observer.adopt(self._estimate)

    def _observer_of(self, tuning: Tuning) -> WireObserver:
        wire = WireModel(tuning.model, self._balance)
        return WireObserver(wire, self._period_s, self._noise_c, abs(tuning.model.scale))

    def update(self, tick: Tick, tuning: Tuning, *, is_heating: bool) -> str | None:
        """Learn from a tick, while the loop runs; why it has ended, None while it goes on or is off."""
        wire_c = self._wire_c(tick.measurement)
        if self._adaptation is None or not is_heating:
            return None
        if tuning.change != ADAPTED and tuning is not self._started_from:
            self.switch(True, tuning)
        self._adaptation.update(wire_c, tick.measurement.displacement_mm)
        if self._adaptation.lying is None:
            return None
        self._ended, self._adaptation = self._adaptation, None
        return f"adaptation ended: {self._ended.lying}; its rules of well before are put in force"

    def _wire_c(self, measured: Measurement) -> float:
        """The wire's temperature by heat and thermocouple alone; NaN while that is not known."""
        dt_s, self._time_s = measured.time_s - self._time_s, measured.time_s
        power_w = measured.current_a * measured.voltage_v
        if not isfinite(power_w):
            self._estimate = None
            return nan
        if self._estimate is None:
            if not isfinite(measured.temperature_c):
                return nan
            self._estimate = self._observer.start(measured.temperature_c, measured.displacement_mm)
        elif dt_s > 0.0:
            self._estimate = self._observer.update(self._estimate, measured.temperature_c, nan, power_w, dt_s)
        return self._estimate.temperature_c

    def due(self, time_s: float, *, is_heating: bool) -> Adaptation | None:
        """The adaptation whose rules are to be put in force now; those of one that has ended, heating or not."""
        if self._ended is not None:
            return self._ended
        if self._adaptation is None or not is_heating or time_s - self._published_s < PUBLISH_S:
            return None
        self._published_s = time_s
        return self._adaptation

    def taken(self) -> None:
        """What was due is on its way into force: what an ended adaptation leaves is handed out no more."""
        self._ended = None
