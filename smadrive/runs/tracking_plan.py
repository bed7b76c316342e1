"""The plan of a tracking run: its reference is simulated on the model of the wire, and caveats are collected.

Nothing is heated. The caller shows the caveats of the plan before the run.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from smadrive.control.feasibility.feasibility import SMOOTHED_TOLERANCE, TOLERANCE, Feasibility
from smadrive.control.feasibility.simulation import simulate_run
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.holding import APPROACH_S, resting_caveats, resting_mm
from smadrive.control.references.limits import check_end, check_rig_limits
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.hysteresis import TSFuzzyPreisach
from smadrive.hysteresis.turning_points import MOST_TURNS
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.rig.checks.limits import derating_caveats
from smadrive.rig.controllers import tracking_settings
from smadrive.rig.rig import Rig
from smadrive.runs.cycling.cycles import Cycling
from smadrive.runs.health.assessment import expected_of, wire_file_of
from smadrive.safety.arming_checks import check_thermocouple
from smadrive.wire.health.expected_rest import ExpectedRest
from smadrive.wire.identified_wire import IdentifiedWire
from smadrive.wire.recorded_loops import dropped_turns, outside
from smadrive.wire.wire_model import WireModel, WireState, travel_mm

RETURN_S = 10.0
"""Duration of the way back between two cycles of a reference that does not end where it begins."""

NOT_ADAPTED = "adapt = true under [feedback] has an effect only in `smadrive tune`: this run does not change the rules"

SMOOTHED_AGAIN = "the cycles differ from those of the previous part, so their errors cannot be compared"


@dataclass(frozen=True)
class PlannedTracking:
    """A tracking run that was simulated on the model of its wire.

    given                the reference of the user, with the approach
    nearest              the reference that the run tracks; it equals `given` if the wire can follow `given`
    caveats              reasons to distrust the run, one sentence each
    cycling              the plan of the cycles; None if the reference is not repeated
    displacement_from    source of the displacement
    wire_file            model file of the wire; None for a wire from elsewhere
    expected             expected resistance at rest, from the health record beside `wire_file`; None if not identified
    """

    given: Reference
    nearest: Reference
    wire: WireModel
    caveats: tuple[str, ...]
    cycling: Cycling | None = None
    displacement_from: DisplacementFrom = DisplacementFrom.SENSOR
    wire_file: Path | None = None
    expected: ExpectedRest | None = None


def check_reach(given: Reference, identified: IdentifiedWire) -> None:
    """Raise ConfigError if the reference leaves the travel of the model.

    The caveats of the wire are added to the error as notes.
    """
    with _caveats_noted(identified):
        given.check_within(travel_mm(identified.model))


@contextmanager
def _caveats_noted(identified: IdentifiedWire) -> Iterator[None]:
    """Add the caveats of the wire to a ConfigError in the `with` block: often the model is wrong, not the reference."""
    try:
        yield
    except ConfigError as error:
        for caveat in _caveats_of(identified):
            error.add_note(f"the model has a caveat: {caveat}")
        raise


def _caveats_of(identified: IdentifiedWire) -> list[str]:
    source = Path(identified.source).name
    return [f"{source}: {caveat}" if source else caveat for caveat in identified.caveats]


def _memory_caveats(identified: IdentifiedWire, simulated: Feasibility) -> tuple[str, ...]:
    """Return the caveats about the memory of the model on this run; none for a model without memory."""
    if not isinstance(identified.model, TSFuzzyPreisach):
        return ()
    return *_far_from_record(identified, simulated), *_forgotten(identified.model, simulated)


def _forgotten(model: TSFuzzyPreisach, simulated: Feasibility) -> tuple[str, ...]:
    """Return a caveat if the loops of the run have more turning points than the model remembers, otherwise nothing."""
    dropped = dropped_turns(model, simulated.sections_c)
    if not dropped:
        return ()
    many = f"the temperature makes so many loops inside each other that the model forgets {dropped} turning points"
    return (f"{many}, those of the smallest loops, because it remembers {MOST_TURNS}: use fewer cycles",)


def _far_from_record(identified: IdentifiedWire, simulated: Feasibility) -> tuple[str, ...]:
    """Return a caveat if the model is used far from the loops of its record, otherwise nothing."""
    run, far = simulated.sections_c, outside(simulated.sections_c, identified.sections_c)
    if not far:
        return ()
    (turn_c, end_c), count = far[0], f"{len(far)} of {len(run)} sections of the temperature path"
    where = f"are far from the recorded loops, the first from {turn_c:.0f} to {end_c:.0f} °C"
    return (f'{count} {where}: record more loops, by plan = "forc" in [excitation]',)


def plan_tracking(
    rig: Rig,
    given: Reference,
    identified: IdentifiedWire,
    *,
    smooth: bool,
    smooth_option: str,
    cycling: Cycling | None = None,
    displacement_from: DisplacementFrom | None = None,
) -> PlannedTracking:
    """Add the approach from the present state of the wire to `given`, and simulate the run. Nothing is heated.

    With `cycling` the reference is repeated. A reference that is repeated already runs with all its cycles, and one
    without an end is a ConfigError. If the wire cannot follow `given` and `smooth` is True, the run tracks the
    nearest reference; ConfigError if the wire cannot follow its cycles either. A continuation tracks the cycles of the
    previous part as they are, also if that part had smoothed them. If `smooth` is False, ConfigError names
    `smooth_option`, the option of the user that sets `smooth`. `displacement_from` replaces the source of the
    displacement in the rig file. A reference outside the temperature or displacement limits of the rig is a
    ConfigError, too.
    """
    in_file = identified.wire_model(rig.nominal_balance)
    wire = rig.usable(in_file)
    chosen, limits = displacement_from or rig.config.displacement_from, rig.config.limits
    limit_c = limits.temperature_max_c
    check_rig_limits(given.scored_mm, limits.displacement_min_mm, limits.displacement_max_mm)
    with _caveats_noted(identified):
        measured = rig.measure()
        start, once = _start(rig, measured, given, wire, chosen)
        if cycling is None:
            given, cycling = once, Cycling(once.repeats) if once.repeats > 1 else None
        else:
            given = once.repeated(cycling.remaining, RETURN_S)
        check_end(given.duration_s)
        continues = cycling is not None and bool(cycling.continues)
        tolerance = SMOOTHED_TOLERANCE if continues else TOLERANCE
        simulated = followed = _simulated(rig, given, wire, start, tolerance)
        way_back_s = given.cycle_s - once.cycle_s
        simulated.check(limit_c, smooth=smooth, smooth_option=smooth_option, way_back_s=way_back_s)
        nearest = simulated.nearest
        if cycling is not None and not simulated.feasible:
            followed = _simulated(rig, nearest, wire, start)
            followed.check_smoothed()
            followed.check(limit_c, smooth=smooth, smooth_option=smooth_option)
    changed = (SMOOTHED_AGAIN,) if continues and not simulated.feasible else ()
    not_adapted = (NOT_ADAPTED,) if rig.config.feedback.adapt else ()
    check = rig.check_sensing if displacement_from is None else rig.check_chosen
    sensing = *check(in_file, chosen, start.temperature_c), *resting_caveats(wire.model, measured, chosen)
    of_the_model = *_caveats_of(identified), *_memory_caveats(identified, followed)
    held_back = derating_caveats(followed.hottest_c, limit_c)
    caveats = *simulated.caveats, *changed, *held_back, *of_the_model, *not_adapted, *sensing
    from_record = wire_file_of(identified), expected_of(identified)
    return PlannedTracking(given, nearest, wire, caveats, cycling, chosen, *from_record)


def _start(
    rig: Rig, measured: Measurement, given: Reference, wire: WireModel, displacement_from: DisplacementFrom
) -> tuple[WireState, Reference]:
    """Return the state of the wire that was measured, and `given` with the approach from this state."""
    check_thermocouple(measured)
    start_mm = resting_mm(wire.model, measured, displacement_from)
    rig.check_balance(wire.balance)
    start = WireState(measured.temperature_c, wire.model.initial_state(measured.temperature_c, start_mm))
    return start, given.with_approach(start_mm, APPROACH_S)


def _simulated(
    rig: Rig, reference: Reference, wire: WireModel, start: WireState, tolerance: float = TOLERANCE
) -> Feasibility:
    inverse, settings = HysteresisInverse(wire.model), tracking_settings(rig.config)
    return simulate_run(reference, wire, inverse, settings, start, tolerance)
