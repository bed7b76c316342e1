"""Estimate of wire temperature and phase from heater power, lagging thermocouple and, if measured, displacement.

State x = (T, T_tc, d, b, ξ): wire temperature, thermocouple temperature, a slowly drifting power d that the heat
balance does not explain (draft, wrong h A), the shift b of the transformation by a changed load, and the phase. The
input of the hysteresis model is T - b. The measured displacement gives the phase; without it, b stays constant. The
prediction uses the heat balance with the latent heat of the transformation, and the hysteresis model. The correction
uses a Kalman gain.

The hysteresis model is linear only locally. Its rules i, at their firing strengths μ_i, give the slope of the phase
over the temperature, dξ/dT ∝ Σ μ_i (a_i w + b_i), with w the state of the hysteresis model. Along the loop only this
slope varies, so the gain is solved for several slopes and interpolated (see gain.py). The temperature steps the
hysteresis model through a dead band, because noise reverses the temperature, and each reversal would move the model
along a minor loop (ratcheting). Without a measured displacement, the step ends at the corrected temperature: if a draft
has cooled the wire, the model follows the cooling branch, as the wire does.

A draft multiplies the heat loss h A (T - T_amb). So a large unexplained power d changes in proportion to T - T_amb
between two updates. A draft changes d within a second. An innovation test (innovation.py) finds this change, and the
gains are larger for a while.

At a measured displacement the temperature lies between the branches of the loop. A correction beyond them is reduced:
the displacement has much less noise than the temperature, so a small contradiction is an error of the temperature.
"""

from __future__ import annotations

from math import inf, isfinite, nan

from smadrive.control.estimation.gain import GainTable
from smadrive.control.estimation.innovation import InnovationTest
from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.hysteresis import HysteresisState
from smadrive.hysteresis.reversal import Play
from smadrive.wire.branch_temperatures import BranchTemperatures
from smadrive.wire.wire_model import WireModel, WireState

DEAD_BAND_NOISES = 0.2
"""Radius of the dead band with a measured displacement, in standard deviations of the thermocouple's noise. It is less
than 1, because a predicted temperature has less noise than a reading."""

BLIND_NOISES, DISTURBED_NOISES = 1.0, 2.0
"""The same without a measured displacement, in calm air and in a disturbance: the step then ends at a corrected
temperature, which has more noise, and with the larger gain still more."""

DRAFT_SHARE = 0.1
"""An unexplained power of more than this share of the heat loss is a draft, and changes in proportion to the loss."""

MOST_DRAFT, MOST_DRAFT_HELD = 0.8, 2.0
"""Largest additional loss by a draft, as a share of the identified loss: without a displacement sensor, and while its
reading is held.

Thermocouple and resistance cannot tell a stronger draft from a bead that comes off: hot austenite has the resistance of
a colder wire that is not fully transformed. A held reading is moved by the model and does not contradict it. A larger
share would overheat a wire whose bead comes off.
"""

MARGIN_NOISES, MARGIN_SHARE = 3.0, 0.01
"""The displacement that limits the temperature may be wrong by this many standard deviations of its noise. In a larger
contradiction than `MOST_REDUCED_C` it may be wrong by this share of the travel, too, because the zero of a sensor has
an error: at the cold end it would count as tens of kelvin."""

MOST_REDUCED_C = 1.0
"""Largest reduction of one correction by this limit, K."""

MOST_SHIFT_C = 10.0
"""Largest shift of the transformation by a changed load, K: about 75 MPa.

A displacement sensor that is stuck looks like a load that grows with the temperature. A larger shift would overheat the
wire.
"""

LEAST_EXCESS_C = 5.0
"""Least difference from the ambient temperature, K, at which the power of a draft is proportional to the difference."""

MOST_READ_C = 30.0
"""Largest innovation of the thermocouple, K. A larger one is a wrong sample; the supervisor trips if it lasts."""


class WireObserver:
    """Estimates wire temperature, thermocouple temperature, unexplained power and hysteresis state (Kalman filter).

    `noise_c` and `noise_mm` are the standard deviations of the noise of thermocouple (K) and displacement (mm). The
    gains are solved for updates every `period_s`.
    """

    def __init__(self, wire: WireModel, period_s: float, noise_c: float, noise_mm: float) -> None:
        self._wire = wire
        self._model = wire.model
        self._balance = wire.balance
        noise = noise_mm / abs(wire.travel_mm)
        self._noise_mm = noise_mm
        self._gains = GainTable(wire, period_s, noise_c, noise)
        self._test = InnovationTest(period_s, noise_c, noise)
        self._branches = BranchTemperatures(wire.model)
        self._seeing_c = DEAD_BAND_NOISES * noise_c
        self._blind_c, self._disturbed_c = BLIND_NOISES * noise_c, DISTURBED_NOISES * noise_c

    def start(self, reading_c: float, displacement_mm: float) -> WireEstimate:
        """Return the first estimate, for a wire at rest.

        Without a measured displacement (NaN), the hysteresis state lies on the heating branch.
        """
        measured_mm = displacement_mm if isfinite(displacement_mm) else None
        hysteresis = self._model.initial_state(reading_c, measured_mm)
        return WireEstimate(reading_c, reading_c, hysteresis, 0.0, Play(reading_c))

    def adopt(self, estimate: WireEstimate, of: WireObserver) -> WireEstimate:
        """Return the estimate of the observer `of`, converted to the model of this observer.

        The temperatures and the turning points stay. The displacement becomes the nearest displacement that the model
        of this observer can have.
        """
        return estimate._replace(hysteresis=self._model.adopted(estimate.hysteresis, of._model))

    def cooling(self, estimate: WireEstimate) -> float:
        """Return the estimated heat loss, divided by the loss of the heat balance; NaN near the ambient temperature."""
        excess_c = estimate.temperature_c - self._balance.ambient_c
        if excess_c < LEAST_EXCESS_C:
            return nan
        return 1.0 - estimate.disturbance_w / (self._balance.loss_w_per_k * excess_c)

    def predict(self, before: WireEstimate, power_w: float, dt_s: float) -> WireEstimate:
        """Return the estimate `dt_s` seconds after `before`, for a wire heated with `power_w`, by the model alone."""
        return self._predicted(before, power_w, dt_s, before.radius_c)

    def update(
        self,
        before: WireEstimate,
        reading_c: float,
        displacement_mm: float,
        power_w: float,
        dt_s: float,
        noise_mm: float | None = None,
        *,
        by_sensor: bool = True,
        is_new: bool = True,
    ) -> WireEstimate:
        """Return the estimate `dt_s` seconds after `before`, corrected by the measurements at this time.

        The wire was heated with `power_w` since `before`. `reading_c` is the reading of the thermocouple. NaN marks a
        missing measurement. `noise_mm` is the standard deviation of this displacement; None takes the `noise_mm` of the
        observer. Without `by_sensor`, the displacement follows from the resistance. `is_new` is False for a
        displacement that was read before the last update.
        """
        if isfinite(displacement_mm):
            expected = self._predicted(before, power_w, dt_s, self._seeing_c)
            read_c = _innovation_c(reading_c, expected.thermocouple_c)
            most_draft = (inf if is_new else MOST_DRAFT_HELD) if by_sensor else MOST_DRAFT
            least_w = self._draft_w(most_draft, expected.temperature_c)
            noise_mm = noise_mm or self._noise_mm
            return self._corrected_by_both(expected, read_c, displacement_mm, noise_mm, least_w, is_new=is_new)
        wire_c, thermocouple_c, disturbance_w = self._heated(before, power_w, dt_s)
        read_c = _innovation_c(reading_c, thermocouple_c)
        evidence = self._test.by_reading(before.evidence, read_c, wire_c - thermocouple_c)
        correction = self._gains.by_reading(read_c, evidence.level)
        wire_c += correction.temperature_c
        radius_c = self._blind_c + evidence.level * (self._disturbed_c - self._blind_c)
        play, hysteresis = self._stepped(before, wire_c, radius_c)
        thermocouple_c += correction.thermocouple_c
        disturbance_w = max(disturbance_w + correction.disturbance_w, self._draft_w(MOST_DRAFT, wire_c))
        return WireEstimate(wire_c, thermocouple_c, hysteresis, disturbance_w, play, radius_c, evidence, before.shift_c)

    def _draft_w(self, share: float, wire_c: float) -> float:
        """Return the unexplained power of a draft that adds this share of the identified loss, W: a negative power."""
        return -share * self._balance.loss_w_per_k * max(wire_c - self._balance.ambient_c, LEAST_EXCESS_C)

    def _predicted(self, before: WireEstimate, power_w: float, dt_s: float, radius_c: float) -> WireEstimate:
        """Return the prediction, with a dead band of the radius `radius_c`."""
        wire_c, read_c, disturbance_w = self._heated(before, power_w, dt_s)
        play, hysteresis = self._stepped(before, wire_c, radius_c)
        return WireEstimate(wire_c, read_c, hysteresis, disturbance_w, play, radius_c, before.evidence, before.shift_c)

    def _heated(self, before: WireEstimate, power_w: float, dt_s: float) -> tuple[float, float, float]:
        """Return the predicted temperatures of wire and thermocouple, °C, and the predicted unexplained power, W."""
        state, total_w = WireState(before.temperature_c, before.hysteresis), power_w + before.disturbance_w
        wire_c = self._wire.temperature_c(state, total_w, dt_s)
        read_c = self._balance.step_thermocouple(before.thermocouple_c, before.temperature_c, wire_c, dt_s)
        return wire_c, read_c, before.disturbance_w * self._growth(before, wire_c)

    def _growth(self, before: WireEstimate, wire_c: float) -> float:
        """Return the factor of the unexplained power for a change of the wire temperature to `wire_c`.

        The power of a draft (negative) is proportional to the excess over the ambient temperature, and so is the power
        of a lack of convection (positive). A lack of convection is less than the whole heat loss. A larger positive
        power has another cause, and its factor is 1: if this power grew with the temperature that it raises, the
        estimate would diverge. A power up to `DRAFT_SHARE` of the heat loss has the factor 1, too.
        """
        excess_c = before.temperature_c - self._balance.ambient_c
        loss_w = self._balance.loss_w_per_k * excess_c
        if abs(before.disturbance_w) <= DRAFT_SHARE * loss_w or before.disturbance_w >= loss_w:
            return 1.0
        return max(wire_c - self._balance.ambient_c, LEAST_EXCESS_C) / max(excess_c, LEAST_EXCESS_C)

    def _stepped(self, before: WireEstimate, wire_c: float, radius_c: float) -> tuple[Play, HysteresisState]:
        """Return the state of the dead band and of the hysteresis model after a step to `wire_c`."""
        play = before.play if radius_c == before.radius_c else before.play.resized(before.radius_c, radius_c)
        play = play.moved(wire_c, radius_c)
        return play, self._model.step(before.hysteresis, play.output(radius_c) - before.shift_c)

    def _corrected_by_both(
        self,
        expected: WireEstimate,
        read_c: float,
        displacement_mm: float,
        noise_mm: float,
        least_w: float,
        *,
        is_new: bool,
    ) -> WireEstimate:
        """Return the estimate corrected by thermocouple and displacement.

        `read_c` is measured - expected temperature of the thermocouple, `least_w` the least unexplained power. The
        input of the hysteresis model moves with the temperature, but the model makes no step: the correction of the
        phase already contains the effect of the temperature.
        """
        phase_error = (displacement_mm - expected.hysteresis.y) / self._wire.travel_mm
        gap_c = expected.temperature_c - expected.thermocouple_c
        noises = max(noise_mm / self._noise_mm, 1.0)
        evidence = self._test.by_both(expected.evidence, read_c, gap_c, phase_error, noises, is_new=is_new)
        slope = self._wire.phase_per_k(expected.hysteresis, expected.play.direction or 1)
        wire_c, thermocouple_c, power_w, shift_c, phase = self._gains.by_both(
            slope, read_c, phase_error, evidence, noise_mm / abs(self._wire.travel_mm)
        )
        limited_c = min(max(expected.shift_c + shift_c, -MOST_SHIFT_C), MOST_SHIFT_C)
        shift_c = limited_c - expected.shift_c
        y = expected.hysteresis.y + self._wire.travel_mm * phase
        wire_c += self._reduction_c(expected.hysteresis.v + wire_c - shift_c, y, noise_mm)
        return WireEstimate(
            expected.temperature_c + wire_c,
            expected.thermocouple_c + thermocouple_c,
            self._model.corrected(expected.hysteresis, expected.hysteresis.v + wire_c - shift_c, y),
            max(expected.disturbance_w + power_w, least_w),
            Play(expected.play.position + wire_c, expected.play.direction),
            expected.radius_c,
            evidence,
            limited_c,
        )

    def _reduction_c(self, input_c: float, y: float, noise_mm: float) -> float:
        """Return the change that brings the input of the hysteresis model between the branches at the output y, K."""
        margin_mm = MARGIN_NOISES * noise_mm
        outside_c = self._branches.nearest_c(input_c, y, margin_mm) - input_c
        if abs(outside_c) > MOST_REDUCED_C:
            margin_mm += MARGIN_SHARE * abs(self._wire.travel_mm)
            outside_c = self._branches.nearest_c(input_c, y, margin_mm) - input_c
        return min(max(outside_c, -MOST_REDUCED_C), MOST_REDUCED_C)


def _innovation_c(reading_c: float, expected_c: float) -> float:
    """Return the limited difference of the reading from its expected value, K; 0 without a reading."""
    return min(max(reading_c - expected_c, -MOST_READ_C), MOST_READ_C) if isfinite(reading_c) else 0.0
