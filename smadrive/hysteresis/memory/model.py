"""T-S fuzzy Duhem rules with memory: rules and a Preisach plane in parallel.

    w = (1 - share) x + share p          dx = (a(v) x + b(v)) dv          dp = e(v, v_r) dv

v is the input and w the state. x is the state of a T-S fuzzy Duhem model (see tsfuzzy.py): its slope depends on v, on x
and on the direction of v. p is the state of a Preisach plane (see plane.py): its slope e depends on v, on the
direction, and on the last turning point v_r, a third premise of its rules. The two parts forget differently: in x, the
effect of a turning point decays exponentially; in p, it stays until v passes this turning point again.

Along a section v_r is constant. So the exact step of x and two values of the Everett function give w at any distance. p
is monotone and lies in [0, 1]. If x does so as well (see certificate.py), w is also monotone and lies in [0, 1].

The values v and w alone do not determine x and p. `initial_state` therefore assumes the history of a first-order
reversal curve: from the hot end of the range down to one turning point, then up to v. Exactly one such curve passes
through each point between the branches.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from smadrive.errors import ModelError
from smadrive.hysteresis.branch.certify import turned_share
from smadrive.hysteresis.branch.root import Section, find_input, first_guess
from smadrive.hysteresis.certificate import Certificate
from smadrive.hysteresis.memory.plane import PreisachPlane
from smadrive.hysteresis.memory.trajectory import plane_states
from smadrive.hysteresis.model import HysteresisModel, HysteresisState
from smadrive.hysteresis.turning_points import MOST_TURNS, Memory, is_rising, pieces, reversed_at, stays
from smadrive.numerics.arrays import FloatArray
from smadrive.numerics.scalars import real_number

if TYPE_CHECKING:
    from smadrive.hysteresis.fuzzy import Rule
    from smadrive.hysteresis.memory.rule import MemoryRule
    from smadrive.hysteresis.tsfuzzy import TSFuzzyDuhem

_ROUNDING = 1e-12


class TSFuzzyPreisach(HysteresisModel):
    """A T-S fuzzy Duhem model and a Preisach plane in parallel.

    The constructor takes the T-S fuzzy Duhem model as `rules`, and the attribute `local` keeps it. Scale, offset and
    range are those of this model. `share` is the share of the plane in w, more than 0 and at most 1. ModelError for
    another share, and for thresholds outside the range.
    """

    def __init__(self, rules: TSFuzzyDuhem, plane: PreisachPlane, share: float) -> None:
        super().__init__(rules.scale, rules.offset, rules.input_range)
        if not 0 < real_number(share, "memory: share", ModelError) <= 1:
            cure = "give the TSFuzzyDuhem alone if the wire has no memory"
            raise ModelError("must be more than 0 and at most 1", where="memory: share", value=share, cure=cure)
        lower, upper = self.input_range
        ends = sorted((*plane.up_thresholds[[0, -1]].tolist(), *plane.down_thresholds[[0, -1]].tolist()))
        if ends[0] < lower or ends[-1] > upper:
            raise ModelError("outside input_range", where="thresholds", value=(ends[0], ends[-1]), limit=(lower, upper))
        self.local, self.plane, self.share = rules, plane, float(share)
        self._engine, self._rest = rules.engine, 1.0 - float(share)
        self._is_plane = self.share == 1.0  # the state x of the rules then has no effect, and is not computed

    @property
    def rules(self) -> tuple[Rule | MemoryRule, ...]:
        """All rules with an effect: the T-S fuzzy Duhem rules unless `share` is 1, then the rules of the plane."""
        return (self.local.rules if self._rest else ()) + self.plane.rules

    def rules_text(self) -> str:
        """Return the rules as IF-THEN sentences, one per line; the first line gives w as a sum of x and p."""
        return "\n".join([f"w = {self._rest:.6g} x + {self.share:.6g} p", *map(str, self.rules)])

    def admissible(self, v: float) -> tuple[float, float]:
        """Return the smallest and the largest state w that the model can have at input v.

        The rules can have any state in [0, 1], the plane only those between its branches.
        """
        low, high = self.plane.branch(v, rising=True), self.plane.branch(v, rising=False)
        return self.share * low, self._rest + self.share * high

    def certificate(self) -> Certificate:
        """Return the certificate of the T-S fuzzy Duhem rules, but with the `turned_share` of the whole model.

        The Preisach plane needs no certificate: it is always monotone and bounded. The plane does not contract, but one
        sweep over the range wipes out all its memory.
        """
        nodes = self._engine.nodes
        branches = [self.branch(nodes, rising=rising) for rising in (True, False)]
        return replace(self.local.certificate(), turned_share=turned_share(*branches))

    def branch(self, v: FloatArray, *, rising: bool) -> FloatArray:
        """Return the state w at the inputs `v` on the heating branch if `rising`, otherwise on the cooling branch."""
        inputs = np.clip(np.asarray(v, dtype=np.float64), *self.input_range)
        plane = self.plane.branches(inputs, rising=rising)
        return np.asarray(self._rest * self.local.branch(inputs, rising=rising) + self.share * plane)

    def branch_slope(self, v: FloatArray, *, rising: bool) -> FloatArray:
        """Return dw/dv at the inputs `v` on the heating branch if `rising`, otherwise on the cooling branch."""
        turn = self.input_range[0 if rising else 1]
        plane = [self.plane.slope(float(one), turn, rising) for one in np.ravel(v)]
        slope = self._rest * self.local.branch_slope(v, rising=rising) + self.share * np.reshape(plane, np.shape(v))
        return np.asarray(slope)

    def slope(self, state: HysteresisState, direction: int) -> float:
        """Return dy/dv at `state`, for an input that rises (direction > 0) or falls."""
        local, _, turns, _ = state.memory or _memory(state)
        v, rising = state.v, direction > 0
        plane = self.plane.slope(v, turns[-1] if rising == is_rising(turns) else v, rising)
        if self._is_plane:
            return self.scale * plane
        return self.scale * (self._rest * self._engine.slope(local, v, rising) + self.share * plane)

    def _state(self, v: float, memory: Memory) -> HysteresisState:
        w = self._rest * memory[0] + self.share * memory[1]
        return HysteresisState(v, self.offset + self.scale * w, w, memory)

    def _on_branch(self, v: float) -> HysteresisState:
        inside = self._engine.clamp(v)
        local, plane = self._engine.target(inside, rising=True), self.plane.branch(inside, rising=True)
        return self._state(v, Memory(local, plane, self.input_range[:1]))

    def _between(self, v: float, w: float) -> HysteresisState:
        inside = self._engine.clamp(v)
        (x_up, p_up), (x_down, p_down) = (
            (self._engine.target(inside, rising=rising), self.plane.branch(inside, rising=rising))
            for rising in (True, False)
        )
        bottom, top = (self._rest * x + self.share * p for x, p in ((x_up, p_up), (x_down, p_down)))
        place = min(max((w - bottom) / (top - bottom), 0.0), 1.0) if top - bottom > _ROUNDING else 0.0
        plane = p_up + place * (p_down - p_up)
        local = min(max((w - self.share * plane) / self._rest, 0.0), 1.0) if self._rest > 0 else x_up
        return self._state(v, Memory(local, plane, self.plane.history(inside, plane, self.input_range)))

    def _moved(self, state: HysteresisState, v: float) -> HysteresisState:
        engine, v0, v1 = self._engine, state.v, v
        if not (engine.lower <= v0 <= engine.upper and engine.lower <= v1 <= engine.upper):
            v0, v1 = engine.clamp(v0), engine.clamp(v1)
        return self._state(v, self._carried(state.memory or _memory(state), v0, v1))

    def _carried(self, memory: Memory, v0: float, v1: float) -> Memory:
        """Return the memory after the input has moved from v0 to v1, both in the range."""
        if v1 == v0:
            return memory
        local, plane, turns, dropped = memory
        rising = v1 > v0
        if rising != is_rising(turns):
            dropped += 2 * (len(turns) >= MOST_TURNS)
            turns = reversed_at(turns, v0)
        if stays(turns, v1):
            plane += self.plane.change(v0, v1, turns[-1], rising)
        else:
            start = v0
            parts, turns = pieces(turns, v1)
            for turn, end in parts:
                plane += self.plane.change(start, end, turn, rising)
                start = end
        if not self._is_plane:
            local = self._engine.move(local, v0, v1)
        return Memory(local, self.plane.clamp(plane, v1), turns, dropped)

    def _shifted(self, memory: Memory, v0: float, v1: float) -> Memory:
        """Return the memory at the input v1 on the present section; no turning point is added.

        The input may move backwards on this section. If v1 lies beyond the turning point at which this section began,
        the section before it continues from this turning point to v1.
        """
        local, plane, turns, dropped = memory
        turn, rising = turns[-1], memory.rising
        if v1 == v0 or (v1 > v0) == rising:
            return self._carried(memory, v0, v1)
        if len(turns) == 1 or (v1 >= turn if rising else v1 <= turn):
            plane += self.plane.change(v0, v1, turn, rising)
            return Memory(self._engine.section(local, v0, rising)(v1)[0], plane, turns, dropped)
        at_turn = self._shifted(memory, v0, turn)
        return self._carried(at_turn._replace(turns=turns[:-1]), turn, v1)

    def corrected(self, state: HysteresisState, v: float, y: float) -> HysteresisState:
        """Return `state` with the input v and, if the model can have it at v, the output y. No turning point is added.

        The states x of the rules and p of the plane change by the same amount, each within the states possible at v. If
        one of them reaches its limit, the other one takes the rest.
        """
        clamp, inside = self._engine.clamp, self._engine.clamp(v)
        local, plane, turns, dropped = self._shifted(_memory(state), clamp(state.v), inside)
        target = (y - self.offset) / self.scale
        error = target - self._rest * local - self.share * plane
        rules = min(max(local + error, 0.0), 1.0)
        relays = self.plane.clamp((target - self._rest * rules) / self.share, inside)
        if self._rest > 0.0:
            rules = min(max((target - self.share * relays) / self._rest, 0.0), 1.0)
        return self._state(v, Memory(rules, relays, turns, dropped))

    def reach(self, state: HysteresisState, w: float) -> HysteresisState:
        """Return the state at which a wire that moves from `state` reaches the normalised state w.

        The input moves in one direction only. If no input of the range leads to w, the result is the state at the end
        of the range.
        """
        memory, v, before = _memory(state), self._engine.clamp(state.v), state.w
        rising = w > before
        far = self.input_range[1 if rising else 0]
        if v == far:
            return self._moved(state, v)
        turns = memory.turns if rising == memory.rising else reversed_at(memory.turns, v)
        x, plane = memory.local, memory.plane
        local = self._engine.section(x, v, rising)
        for turn, end in pieces(turns, far)[0]:
            section = self._section(local, plane, turn, v, rising)
            a, b = self._engine.local_law(v, rising=rising)
            of_rules = self._rest * (a * x + b)
            slope = of_rules + self.share * self.plane.slope(v, turn, rising)
            guess = first_guess(a * of_rules / slope if slope > 0 else 0.0, slope, w - before, v, end)
            found, before = find_input(section, w, v, end, guess, rising=rising)
            if found != end:
                break
            plane += self.plane.change(v, end, turn, rising)
            x, v = local(end)[0], end
        return self._moved(state, found)

    def _section(self, local: Section, plane: float, turn: float, start: float, rising: bool) -> Section:
        """Return the function that gives w and dw/dv at an input of the section that began at `turn`.

        `plane` is the state p at the input `start` of this section, and `local` gives x and its slope.
        """
        since, rest, share = self.plane.since, self._rest, self.share
        at_turn = plane - since(start, turn, rising)[0]

        def at(v: float) -> tuple[float, float]:
            x, x_slope = local(v)
            p, slope = since(v, turn, rising)
            return rest * x + share * (at_turn + p), rest * x_slope + share * slope

        return at

    def _trajectory(self, v: FloatArray, start: HysteresisState, out: FloatArray) -> None:
        if self._is_plane:
            out.fill(0.0)
        else:
            self._engine.trajectory(v, _memory(start).local, out)
            out *= self._rest
        out += self.share * plane_states(self.plane, np.clip(v, *self.input_range), _memory(start))


def _memory(state: HysteresisState) -> Memory:
    """Return the memory of a state. ModelError for a state of a model without memory."""
    if state.memory is None:
        cure = "begin with initial_state() of this model"
        raise ModelError("belongs to a model without memory", where="state", value=state, cure=cure)
    return state.memory
