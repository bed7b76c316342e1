"""The phase transformation of a wire under stress: the austenite fraction ξ from temperature T and history.

The stress s raises the temperatures of the transformation by s/C_A when heating and by s/C_M when cooling
(Clausius-Clapeyron; C_A and C_M in MPa/K). So the input of the hysteresis is v instead of T:

    heating   v = T - s/C_A          cooling   v = T - s/C_M          s = (preload + stiffness · stroke · ξ) / area

With a dead weight s is constant. With a spring, the contracting wire stretches the spring, so ξ depends on v, and v
depends on ξ. Because s rises with v, the equation v + s(ξ(v))/C = T has exactly one solution, where C is C_A or C_M.
Newton's method finds this solution with the slope dξ/dv.
"""

from __future__ import annotations

from math import pi
from typing import Any, Literal, NamedTuple, Protocol, TypeVar

from firmware_sim.config import Bias, Branches, Transformation
from firmware_sim.physics.flexinol import COOLING_MPA_PER_K, HEATING_MPA_PER_K
from firmware_sim.physics.preisach import Preisach
from smadrive.hysteresis import DuhemModel
from smadrive.hysteresis.mixture import GaussianMixture

CLOSE_K = 1e-6
MAX_STEPS = 20

StateT = TypeVar("StateT")


class Hysteresis(Protocol[StateT]):
    """A map from the history of an input v, in °C, to the austenite fraction.

    Its methods do not change the state that they get.
    """

    def start(self, v: float) -> StateT:
        """Return the state of a wire whose input was raised from a much lower value to `v`, in °C."""
        ...

    def phase(self, state: StateT) -> float:
        """Return the austenite fraction ξ, from 0 (martensite) to 1."""
        ...

    def slope(self, state: StateT, v: float, rising: bool) -> float:
        """Return the slope of the austenite fraction, in 1/K, for an input that rises or falls from `v`."""
        ...

    def moved(self, state: StateT, v0: float, v1: float) -> StateT:
        """Return the state after the input changed monotonically from `v0` to `v1`, in °C."""
        ...


class Duhem:
    """A Duhem model. Its state is the austenite fraction."""

    def __init__(self, branches: Transformation) -> None:
        model = DuhemModel.mixture(
            heating=_mixture(branches, "heating"), cooling=_mixture(branches, "cooling"), input_range=branches.range_c
        )
        self.moved = model.engine.move
        self.slope = model.engine.slope
        self._target = model.engine.target

    def start(self, v: float) -> float:
        """Return the austenite fraction on the heating branch at the input `v`, in °C."""
        return self._target(v, rising=True)

    def phase(self, state: float) -> float:
        """Return the austenite fraction ξ."""
        return state


class LoadedTransformation:
    """The transformation of a wire under a bias load.

    Without `bias`, the transformation temperatures in the config hold for the wire under a constant load. A further
    load then shifts these temperatures as those of Flexinol wire.
    """

    def __init__(self, transformation: Transformation, bias: Bias | None, stroke_mm: float, ambient_c: float) -> None:
        self._mpa_per_k = (
            (HEATING_MPA_PER_K, COOLING_MPA_PER_K) if bias is None else (bias.heating_mpa_per_k, bias.cooling_mpa_per_k)
        )
        self._hysteresis = _hysteresis(transformation)
        heating, cooling = (_Shift(0.0, 0.0), _Shift(0.0, 0.0)) if bias is None else _shifts(bias, stroke_mm)
        self._heating, self._cooling = heating, cooling
        self._temperature_c = ambient_c
        self._state = self._hysteresis.start(ambient_c - heating.unstretched_k)
        self.phase = self._hysteresis.phase(self._state)

    def slope(self, *, rising: bool) -> float:
        """Return the present slope dξ/dT, in 1/K, for a rising or falling temperature."""
        shift = self._heating if rising else self._cooling
        slope = self._hysteresis.slope(self._state, self._input(shift), rising)
        return slope / (1.0 + shift.per_phase_k * slope)

    def move_to(self, temperature_c: float) -> None:
        """Move the temperature monotonically to `temperature_c`."""
        rising = temperature_c > self._temperature_c
        shift = self._heating if rising else self._cooling
        self._move(shift, self._input(shift), temperature_c, rising)

    def change_stress(self, mpa: float, latent_k: float) -> float:
        """Raise the stress by `mpa`. Return the resulting change of the wire temperature, in K.

        `latent_k` is the latent heat divided by the heat capacity. A load that turns the fraction dξ to martensite
        releases latent heat, which warms the wire by `latent_k` dξ. This warming cancels a part of the change of v.
        """
        rising = mpa < 0.0
        before = self._heating if rising else self._cooling
        v0, heated = self._input(before), latent_k * self.slope(rising=rising)
        heating_k, cooling_k = mpa / self._mpa_per_k[0], mpa / self._mpa_per_k[1]
        self._heating, self._cooling = self._heating.by(heating_k), self._cooling.by(cooling_k)
        change_k = (heating_k if rising else cooling_k) * heated / (1.0 + heated)
        after = self._heating if rising else self._cooling
        self._move(after, v0, self._temperature_c + change_k, rising)
        return change_k

    def _input(self, shift: _Shift) -> float:
        """Return the present input v of the hysteresis on the branch that has this shift."""
        return self._temperature_c - (shift.unstretched_k + shift.per_phase_k * self.phase)

    def _move(self, shift: _Shift, v0: float, temperature_c: float, rising: bool) -> None:
        """Move the input from `v0` to the equilibrium at `temperature_c` under the stress of `shift`."""
        self._state = (
            self._moved_against_spring(shift, v0, temperature_c, rising)
            if shift.per_phase_k
            else self._hysteresis.moved(self._state, v0, temperature_c - shift.unstretched_k)
        )
        self._temperature_c = temperature_c
        self.phase = self._hysteresis.phase(self._state)

    def _moved_against_spring(self, shift: _Shift, v0: float, temperature_c: float, rising: bool) -> Any:
        """Return the hysteresis state in equilibrium with the spring at `temperature_c`.

        `v0` is the input before the move. Newton's method, kept between two bounds, finds the equilibrium.
        """
        hysteresis = self._hysteresis
        bounds = sorted((v0, temperature_c - (shift.unstretched_k + shift.per_phase_k * self.phase)))
        v, state, phase = v0, self._state, self.phase
        for _ in range(MAX_STEPS):
            residual_k = temperature_c - (shift.unstretched_k + shift.per_phase_k * phase) - v
            if abs(residual_k) < CLOSE_K:
                break
            bounds[residual_k < 0] = v
            v += residual_k / (1.0 + shift.per_phase_k * hysteresis.slope(state, v, rising))
            if not bounds[0] <= v <= bounds[1]:
                v = sum(bounds) / 2
            state = hysteresis.moved(self._state, v0, v)
            phase = hysteresis.phase(state)
        return state


def _hysteresis(transformation: Transformation) -> Hysteresis[Any]:
    return Preisach(transformation) if transformation.kind == "preisach" else Duhem(transformation)


class _Shift(NamedTuple):
    """The shift of a branch under stress, in K.

    unstretched_k   shift at the austenite fraction 0
    per_phase_k     further shift per unit of austenite fraction
    """

    unstretched_k: float
    per_phase_k: float

    def by(self, further_k: float) -> _Shift:
        """Return the shift after an additional load that shifts the branch by another `further_k`."""
        return self._replace(unstretched_k=self.unstretched_k + further_k)


def _shifts(bias: Bias, stroke_mm: float) -> tuple[_Shift, _Shift]:
    """Return the shifts of the heating branch and of the cooling branch by the bias load, in K; see `_Shift`."""
    area_mm2 = pi * bias.diameter_mm**2 / 4
    unstretched_mpa, per_phase_mpa = bias.preload_n / area_mm2, bias.stiffness_n_per_mm * stroke_mm / area_mm2
    heating, cooling = (
        _Shift(unstretched_mpa / mpa_per_k, per_phase_mpa / mpa_per_k)
        for mpa_per_k in (bias.heating_mpa_per_k, bias.cooling_mpa_per_k)
    )
    return heating, cooling


def _mixture(branches: Transformation, branch: Literal["heating", "cooling"]) -> GaussianMixture:
    parts: list[Branches] = [branches, *([branches.second] if branches.second else [])]
    second = branches.second.share if branches.second else 0.0
    return GaussianMixture(
        (1.0 - second, second)[: len(parts)],
        tuple(getattr(part, f"mu_{branch}_c") for part in parts),
        tuple(getattr(part, f"sigma_{branch}_c") for part in parts),
    )
