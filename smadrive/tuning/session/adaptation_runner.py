"""The online adaptation of a session: updated at every tick; every `PUBLISH_S` its rules are put in force as a change.

The wire temperature that it learns from is estimated without the displacement: an observer that uses both would explain
a wrong model by a wrong temperature. The estimate begins at the first tick of the session: begun while the wire heats
up, it would start at a thermocouple that lags 15 K behind, and the rules would be bent until it had converged.

After another change the adaptation restarts from the model in force. Undo takes all of it back and ends it. When it
finds that its sensor is faulty, rules that were learnt from the fault are in force already: the rules from before the
fault are put in force once more, and the adaptation ends.
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
    """Switches the adaptation on and off, and publishes its rules."""

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
        """Whether the adaptation is on."""
        return self._adaptation is not None

    def switch(self, on: bool, tuning: Tuning) -> None:
        """Switch it on, from the rules in force, or off.

        ConfigError for a model without rules, and while rules of an ended adaptation wait to be put in force.
        """
        if self._ended is not None:
            raise ConfigError(
                "the adaptation has ended, and its rules from before wait to be put in force", cure="try again"
            )
        if on and not isinstance(tuning.model, TSFuzzyDuhem):
            raise ConfigError("a Duhem model has no rules to adapt", cure="identify with --kind tsfuzzy")
        self._adaptation = self._started_from = None
        if on and isinstance(tuning.model, TSFuzzyDuhem):
            self._adaptation, self._started_from = Adaptation(tuning.model, self._noise_c), tuning
            self._observer = self._observer_of(tuning)
            self._estimate = None if self._estimate is None else self._observer.adopt(self._estimate)

    def _observer_of(self, tuning: Tuning) -> WireObserver:
        wire = WireModel(tuning.model, self._balance)
        return WireObserver(wire, self._period_s, self._noise_c, abs(tuning.model.scale))

    def update(self, tick: Tick, tuning: Tuning, *, is_heating: bool) -> str | None:
        """Learn from a tick while the loop runs; the reason when the adaptation has ended, otherwise None."""
        wire_c = self._wire_c(tick.measurement)
        if self._adaptation is None or not is_heating:
            return None
        if tuning.change != ADAPTED and tuning is not self._started_from:
            self.switch(True, tuning)
        self._adaptation.update(wire_c, tick.measurement.displacement_mm)
        if self._adaptation.lying is None:
            return None
        self._ended, self._adaptation = self._adaptation, None
        return f"adaptation ended: {self._ended.lying}; its rules from before are put in force"

    def _wire_c(self, measurement: Measurement) -> float:
        """The wire temperature by heat balance and thermocouple alone; NaN while it is not known."""
        dt_s, self._time_s = measurement.time_s - self._time_s, measurement.time_s
        power_w = measurement.current_a * measurement.voltage_v
        if not isfinite(power_w):
            self._estimate = None
            return nan
        if self._estimate is None:
            if not isfinite(measurement.temperature_c):
                return nan
            self._estimate = self._observer.start(measurement.temperature_c, measurement.displacement_mm)
        elif dt_s > 0.0:
            self._estimate = self._observer.update(self._estimate, measurement.temperature_c, nan, power_w, dt_s)
        return self._estimate.temperature_c

    def due(self, time_s: float, *, is_heating: bool) -> Adaptation | None:
        """The adaptation whose rules are due to be put in force, if any; an ended one also while the heater is off."""
        if self._ended is not None:
            return self._ended
        if self._adaptation is None or not is_heating or time_s - self._published_s < PUBLISH_S:
            return None
        self._published_s = time_s
        return self._adaptation

    def taken(self) -> None:
        """The rules that were due are on their way into force: those of an ended adaptation are not due again."""
        self._ended = None
