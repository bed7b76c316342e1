"""The online adaptation of a session. While the heater is on, every tick adapts the rules of the model.

Every `PUBLISH_S` seconds the adapted rules are put in force. The adaptation needs the wire temperature. This
temperature is estimated without the displacement: an observer that also used the displacement would explain a wrong
model by a wrong temperature. The estimate begins at the first tick of the session, before the session heats the wire.
While the wire heats up, the thermocouple lags 15 K behind. An estimate that began at that time would make the rules
wrong until the estimate had converged.

After a change by the user, the adaptation restarts from the model in force. Undo and redo end the adaptation, and one
undo takes back all changes of the adaptation. A faulty displacement sensor is detected only after some samples, when
rules that were learnt from the fault may be in force. Then the rules from before the fault are put in force again, and
the adaptation ends.

The displacement must come from a sensor. The displacement by the resistance follows from the estimated temperature, so
an error of this temperature would become an error of the rules. While a sensor gives no reading, the resistance
replaces it, and the adaptation pauses. The adaptation ends when the sensor has failed, or when the user chooses another
source.
"""

from __future__ import annotations

from math import isfinite, nan

from smadrive.control.estimation.observer import WireObserver
from smadrive.control.estimation.source_selection import SourceState
from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.control.loop import Tick
from smadrive.errors import ConfigError
from smadrive.hysteresis import DuhemModel
from smadrive.identification.adaptation.adaptation import ADAPTED, Adaptation
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.tuning.tuning import Tuning
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

PUBLISH_S = 2.0

NEEDS_RULES = "a Duhem model has no rules to adapt"
NEEDS_SENSOR = "the adaptation learns from a displacement sensor, and the displacement comes from another source"
SENSOR_FAILED = "the displacement sensor moves differently from the model and the resistance"


class AdaptationRunner:
    """Passes ticks to the online adaptation, and says when the adapted rules are due to be put in force.

    `period_s` is the period of the loop, `noise_c` the noise of the measured temperature in °C.
    """

    def __init__(self, tuning: Tuning, balance: HeatBalance, period_s: float, noise_c: float) -> None:
        self._balance = balance
        self._period_s = period_s
        self._noise_c = noise_c
        self._observer = self._observer_of(tuning)
        self._estimate: WireEstimate | None = None
        self._time_s = self._power_w = 0.0
        self._adaptation: Adaptation | None = None
        self._started_from: Tuning | None = None
        self._published_s = 0.0
        self._ended: Adaptation | None = None

    @property
    def is_on(self) -> bool:
        """True if the adaptation is on."""
        return self._adaptation is not None

    def switch(self, on: bool, tuning: Tuning) -> None:
        """Switch the adaptation on or off. When it is switched on, it begins with the rules of `tuning`.

        ConfigError while the rules of an ended adaptation wait to be put in force. When it is switched on, ConfigError
        also for a model without rules, and for a displacement that does not come from a sensor.
        """
        if self._ended is not None:
            raise ConfigError(
                "the adaptation has ended, and the rules from before the fault are not in force yet", cure="try again"
            )
        if on and isinstance(tuning.model, DuhemModel):
            raise ConfigError(NEEDS_RULES, cure="identify the wire by `smadrive identify --kind tsfuzzy`")
        if on and tuning.displacement_from is not DisplacementFrom.SENSOR:
            source = tuning.displacement_from.value
            raise ConfigError(NEEDS_SENSOR, where="displacement_from", value=source, cure='choose "sensor" first')
        self._adaptation = self._started_from = None
        if on and not isinstance(tuning.model, DuhemModel):
            self._adaptation, self._started_from = Adaptation(tuning.model, self._noise_c), tuning
            before, self._observer = self._observer, self._observer_of(tuning)
            self._estimate = None if self._estimate is None else self._observer.adopt(self._estimate, before)

    def _observer_of(self, tuning: Tuning) -> WireObserver:
        wire = WireModel(tuning.model, self._balance)
        return WireObserver(wire, self._period_s, self._noise_c, abs(tuning.model.scale))

    def update(self, tick: Tick, tuning: Tuning, source: SourceState | None = None, *, is_heating: bool) -> str | None:
        """Estimate the wire temperature in each tick. While adaptation and heater are on, adapt the rules to the tick.

        Return the event to report if the adaptation ends in this tick, otherwise None. `source` is the state of the
        controller's displacement source.
        """
        wire_c = self._wire_c(tick.measurement)
        if self._adaptation is None or not is_heating:
            return None
        if impossible := impossible_with(tuning):
            self._adaptation = self._started_from = None
            return f"adaptation ended: {impossible}"
        if tuning.change != ADAPTED and tuning is not self._started_from:
            self.switch(True, tuning)
        if source is not None and source.compared.failed:
            self._adaptation.end(SENSOR_FAILED)
        is_replaced = source is not None and source.is_replaced
        wire = None if self._estimate is None else self._estimate.hysteresis
        self._adaptation.update(wire_c, nan if is_replaced else tick.measurement.displacement_mm, wire)
        if self._adaptation.sensor_fault is None:
            return None
        self._ended, self._adaptation = self._adaptation, None
        return f"adaptation ended: {self._ended.sensor_fault}; the rules from before the fault are put in force"

    def _wire_c(self, measurement: Measurement) -> float:
        """Return the wire temperature in °C, estimated only from heat balance and thermocouple; NaN if unknown.

        While the power is unknown, the estimate continues with the last known power.
        """
        dt_s, self._time_s = measurement.time_s - self._time_s, measurement.time_s
        power_w = measurement.current_a * measurement.voltage_v
        if is_known := isfinite(power_w):
            self._power_w = power_w
        if self._estimate is None:
            if not isfinite(measurement.temperature_c):
                return nan
            self._estimate = self._observer.start(measurement.temperature_c, measurement.displacement_mm)
        elif dt_s > 0.0:
            self._estimate = self._observer.update(self._estimate, measurement.temperature_c, nan, self._power_w, dt_s)
        return self._estimate.temperature_c if is_known else nan

    def due(self, time_s: float, *, is_heating: bool) -> Adaptation | None:
        """Return the adaptation if its rules are due to be put in force, otherwise None.

        The rules of an ended adaptation are due at once, even while the heater is off.
        """
        if self._ended is not None:
            return self._ended
        if self._adaptation is None or not is_heating or time_s - self._published_s < PUBLISH_S:
            return None
        self._published_s = time_s
        return self._adaptation

    def taken(self) -> None:
        """Note that the change queue has accepted the rules. Then `due` does not return an ended adaptation again."""
        self._ended = None


def impossible_with(tuning: Tuning) -> str:
    """Return the reason why the model of `tuning` cannot be adapted; empty if it can."""
    if isinstance(tuning.model, DuhemModel):
        return NEEDS_RULES
    return "" if tuning.displacement_from is DisplacementFrom.SENSOR else NEEDS_SENSOR
